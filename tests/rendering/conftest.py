"""Fixtures for rendering tests."""

import pytest

from viewer.rendering.offscreen import Offscreen


@pytest.fixture(scope="module")
def offscreen():
    with Offscreen() as result:
        yield result
