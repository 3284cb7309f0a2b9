"""Fixtures of the interface's tests: apps that are closed again, and tiny files."""

from __future__ import annotations

import pytest
from app.driver import Driver
from app.tiny import write_rig


@pytest.fixture(autouse=True)
def _own_state_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


@pytest.fixture
def rig(tmp_path):
    """The paths of the tiny skeleton and its skin."""
    return write_rig(tmp_path)


@pytest.fixture
def drive():
    """Open apps and close them after the test."""
    opened = []

    def open_app(*paths, **settings):
        opened.append(Driver(*paths, **settings))
        return opened[-1]

    yield open_app
    for driver in reversed(opened):
        driver.close()


@pytest.fixture
def hand(drive, rig):
    """A hand on an app that shows the tiny figure."""
    return drive(*rig)
