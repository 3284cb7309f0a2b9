"""File names that the window suggests for recordings, screenshots, poses, clips and exports."""

import pytest
from formats.capture_files import body, write_frames

from viewer.app.curves.editing import ask_for_clip, new_clip
from viewer.app.files.files import Files
from viewer.app.files.motion_export import ask_for_motion
from viewer.app.recording.record_dialog import KINDS, RecordSettings, ask_where


@pytest.fixture
def recorded(drive, tmp_path):
    """A test driver on a capture of two people, drawn with the bundled body."""
    folder = write_frames(tmp_path / "seq_smpl" / "smpl", {0: [body(0), body(7)], 1: [body(0)]})
    return drive(folder, samples=1, size=(1000, 700))


def test_recordings_are_named_after_the_sequence(recorded):
    offered = {}
    for kind in KINDS:
        ask_where(recorded.state, RecordSettings(kind=kind))
        offered[kind] = recorded.state.of(Files).dialog.name
    assert offered.pop("pictures") == "seq_smpl_{frame:05}.png"
    assert offered.pop("sheet") == "seq_smpl_sheet.png"
    assert offered and offered == {kind: f"seq_smpl{kind}" for kind in offered}


def test_files_for_one_person_are_named_after_them(recorded):
    state = recorded.state
    state.choose_actor(1)
    recorded.menu("menu File", "Save pose…")
    assert state.of(Files).dialog.name == "seq_smpl_7_pose.json"
    recorded.key("escape")
    recorded.menu("menu File", "Export…")
    assert state.of(Files).dialog.name == "seq_smpl_7.obj"


def test_motions_of_all_people_are_named_after_the_sequence(recorded):
    ask_for_motion(recorded.state)
    assert recorded.state.of(Files).dialog.name.startswith("seq_smpl.")


def test_screenshot_is_named_after_the_sequence(recorded, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    recorded.key("f12")
    recorded.step(2)
    assert (tmp_path / "seq_smpl.png").is_file()


def test_figure_and_clip_files_are_named_after_the_figure(hand):
    state = hand.state
    new_clip(state)
    hand.step(2)
    assert state.actor.clip.name == "tiny"
    ask_for_clip(state)
    assert state.of(Files).dialog.name == "tiny_edited.anim"
    ask_where(state, RecordSettings(kind="sheet"))
    assert state.of(Files).dialog.name == "tiny_sheet.png"


def test_name_with_a_slash_does_not_suggest_a_folder(hand):
    hand.state.actor.called = "../a b"
    hand.menu("menu File", "Export…")
    assert hand.state.of(Files).dialog.name == ".._a_b.obj"
