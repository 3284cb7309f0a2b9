"""Fixtures for rendering tests."""

from __future__ import annotations

import pytest

from viewer.rendering.offscreen import Offscreen


@pytest.fixture(scope="module")
def offscreen():
    with Offscreen() as result:
        yield result
