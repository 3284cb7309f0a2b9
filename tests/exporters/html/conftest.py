"""One Chromium for all tests of pages: starting it takes longer than most of them."""

import pytest
from browser import Browser


@pytest.fixture(scope="package")
def browser():
    with Browser() as found:
        yield found
