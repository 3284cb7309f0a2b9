"""Fixtures for interface tests: apps that are closed after each test, and tiny files."""

import numpy as np
import pytest
from app import box_body
from app.curves.plotted import SIZE, clip_text
from app.driver import Driver
from formats.synthetic_smpl import model
from imgui_bundle import imgui


@pytest.fixture(autouse=True)
def _own_state_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    settings = tmp_path / "state" / "models.json"
    monkeypatch.setattr("viewer.models._settings_file", lambda: settings)


@pytest.fixture(scope="session", autouse=True)
def _lasting_notes():
    """Show messages until a test ends, however long it takes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("viewer.app.core.messages._NOTE_SECONDS", 1e6)
        yield


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
    """A test driver on an app that shows the tiny figure."""
    return drive(*rig)


@pytest.fixture
def drive_body(drive, tmp_path):
    """Open apps that show a synthetic body model: "box" or a kind of the SMPL family."""

    def open_body(kind="box", size=(1000, 1000), pixels_per_point=0.25, **columns):
        arrays = box_body.arrays() if kind == "box" else model(kind, **columns)
        path = tmp_path / f"{kind}.npz"
        np.savez(path, **arrays)
        return drive(path, size=size, samples=1, pixels_per_point=pixels_per_point)

    return open_body


@pytest.fixture
def show_curves(drive, rig, tmp_path):
    """Open apps on the Curves panel of the tiny rig; the arm's curves are shown."""

    def open_panel(**settings):
        (tmp_path / "wave.anim").write_text(clip_text())
        hand = drive(*rig, tmp_path / "wave.anim", size=SIZE, **settings)
        hand.show_panel("Curves")
        hand.state.selected_joint = 1
        hand.step(3)
        hand.click("curve arm.x")
        hand.step(3)
        return hand

    return open_panel


@pytest.fixture
def curves(show_curves):
    """A test driver on the Curves panel of the tiny rig."""
    return show_curves()


@pytest.fixture
def box(drive_body):
    """A test driver on an app that shows the box, with all panels open."""
    return drive_body()


@pytest.fixture
def texts(monkeypatch):
    """Plain text shown by panels, in drawing order; clear the list to collect again."""
    written = []

    def recorder(write):
        def record(text):
            written.append(text)
            write(text)

        return record

    for name in ("text_unformatted", "text_disabled", "text_wrapped"):
        monkeypatch.setattr(imgui, name, recorder(getattr(imgui, name)))
    return written
