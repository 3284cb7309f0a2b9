"""Questions before unsaved work is lost: on quitting, opening and closing."""

import gc
import threading
import weakref
from dataclasses import replace

import numpy as np
import pytest
from app.curves.plotted import _center
from app.retargeting.driven import driven_scene
from imgui_bundle import imgui
from PIL import Image
from rigs.animated import animated_leg

import viewer
from viewer.app.closing import Closing, request_quit, unsaved_edits
from viewer.app.core.undo_actions import redo, undo
from viewer.app.files.files import Files
from viewer.app.files.motion_export import save_motion
from viewer.app.files.saving import save_in_background
from viewer.app.playback.animations import choose_animation
from viewer.app.posing.posing import (
    copy_numbers,
    mirror,
    paste_pose,
    reset_joint,
    reset_pose,
    reset_shape,
    save_export,
    save_pose,
)
from viewer.app.recording.recording import RecordingState, RecordSettings
from viewer.app.retargeting.joint_match_panel import (
    ask_where_to_save,
    match_automatically,
    match_joint,
)
from viewer.formats import Source, read
from viewer.media.saving import save_text
from viewer.progress import report
from viewer.rigs.scene import Actor, Scene

WAIT, CANCEL, GO_ON = "Finish first", "Cancel export and quit", "Keep working"
SAVE, DISCARD, STAY = "Save…", "Discard", "Cancel##closing"


def is_over(hand):
    return hand.state.of(Closing).is_over


def asks(hand, label):
    """Return whether a button of a question was drawn in the next frame."""
    hand.state.item_rects.clear()
    hand.step(3)
    return label in hand.state.item_rects


def texts_of(hand):
    return [edit.text for edit in unsaved_edits(hand.state)]


def close_dialog(hand):
    """Press Escape, which may first leave the name field."""
    for _ in range(2):
        if hand.state.of(Files).dialog is not None:
            hand.key("escape")
    assert hand.state.of(Files).dialog is None


@pytest.fixture
def exporting(hand, tmp_path):
    """A test driver on a running export of ``a.obj``, which waits for an event before it ends."""
    is_begun, may_end = threading.Event(), threading.Event()

    def act():
        save_text(tmp_path / "a.obj", "new")
        is_begun.set()
        assert may_end.wait(30.0)
        report(1, 2, "lines")
        return []

    save_in_background(hand.state, act, [tmp_path / "a.obj"])
    assert is_begun.wait(30.0)
    hand.step(2)
    yield hand, may_end
    may_end.set()


def test_quitting_without_work_needs_no_question(hand):
    hand.key("q", "ctrl")
    assert is_over(hand)


def test_quitting_finishes_the_export_first(exporting, tmp_path):
    hand, may_end = exporting
    hand.key("q", "ctrl")
    assert not is_over(hand) and asks(hand, WAIT)
    hand.click(WAIT)
    assert not asks(hand, WAIT) and not is_over(hand)
    may_end.set()
    hand.finish_job()
    assert is_over(hand) and (tmp_path / "a.obj").read_text() == "new"


def test_quitting_cancels_the_export_and_leaves_no_file(exporting, tmp_path):
    hand, may_end = exporting
    files = sorted(tmp_path.iterdir())
    hand.menu("menu File", "Quit")
    hand.click(CANCEL)
    assert not is_over(hand)  # its file is being removed
    may_end.set()
    hand.finish_job()
    assert is_over(hand) and sorted({*files} - {*tmp_path.iterdir()}) == [tmp_path / "a.obj"]


@pytest.mark.parametrize("key", ["", "escape"])
def test_quitting_is_withdrawn_and_the_export_goes_on(exporting, tmp_path, key):
    hand, may_end = exporting
    hand.key("q", "ctrl")
    hand.step(2)
    hand.key(key) if key else hand.click(GO_ON)
    assert not asks(hand, WAIT)
    may_end.set()
    hand.finish_job()
    assert not is_over(hand) and (tmp_path / "a.obj").read_text() == "new"


def test_further_requests_ask_the_same_question(exporting, tmp_path):
    hand, may_end = exporting
    for _ in range(3):
        request_quit(hand.state)  # as a double click on the close button
        hand.key("q", "ctrl")
        assert not is_over(hand) and asks(hand, WAIT)
    hand.click(WAIT)
    assert not asks(hand, WAIT)
    request_quit(hand.state)
    assert asks(hand, WAIT)  # the user may not want to wait any longer
    hand.click(WAIT)
    may_end.set()
    hand.finish_job()
    assert is_over(hand) and (tmp_path / "a.obj").read_text() == "new"


def test_further_requests_do_not_discard_edits(curves):
    delete_key(curves)
    for _ in range(3):
        request_quit(curves.state)
        curves.key("q", "ctrl")
        assert not is_over(curves) and asks(curves, DISCARD)
    curves.click(SAVE)
    request_quit(curves.state)  # while the dialog covers the question
    assert not is_over(curves) and asks(curves, DISCARD)


def test_window_stays_open_if_the_export_is_cancelled_or_fails(exporting, tmp_path):
    hand, may_end = exporting
    hand.key("q", "ctrl")
    hand.click(WAIT)
    hand.key("escape")
    may_end.set()
    hand.finish_job()
    assert not is_over(hand) and not (tmp_path / "a.obj").exists()

    def refuse():
        raise viewer.ViewerError("disk full")

    save_in_background(hand.state, refuse, [tmp_path / "a.obj"])
    hand.state.of(Closing).is_requested = hand.state.of(Closing).waits = True
    hand.finish_job()
    hand.key("escape")
    assert not is_over(hand) and not asks(hand, WAIT)


def test_quitting_during_a_recording_asks_too(curves, tmp_path):
    curves.state.of(RecordingState).settings = RecordSettings(
        kind=".gif", size="own", own_size=(16, 16)
    )
    curves.state.of(RecordingState).wanted = tmp_path / "a.gif"
    curves.step()
    curves.key("q", "ctrl")
    assert asks(curves, "Cancel recording and quit") and not is_over(curves)
    curves.click("Cancel recording and quit")
    curves.step(2)
    assert is_over(curves) and not (tmp_path / "a.gif").exists()


def delete_key(hand):
    hand.click(_center(hand, "key arm.x 1"))
    hand.click("Delete")
    hand.step(2)


def test_edited_keys_are_saved_before_quitting(curves, tmp_path, texts):
    delete_key(curves)
    curves.key("q", "ctrl")
    texts.clear()
    assert asks(curves, SAVE) and not is_over(curves)
    assert {"Save changes before quitting?", "tiny: keys of wave"} <= {*texts}
    curves.click(SAVE)
    assert curves.state.of(Files).dialog.name == "tiny_edited.anim"
    close_dialog(curves)
    assert asks(curves, SAVE)
    curves.click(SAVE)
    curves.step(2)
    curves.click("Save###Save")
    curves.step(3)
    assert is_over(curves)
    assert read(Source.open(tmp_path / "tiny_edited.anim")).channels[6].times.tolist() == [0, 2]


@pytest.mark.parametrize("answer", [DISCARD, STAY])
def test_edited_keys_are_discarded_or_kept(curves, answer):
    delete_key(curves)
    clip = curves.state.actor.clip
    curves.key("q", "ctrl")
    curves.step(2)
    curves.click(answer)
    curves.step(2)
    assert is_over(curves) is (answer == DISCARD)
    assert not asks(curves, SAVE) and curves.state.actor.clip is clip


def test_undone_edits_are_not_unsaved(curves, tmp_path):
    assert texts_of(curves) == []
    delete_key(curves)
    assert texts_of(curves) == ["tiny: keys of wave"]
    undo(curves.state)
    assert texts_of(curves) == []
    redo(curves.state)
    save_motion(curves.state, tmp_path / "edited.bvh")
    curves.finish_job()
    assert texts_of(curves) == []
    undo(curves.state)  # as in the file that was opened
    assert texts_of(curves) == []
    redo(curves.state)
    assert texts_of(curves) == []
    delete_key(curves)
    assert texts_of(curves) == ["tiny: keys of wave"]


def test_part_of_a_motion_does_not_save_its_keys(curves, tmp_path):
    delete_key(curves)
    curves.state.clock.set_range(0.5, 1.0)
    save_motion(curves.state, tmp_path / "part.bvh")
    curves.finish_job()
    assert (tmp_path / "part.bvh").exists() and texts_of(curves) == ["tiny: keys of wave"]


def test_opened_files_wait_for_the_answer(curves, tmp_path, texts):
    delete_key(curves)
    clip, scene = curves.state.actor.clip, curves.state.scene
    other = tmp_path / "tiny.skel"
    curves.open(other)
    texts.clear()
    assert asks(curves, SAVE) and curves.state.scene is scene
    assert "Save changes before opening tiny.skel?" in texts
    curves.click(STAY)
    assert not asks(curves, SAVE)
    assert curves.state.scene is scene and curves.state.actor.clip is clip
    curves.open(other)
    curves.click(DISCARD)
    curves.step(3)
    assert curves.state.scene is not scene and not curves.state.of(Closing).discards
    assert not asks(curves, SAVE)


def test_poses_and_files_that_fail_need_no_question(curves, tmp_path):
    delete_key(curves)
    (tmp_path / "a.skel").write_text("balljoint")
    curves.open(tmp_path / "a.skel")
    assert curves.state.error
    curves.key("escape")
    assert not asks(curves, SAVE)


def test_edits_of_animations_that_do_not_play_are_saved(drive, tmp_path):
    hand = drive(scene=Scene([Actor(animated_leg())]), size=(1180, 760))
    choose_animation(hand.state, 0)
    actor = hand.state.actor
    actor.clip = replace(actor.clip, end=2.0)
    hand.step(2)
    choose_animation(hand.state, 1)
    hand.step(2)
    assert len(texts_of(hand)) == 1 and texts_of(hand)[0].endswith(": keys of wave")
    hand.key("q", "ctrl")
    hand.step(2)
    hand.click(SAVE)
    assert hand.state.of(Files).dialog.name.endswith("_edited.glb")  # never the opened file
    close_dialog(hand)
    hand.step(2)
    hand.click(STAY)
    save_motion(hand.state, tmp_path / "a.glb")
    hand.finish_job()
    assert not hand.state.error and texts_of(hand) == []
    written = viewer.load(tmp_path / "a.glb").actors[0].figure
    found = {one.name: one.clip().channels[0].times[-1] for one in written.animations}
    assert found["wave"] == pytest.approx(actor.figure.animations[0].clip().channels[0].times[-1])
    hand.key("q", "ctrl")
    assert is_over(hand)


@pytest.fixture
def aside(drive):
    """A test driver on a leg with texture coordinates whose first animation was edited."""
    figure = animated_leg()
    mesh = replace(figure.mesh, uvs=np.zeros((figure.mesh.n_vertices, 2)))
    hand = drive(scene=Scene([Actor(replace(figure, mesh=mesh))]), size=(600, 400))
    choose_animation(hand.state, 0)
    hand.state.actor.clip = replace(hand.state.actor.clip, end=2.0)
    hand.step(2)
    choose_animation(hand.state, 1)
    hand.step(2)
    assert len(texts_of(hand)) == 1
    return hand


def test_texture_keeps_the_edits_of_animations_that_do_not_play(aside, tmp_path):
    old = aside.state.actor
    Image.new("RGB", (4, 4), (255, 0, 0)).save(tmp_path / "red.png")
    aside.open(tmp_path / "red.png")
    assert not aside.state.error and aside.state.actor is not old
    assert len(texts_of(aside)) == 1
    undo(aside.state)
    assert aside.state.actor is old and len(texts_of(aside)) == 1
    redo(aside.state)
    choose_animation(aside.state, 0)
    assert aside.state.actor.clip.end == 2.0


def test_edited_animations_do_not_keep_a_replaced_scene(aside, rig):
    old = weakref.ref(aside.state.actor.figure)
    aside.open(*rig)
    aside.click(DISCARD)
    aside.step(3)
    gc.collect()
    assert texts_of(aside) == [] and old() is None


def test_joint_match_by_hand_is_unsaved_until_it_is_automatic_again(drive):
    hand = drive(scene=driven_scene(), size=(1000, 900))
    assert texts_of(hand) == []
    match_joint(hand.state, 0, -1)
    hand.finish_job()
    assert texts_of(hand) == ["body: joint match"]
    hand.key("q", "ctrl")
    hand.step(2)
    hand.click(SAVE)
    hand.step(2)
    assert hand.state.of(Files).dialog.title == "Save joint map"
    close_dialog(hand)
    hand.step(2)
    hand.click(STAY)
    match_automatically(hand.state)
    hand.finish_job()
    assert texts_of(hand) == []


def test_joint_match_is_unsaved_and_saved_while_it_is_applied(drive, tmp_path, monkeypatch):
    monkeypatch.setattr("viewer.app.retargeting.drive_changes._SHORT", 0)
    hand = drive(scene=driven_scene(), size=(1000, 900))
    ask_where_to_save(hand.state)
    save = hand.state.of(Files).dialog.done
    match_joint(hand.state, 0, -1)
    assert hand.state.actor.drive.joint_map is None  # the motion is still being computed
    assert texts_of(hand) == ["body: joint match"]
    save(hand.state, [tmp_path / "map.txt"])
    assert texts_of(hand) == []
    hand.finish_job()
    assert hand.state.actor.drive.joint_map is not None and texts_of(hand) == []


POSE = ["tiny: pose"]


def texts_after_frames(hand):
    hand.step(2)
    return [edit.text for edit in unsaved_edits(hand.state)]


def paste_numbers(hand):
    numbers = [0.1, 0.0, 0.0, 0.25, 0.5, 0.3, 0.2, 0.0, -0.1]  # the file's pose, but moved by 0.1
    imgui.set_clipboard_text(" ".join(map(str, numbers)))
    paste_pose(hand.state)


def scale_figure(hand):
    hand.state.actor.pose.figure_scale = 2.0


@pytest.mark.parametrize(
    "edit",
    [
        lambda hand: hand.drag("arm.x", 0.9),
        lambda hand: hand.enter_value("arm.y", "45"),
        lambda hand: mirror(hand.state),
        paste_numbers,
        scale_figure,
    ],
    ids=["slider", "typed", "mirrored", "pasted", "scaled"],
)
def test_pose_by_hand_is_unsaved_until_it_is_undone_or_reset(hand, edit):
    assert texts_after_frames(hand) == []
    edit(hand)
    assert texts_after_frames(hand) == POSE
    undo(hand.state)
    assert texts_after_frames(hand) == []
    redo(hand.state)
    assert texts_after_frames(hand) == POSE
    reset_pose(hand.state)
    assert texts_after_frames(hand) == []


def test_last_joint_that_is_reset_makes_the_pose_saved(hand):
    hand.drag("arm.x", 0.9)
    hand.drag("root.tx", 0.9)
    hand.step(2)
    reset_joint(hand.state, 1)
    assert texts_after_frames(hand) == POSE
    reset_joint(hand.state, 0)
    # The file's values violate the limits of the root, so the opened pose is restored by R.
    reset_pose(hand.state)
    assert texts_after_frames(hand) == []


def test_copied_pose_is_not_an_edit(hand):
    copy_numbers(hand.state)
    hand.drag("arm.x", 0.9)
    paste_pose(hand.state)
    assert texts_after_frames(hand) == []


@pytest.mark.parametrize("name", ["a.json", "a.obj"])
def test_saved_pose_is_saved_until_it_changes(hand, tmp_path, name):
    hand.drag("arm.x", 0.9)
    hand.step(2)
    save = save_pose if name.endswith(".json") else save_export
    save(hand.state, tmp_path / name)
    hand.finish_job()
    assert not hand.state.error and (tmp_path / name).exists() and texts_after_frames(hand) == []
    hand.drag("arm.x", 0.2)
    assert texts_after_frames(hand) == POSE
    undo(hand.state)
    assert texts_after_frames(hand) == []


def test_failed_save_leaves_the_pose_unsaved(hand, tmp_path):
    hand.drag("arm.x", 0.9)
    hand.step(2)
    save_pose(hand.state, tmp_path / "missing" / "a.json")
    assert hand.state.error and texts_after_frames(hand) == POSE


def test_pose_of_a_file_is_saved(drive_body, tmp_path):
    hand = drive_body()
    hand.enter_value("figure.scale", "2")
    assert len(texts_after_frames(hand)) == 1
    save_pose(hand.state, tmp_path / "a.json")
    reset_pose(hand.state)
    assert texts_after_frames(hand) == []
    hand.open(tmp_path / "a.json")
    assert not hand.state.error and hand.state.actor.pose.figure_scale == 2.0
    assert texts_after_frames(hand) == []


def test_texture_keeps_a_pose_unsaved(drive, tmp_path, rig):
    from dataclasses import replace

    import viewer

    scene = viewer.load(*rig)
    figure = scene.actors[0].figure
    uvs = np.zeros((figure.mesh.n_vertices, 2))
    scene.actors[0].figure = replace(figure, mesh=replace(figure.mesh, uvs=uvs))
    hand = drive(scene=scene)
    hand.drag("arm.x", 0.9)
    hand.step(2)
    old = hand.state.actor
    Image.new("RGB", (4, 4), (255, 0, 0)).save(tmp_path / "red.png")
    hand.open(tmp_path / "red.png")
    assert hand.state.actor is not old and len(texts_after_frames(hand)) == 1
    reset_pose(hand.state)
    assert texts_after_frames(hand) == []


def test_clip_overrides_a_pose_but_not_what_it_does_not_animate(curves):
    curves.state.clock.seek(0.5)
    assert texts_after_frames(curves) == []
    curves.drag("arm.x", 0.9)
    assert texts_after_frames(curves) == POSE
    curves.state.clock.seek(1.0)
    assert texts_after_frames(curves) == []
    scale_figure(curves)
    assert texts_after_frames(curves) == POSE
    curves.state.clock.seek(1.5)
    assert texts_after_frames(curves) == POSE


def test_exported_motion_contains_the_pose_under_it_but_not_one_made_over_it(curves, tmp_path):
    scale_figure(curves)
    curves.step(2)
    curves.drag("arm.x", 0.9)
    assert texts_after_frames(curves) == POSE
    save_motion(curves.state, tmp_path / "a.glb")
    curves.finish_job()
    assert not curves.state.error and texts_after_frames(curves) == POSE
    curves.state.clock.seek(1.5)
    assert texts_after_frames(curves) == []


def test_shape_by_hand_is_unsaved_until_it_is_reset(drive_body):
    hand = drive_body()
    hand.state.actor.pose.shape_weights[0] = 1.0
    assert len(texts_after_frames(hand)) == 1
    reset_pose(hand.state)  # keeps the shape
    assert len(texts_after_frames(hand)) == 1
    reset_shape(hand.state)
    assert texts_after_frames(hand) == []


def test_opening_quitting_and_saving_ask(hand, rig, tmp_path, texts):
    hand.drag("arm.x", 0.9)
    scene = hand.state.scene
    hand.open(*rig)
    assert hand.state.scene is scene and "Save changes before opening tiny.skin?" in texts
    hand.click("Cancel##closing")
    assert hand.state.scene is scene and texts_after_frames(hand) == POSE
    hand.key("q", "ctrl")
    hand.step(2)
    assert not hand.state.of(Closing).is_over
    hand.click("Save…")
    assert hand.state.of(Files).dialog.name == "tiny_pose.json"
    hand.step(2)
    hand.click("Save###Save")
    hand.step(3)
    assert hand.state.of(Closing).is_over and (tmp_path / "tiny_pose.json").exists()
