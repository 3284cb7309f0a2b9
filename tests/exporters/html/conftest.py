"""One Chromium for all tests of pages: starting it takes longer than most of them."""

import pytest
from browser import Browser


@pytest.fixture(scope="package")
def browser():
    with Browser() as found:
        yield found


@pytest.fixture(autouse=True)
def poster(monkeypatch):
    """Small posters, which would take most of the time of an export; return their size."""
    size = 64, 36
    monkeypatch.setattr("viewer.exporters.html._POSTER", size)
    return size
