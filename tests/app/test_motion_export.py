"""Motions exported from the window: beside the frame loop, never over what is open."""

from __future__ import annotations

import numpy as np
import pytest

from viewer.app.motion_actions import motion_suffixes, save_motion
from viewer.rig.clip import Channel, Clip


@pytest.fixture
def moving(drive, rig):
    hand = drive(*rig, size=(1000, 700), samples=1)
    still = hand.state.actor.figure.skeleton.n_dofs
    moved = Channel(0, np.array([0.0, 1.0]), np.array([0.0, 0.5]), (("linear", "linear"),) * 2)
    rest = [Channel(n, np.zeros(1), np.zeros(1), (("flat", "flat"),)) for n in range(1, still)]
    hand.state.actor.clip = Clip("slide", (moved, *rest), 0.0, 1.0)
    hand.step(3)
    return hand


def finish(hand):
    while hand.state.job is not None:
        hand.step(1)


def test_every_suffix_offered_is_written(moving, tmp_path):
    for suffix in motion_suffixes():
        save_motion(moving.state, tmp_path / f"slide{suffix}")
        finish(moving)
        assert moving.state.error == "", suffix
        assert (tmp_path / f"slide{suffix}").stat().st_size > 0
    assert motion_suffixes()[0] == ".bvh"
    assert (tmp_path / "slide.bvh").read_text().startswith("HIERARCHY")


def test_only_the_range_that_is_played_is_written(moving, tmp_path):
    moving.state.playback.set_range(0.2, 0.5)
    save_motion(moving.state, tmp_path / "part.bvh")
    finish(moving)
    text = (tmp_path / "part.bvh").read_text()
    assert "Frames: 10\n" in text  # 6 to 15 of 30 a second


def test_menu_asks_where_and_says_what_was_written(moving, tmp_path):
    moving.click("menu File")
    moving.click("Export motion…")
    moving.step(2)
    assert moving.state.dialog is not None and moving.state.dialog.name.endswith(".bvh")
    moving.key("escape")
    moving.state.notes.clear()
    save_motion(moving.state, tmp_path / "slide.bvh")
    finish(moving)
    assert any("slide.bvh" in note.text for note in moving.state.notes)


def test_files_that_are_open_are_never_replaced(moving, tmp_path):
    path = tmp_path / "open.bvh"
    path.write_text("precious")
    moving.state.paths = (*moving.state.paths, path)
    save_motion(moving.state, path)
    assert moving.state.error == f"{path}: is an input file, which is never replaced"
    assert path.read_text() == "precious"


def test_folder_that_does_not_exist_is_one_message(moving, tmp_path):
    save_motion(moving.state, tmp_path / "no" / "slide.bvh")
    assert moving.state.error == f"{tmp_path / 'no' / 'slide.bvh'}: the folder does not exist"
    assert moving.state.job is None
