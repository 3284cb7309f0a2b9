"""The Joint match panel: edits are retargeted immediately, undone, saved and loaded."""

import threading
from dataclasses import replace

import numpy as np
import pytest
from app.retargeting.driven import driven_scene
from app.tiny import write_rig
from imgui_bundle import imgui

from viewer.app.core.reasons import no_panel
from viewer.app.core.undo_actions import redo, undo
from viewer.app.files.files import Files
from viewer.app.retargeting import drive_changes
from viewer.app.retargeting.drive_changes import no_edit
from viewer.app.retargeting.joint_match_panel import (
    JointMatch,
    ask_for_map,
    ask_where_to_save,
    is_automatic,
    match_automatically,
    match_joint,
    shown_match,
)
from viewer.formats import Source
from viewer.formats._joint_map import read_joint_map
from viewer.rigs.retargeting.driven_clip import driven_clip

SIZE = (1000, 900)


@pytest.fixture
def panel(drive):
    hand = drive(scene=driven_scene(), size=SIZE)
    hand.show_panel("Joint match")
    hand.step(3)
    return hand


def partner(hand, label):
    """Return the label of the joint that drives a joint, and how it was matched."""
    shown = shown_match(hand.state)
    joint = shown.target.labels.index(label)
    found = int(shown.partners[joint])
    return shown.source.labels[found] if found >= 0 else "", shown.origins[joint]


def test_chosen_joint_drives_the_figure_immediately_and_can_be_undone(panel):
    hand, actor = panel, panel.state.actor
    elbow = actor.figure.skeleton.names.index("right_elbow")
    hand.state.clock.seek(0.1)
    hand.step(2)
    before, pose = actor.clip, actor.pose.rotations.copy()
    assert partner(hand, "right_elbow") == ("", "")
    assert no_edit(hand.state) == no_panel(hand.state, "drive") == ""
    assert is_automatic(hand.state) == "the match is automatic"
    hand.state.of(Files).stream = object()
    assert no_edit(hand.state) == "wait until the capture has been read"
    hand.state.of(Files).stream = None
    hand.click("Only unmatched")
    hand.click("source of right_elbow")
    hand.step(2)
    hand.type("ellb")
    hand.step(2)
    hand.click("source rEllbogen_x")
    hand.step(3)
    assert partner(hand, "right_elbow") == ("rEllbogen_x", "map")
    assert partner(hand, "left_elbow") == ("LeftForeArm", "name")
    assert hand.says("right_elbow follows rEllbogen_x")
    wanted, _ = driven_clip(actor.drive, actor.figure)
    assert np.array_equal(actor.clip.rotations, wanted.rotations)
    hand.key("z", "ctrl")
    hand.step(3)
    assert actor.clip is before and actor.drive.joint_map is None
    np.testing.assert_array_equal(actor.pose.rotations, pose)
    hand.key("y", "ctrl")
    hand.step(3)
    assert partner(hand, "right_elbow") == ("rEllbogen_x", "map")
    hand.click("Automatic")
    hand.step(2)
    assert partner(hand, "right_elbow") == ("", "") and is_automatic(hand.state)
    assert not np.allclose(wanted.rotations[:, elbow], actor.clip.rotations[:, elbow])


def test_one_joint_may_drive_two_joints_and_a_joint_may_stay_at_rest(panel):
    state = panel.state
    shown = shown_match(state)
    joint, arm = (shown.target.labels.index(name) for name in ("right_elbow", "left_elbow"))
    match_joint(state, joint, int(shown.partners[arm]))
    assert partner(panel, "right_elbow")[0] == partner(panel, "left_elbow")[0] == "LeftForeArm"
    match_joint(state, arm, -1)
    assert partner(panel, "left_elbow") == ("", "map")
    clip = state.actor.clip
    np.testing.assert_allclose(clip.rotations[:, arm], [[0, 0, 0, 1]] * 5, atol=1e-12)


def test_hovering_highlights_the_pair_in_table_and_drawing(panel):
    view = panel.state.of(JointMatch)
    shown = shown_match(panel.state)
    knee, leg = shown.target.labels.index("left_knee"), shown.source.labels.index("LeftLeg")
    panel.move("joint left_knee")
    panel.step(2)
    assert view.hovered == ({knee}, {leg})
    # The wrists, 0.84 apart, are 1.5 font sizes from the edges; the head is 1.44 above the ankles.
    x0, y0, x1, y1 = panel.state.item_rects["preview"]
    letter, half = imgui.get_font_size(), 0.5 * (x1 - x0)
    scale = (half - 3.0 * letter) / 0.84
    head = shown.target.labels.index("head")
    panel.move((x0 + 0.5 * half, 0.5 * (y0 + y1) + 0.6 * letter - 0.5 * 1.44 * scale))
    panel.step()
    assert view.hovered == ({head}, {shown.source.labels.index("Head")})
    panel.press()
    panel.let_go()
    assert panel.state.selected_joint == head


def test_rows_show_a_change_while_its_motion_is_computed(panel, monkeypatch):
    state, go = panel.state, threading.Event()
    monkeypatch.setattr(drive_changes, "_SHORT", 0)
    compute = drive_changes.driven_clip
    monkeypatch.setattr(
        drive_changes, "driven_clip", lambda *given: (go.wait(30.0), compute(*given))[1]
    )
    shown = shown_match(state)
    elbow, source = shown.target.labels.index("right_elbow"), shown.source.labels
    match_joint(state, elbow, source.index("rEllbogen_x"))
    assert partner(panel, "right_elbow") == ("rEllbogen_x", "map")
    undo(state)  # cancels the change
    assert partner(panel, "right_elbow") == ("", "")
    go.set()
    panel.finish_job()
    assert partner(panel, "right_elbow") == ("", "")
    match_joint(state, elbow, source.index("rEllbogen_x"))
    panel.finish_job()
    assert partner(panel, "right_elbow") == ("rEllbogen_x", "map")


def test_saved_maps_can_be_loaded(panel, tmp_path):
    state = panel.state
    shown = shown_match(state)
    own = state.actor.clip
    match_joint(
        state, shown.target.labels.index("right_elbow"), shown.source.labels.index("rEllbogen_x")
    )
    edited = state.actor.clip
    path = tmp_path / "map.txt"
    ask_where_to_save(state)
    state.of(Files).dialog.done(state, [path])
    assert ("right_elbow", "rEllbogen_x") in read_joint_map(Source.open(path)).pairs
    match_automatically(state)
    assert np.array_equal(state.actor.clip.rotations, own.rotations)
    ask_for_map(state)
    panel.step(2)
    assert "Cancel" in state.item_rects and "several files" not in state.item_rects
    dialog = state.of(Files).dialog
    assert dialog.is_single  # the command line takes one map, too
    dialog.done(state, [path])
    assert np.array_equal(state.actor.clip.rotations, edited.rotations)
    assert panel.says("Joints matched by")
    undo(state)
    assert panel.says("Undone") and not panel.says("Joints matched by")
    redo(state)
    path.write_text("right_elbow = rEllbogn_x\n")
    kept = state.actor.clip
    dialog.done(state, [path])
    assert "map.txt:1: " in state.error and "did you mean rEllbogen_x?" in state.error
    assert state.actor.clip is kept


def test_figures_without_a_driving_motion_have_no_panel(hand):
    assert no_edit(hand.state) == "no motion of another skeleton drives this figure"
    assert "Joint match" not in hand.state.item_rects


def test_a_motion_that_matches_nothing_is_matched_in_the_panel(drive, tmp_path):
    """This is when the panel is needed: the figure stood still beside the motion without one."""
    joints = "a", "b", "c", "d"
    head = "".join(f"{'JOINT' if i else 'ROOT'} {name} {{ OFFSET 0 {10 * i} 0 "
                   f"CHANNELS {3 if i else 6} {'' if i else 'Xposition Yposition Zposition '}"
                   "Zrotation Xrotation Yrotation " for i, name in enumerate(joints))  # fmt: skip
    path = tmp_path / "walk.bvh"
    path.write_text(f"HIERARCHY {head} {'}' * 4} MOTION Frames: 2 Frame Time: 0.1\n"
                    f"{'0 ' * 15}\n{'0 ' * 6}{'90 0 0 ' * 3}\n")  # fmt: skip
    hand = drive(*write_rig(tmp_path), path)
    state = hand.state
    assert [actor.clip is None for actor in state.scene.actors] == [True, False]
    assert no_panel(state, "drive") == no_edit(state) == ""
    hand.show_panel("Joint match")
    hand.step(3)
    shown = shown_match(state)
    assert set(shown.partners.tolist()) == {-1} and shown.source.labels == joints
    match_joint(state, 1, 2)
    hand.step(2)
    actor = state.actor
    assert actor.clip is not None and partner(hand, shown.target.labels[1])[0] == "c"
    # The joint has the world rotation of c in the last frame: 180 degrees about z.
    assert abs(actor.clip.rotations[1, 1]) == pytest.approx([0, 0, 1, 0], abs=1e-9)
    match_joint(state, 1, -1)
    assert "Joint match panel" in state.error


def test_undo_of_other_edits_keeps_frames_loaded_since(panel):
    state, actor = panel.state, panel.state.actor
    drive = replace(actor.drive)
    actor.color = (1.0, 0.0, 0.0)
    panel.step(2)
    # As if another part of a capture had been loaded.
    actor.clip, actor.drive = replace(actor.clip), drive
    state.history.add_actors(state.update_version())
    panel.key("z", "ctrl")
    panel.step(2)
    assert actor.color is None and actor.drive is drive and shown_match(state).drive is drive
