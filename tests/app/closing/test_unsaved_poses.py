"""Poses made by hand count as unsaved edits until they are saved, undone, reset or overridden."""

import numpy as np
import pytest
from imgui_bundle import imgui
from PIL import Image

from viewer.app.closing import Closing, unsaved_edits
from viewer.app.core.undo_actions import redo, undo
from viewer.app.files.files import Files
from viewer.app.files.motion_export import save_motion
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

POSE = ["tiny: pose"]


def texts_of(hand):
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
    assert texts_of(hand) == []
    edit(hand)
    assert texts_of(hand) == POSE
    undo(hand.state)
    assert texts_of(hand) == []
    redo(hand.state)
    assert texts_of(hand) == POSE
    reset_pose(hand.state)
    assert texts_of(hand) == []


def test_last_joint_that_is_reset_makes_the_pose_saved(hand):
    hand.drag("arm.x", 0.9)
    hand.drag("root.tx", 0.9)
    hand.step(2)
    reset_joint(hand.state, 1)
    assert texts_of(hand) == POSE
    reset_joint(hand.state, 0)
    # The file's values violate the limits of the root, so the opened pose is restored by R.
    reset_pose(hand.state)
    assert texts_of(hand) == []


def test_copied_pose_is_not_an_edit(hand):
    copy_numbers(hand.state)
    hand.drag("arm.x", 0.9)
    paste_pose(hand.state)
    assert texts_of(hand) == []


@pytest.mark.parametrize("name", ["a.json", "a.obj"])
def test_saved_pose_is_saved_until_it_changes(hand, tmp_path, name):
    hand.drag("arm.x", 0.9)
    hand.step(2)
    save = save_pose if name.endswith(".json") else save_export
    save(hand.state, tmp_path / name)
    hand.finish_job()
    assert not hand.state.error and (tmp_path / name).exists() and texts_of(hand) == []
    hand.drag("arm.x", 0.2)
    assert texts_of(hand) == POSE
    undo(hand.state)
    assert texts_of(hand) == []


def test_failed_save_leaves_the_pose_unsaved(hand, tmp_path):
    hand.drag("arm.x", 0.9)
    hand.step(2)
    save_pose(hand.state, tmp_path / "missing" / "a.json")
    assert hand.state.error and texts_of(hand) == POSE


def test_pose_of_a_file_is_saved(drive_body, tmp_path):
    hand = drive_body()
    hand.enter_value("figure.scale", "2")
    assert len(texts_of(hand)) == 1
    save_pose(hand.state, tmp_path / "a.json")
    reset_pose(hand.state)
    assert texts_of(hand) == []
    hand.open(tmp_path / "a.json")
    assert not hand.state.error and hand.state.actor.pose.figure_scale == 2.0
    assert texts_of(hand) == []


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
    assert hand.state.actor is not old and len(texts_of(hand)) == 1
    reset_pose(hand.state)
    assert texts_of(hand) == []


def test_clip_overrides_a_pose_but_not_what_it_does_not_animate(curves):
    curves.state.clock.seek(0.5)
    assert texts_of(curves) == []
    curves.drag("arm.x", 0.9)
    assert texts_of(curves) == POSE
    curves.state.clock.seek(1.0)
    assert texts_of(curves) == []
    scale_figure(curves)
    assert texts_of(curves) == POSE
    curves.state.clock.seek(1.5)
    assert texts_of(curves) == POSE


def test_exported_motion_contains_the_pose_under_it_but_not_one_made_over_it(curves, tmp_path):
    scale_figure(curves)
    curves.step(2)
    curves.drag("arm.x", 0.9)
    assert texts_of(curves) == POSE
    save_motion(curves.state, tmp_path / "a.glb")
    curves.finish_job()
    assert not curves.state.error and texts_of(curves) == POSE
    curves.state.clock.seek(1.5)
    assert texts_of(curves) == []


def test_shape_by_hand_is_unsaved_until_it_is_reset(drive_body):
    hand = drive_body()
    hand.state.actor.pose.shape_weights[0] = 1.0
    assert len(texts_of(hand)) == 1
    reset_pose(hand.state)  # keeps the shape
    assert len(texts_of(hand)) == 1
    reset_shape(hand.state)
    assert texts_of(hand) == []


def test_opening_quitting_and_saving_ask(hand, rig, tmp_path, texts):
    hand.drag("arm.x", 0.9)
    scene = hand.state.scene
    hand.open(*rig)
    assert hand.state.scene is scene and "Save changes before opening tiny.skin?" in texts
    hand.click("Cancel##closing")
    assert hand.state.scene is scene and texts_of(hand) == POSE
    hand.key("q", "ctrl")
    hand.step(2)
    assert not hand.state.of(Closing).is_over
    hand.click("Save…")
    assert hand.state.of(Files).dialog.name == "tiny_pose.json"
    hand.step(2)
    hand.click("Save###Save")
    hand.step(3)
    assert hand.state.of(Closing).is_over and (tmp_path / "tiny_pose.json").exists()
