"""Undo and redo of key edits restore time, curve and pose together."""

import math

import numpy as np
import pytest
from app.captured import dots, people
from app.curves.plotted import ARM_X, SIZE, _at, _center, clip_text
from numpy.testing import assert_allclose

import viewer
from viewer.app.actors.following import toggle_following
from viewer.app.core.undo_actions import undo
from viewer.app.curves.editing import (
    Curves,
    add_key_at,
    change_tangent,
    delete_chosen,
    extrapolate,
    key_present_pose,
    new_clip,
    place_key,
    set_playback_range,
)
from viewer.app.playback.timeline_panel import set_rate
from viewer.rendering.framing import followed_point
from viewer.rigs.motion.clip import evaluate
from viewer.rigs.scene import Actor, Scene

KEY = (ARM_X, 1)  # at 1 s: 0.6


def go(hand, time):
    hand.state.clock.seek(time)
    hand.step(2)


def assert_follows_its_clip(hand, time):
    """Check that the clock shows a time and the figure has the clip's pose at it."""
    actor = hand.state.actor
    assert hand.state.clock.time == time and hand.state.scene.time == time
    wanted = [float(evaluate(channel, np.array(time))) for channel in actor.clip.channels]
    assert_allclose(actor.pose.dofs, wanted, atol=1e-12)


EDITS = {
    "value": lambda state: place_key(state, KEY, value=-0.5),
    "time": lambda state: place_key(state, KEY, time=1.6),
    "tangent": lambda state: change_tangent(state, [KEY], 0, 3.0),
    "interpolation": lambda state: change_tangent(state, [KEY], 0, "linear"),
    "added key": lambda state: (
        add_key_at(state, [ARM_X + 1], 0.25),
        place_key(state, (ARM_X + 1, 1), value=0.4),
    ),
    "deleted key": lambda state: delete_chosen(state),
    "extrapolation": lambda state: extrapolate(state, 0, "linear"),
}


@pytest.mark.parametrize("held", [False, True])
def test_undoing_a_key_edit_shows_the_restored_clip(curves, held, monkeypatch):
    state = curves.state
    old = state.actor.clip
    state.clock.mode = "run on"
    for name, edit in EDITS.items():
        state.of(Curves).keys = frozenset({KEY})
        # Extrapolation is visible only outside the keys.
        time = -0.25 if name == "extrapolation" else 0.75
        go(curves, time)
        before = curves.dofs()
        with monkeypatch.context() as patch:
            if held:
                patch.setattr("viewer.app.frame.is_held", lambda state: True)
            edit(state)
            curves.step(2)
        curves.step(2)
        assert curves.undo_steps == 1 and state.actor.clip is not old, name
        after = curves.dofs()
        assert np.abs(after - before).max() > 1e-3, name
        curves.key("z", "ctrl")
        assert state.actor.clip is old, name
        assert_follows_its_clip(curves, time)
        assert_allclose(curves.dofs(), before, atol=1e-12)
        curves.key("y", "ctrl")
        assert_follows_its_clip(curves, time)
        assert_allclose(curves.dofs(), after, atol=1e-12)
        curves.key("z", "ctrl")


def test_undoing_a_dragged_key_shows_the_restored_clip(curves):
    go(curves, 1.0)
    x, y = _center(curves, "key arm.x 1")
    curves.pull((x, y), _at(curves, 1.2, 10.0))
    curves.step(2)
    assert curves.dof("arm.x") != pytest.approx(0.6)
    curves.key("z", "ctrl")
    assert_follows_its_clip(curves, 1.0)
    assert curves.dof("arm.x") == pytest.approx(0.6)


def test_undo_and_redo_jump_to_the_time_of_the_edit(curves):
    go(curves, 0.75)
    EDITS["value"](curves.state)
    curves.step(2)
    go(curves, 1.5)
    curves.key("z", "ctrl")
    assert_follows_its_clip(curves, 0.75)
    go(curves, 2.0)
    curves.key("y", "ctrl")
    assert_follows_its_clip(curves, 0.75)


def test_undoing_other_edits_keeps_the_time(curves):
    go(curves, 0.75)
    curves.key("w")
    go(curves, 1.5)
    curves.key("z", "ctrl")
    assert not curves.state.options.wireframe
    assert_follows_its_clip(curves, 1.5)


def test_undo_while_playing_continues_with_the_restored_clip(curves):
    state = curves.state
    old = state.actor.clip
    go(curves, 0.5)
    curves.key("space")
    EDITS["value"](state)
    curves.step(10)
    assert curves.undo_steps == 1
    curves.key("z", "ctrl")
    curves.step(2)
    assert state.clock.playing and state.actor.clip is old
    assert_follows_its_clip(curves, state.clock.time)


def test_manual_pose_is_restored_when_its_key_is_undone(curves):
    state, row = curves.state, ARM_X + 1
    go(curves, 0.75)
    state.actor.pose.dofs[row] = 0.3
    curves.step(2)
    key_present_pose(state)
    curves.step(2)
    assert curves.undo_steps == 2 and curves.dofs()[row] == 0.3
    go(curves, 1.75)
    curves.key("z", "ctrl")
    assert state.clock.time == 0.75 and curves.dofs()[row] == 0.3  # the manual pose, not the clip's
    curves.key("z", "ctrl")
    assert_follows_its_clip(curves, 0.75)
    curves.key("y", "ctrl")
    assert curves.dofs()[row] == 0.3
    curves.key("y", "ctrl")
    assert_follows_its_clip(curves, 0.75)
    assert curves.dofs()[row] == 0.3


def test_undo_of_a_new_clip_and_of_keys_in_it(drive, rig):
    hand = drive(*rig, size=SIZE, samples=1)
    state, before = hand.state, hand.dofs()
    new_clip(state)
    hand.step(2)
    go(hand, 1.5)
    state.actor.pose.dofs[ARM_X] = 0.5
    hand.step(2)
    key_present_pose(state, only_changed=True)
    hand.step(2)
    go(hand, 2.0)
    for _ in range(2):
        hand.key("z", "ctrl")
    assert_follows_its_clip(hand, 1.5)
    hand.key("z", "ctrl")
    assert state.actor.clip is None and state.clock.time == 0.0
    assert_allclose(hand.dofs(), before)


def test_undo_of_a_shorter_range_restores_the_time(curves):
    go(curves, 1.75)
    set_playback_range(curves.state, 0.0, 1.0)
    curves.step(3)
    assert curves.state.clock.time <= 1.75
    curves.key("z", "ctrl")
    assert_follows_its_clip(curves, 1.75)


def test_undo_of_a_rate_change_shows_the_same_frame(drive, rig):
    hand = drive(scene=people(rig, [True] * 11), size=SIZE, samples=1)
    go(hand, 0.5)
    before = hand.state.actor.pose.figure_translation.copy()
    set_rate(hand.state, 20.0)
    hand.step(2)
    assert hand.state.clock.time == pytest.approx(0.25)
    go(hand, 0.4)
    hand.key("z", "ctrl")
    assert hand.state.clock.time == pytest.approx(0.5)
    assert_allclose(hand.state.actor.pose.figure_translation, before)


def test_undo_of_a_moved_actor_shows_its_clip_at_its_old_offset(curves):
    go(curves, 0.75)
    curves.state.actor.offset = 0.5
    curves.step(2)
    go(curves, 2.25)
    curves.key("z", "ctrl")
    assert curves.state.actor.offset == 0.0
    assert_follows_its_clip(curves, 0.75)


def test_undo_restores_captured_points_with_the_time(drive):
    hand = drive(scene=Scene([dots([0.5, 0.25, 1, 1])]), size=SIZE, samples=1)
    state = hand.state
    go(hand, state.clock.frame_time(1))
    before = state.actor.points.copy()
    state.actor.offset = 1.0
    hand.step(2)
    go(hand, state.clock.end)
    hand.key("z", "ctrl")
    assert state.clock.frame == 1
    assert_allclose(state.actor.points, before)


def test_undo_restores_absence_with_the_time(drive, rig):
    """The clock sets absence; undoing an edit may jump to a time with absent people."""
    hand = drive(scene=people(rig, [True, True, False, False, True]), size=SIZE, samples=1)
    state = hand.state
    go(hand, 0.2)
    assert not state.actor.is_present
    state.actor.pose.shape_weights = state.actor.pose.shape_weights + 1.0
    state.actor.pose.dofs[ARM_X] += 0.1
    hand.step(2)
    go(hand, 0.0)
    assert state.actor.is_present
    hand.key("z", "ctrl")
    assert state.clock.time == pytest.approx(0.2) and not state.actor.is_present


@pytest.mark.parametrize("held", [False, True])
def test_edits_while_another_actor_plays_are_undo_steps(curves, held, monkeypatch):
    state = curves.state
    still = Actor(state.actor.figure)
    state.scene.actors.append(still)
    curves.step(2)
    start = still.pose.dofs.copy()
    curves.key("space")
    curves.step(3)
    steps = curves.undo_steps
    if held:
        monkeypatch.setattr("viewer.app.frame.is_held", lambda state: True)
    still.pose.dofs[ARM_X] = 0.4
    curves.step(3)
    monkeypatch.undo()
    curves.step(3)
    assert curves.undo_steps == steps + 1
    curves.key("z", "ctrl")
    curves.step(2)
    assert_allclose(still.pose.dofs, start)
    assert_follows_its_clip(curves, state.clock.time)
    curves.key("y", "ctrl")
    assert still.pose.dofs[ARM_X] == 0.4


def test_drag_back_to_the_start_is_not_an_undo_step(curves, monkeypatch):
    pose = curves.state.actor.pose
    monkeypatch.setattr("viewer.app.frame.is_held", lambda state: True)
    start = pose.dofs[ARM_X]
    for value in (0.4, start):
        pose.dofs[ARM_X] = value
        curves.step(1)
    monkeypatch.undo()
    curves.step(2)
    assert curves.undo_steps == 0


def test_undo_twice_before_the_next_frame(curves):
    state = curves.state
    go(curves, 0.75)
    before = curves.dofs()
    for value in (-0.3, 0.9):
        place_key(state, KEY, value=value)
        curves.step(2)
    go(curves, 1.5)
    undo(state)
    undo(state)
    assert_follows_its_clip(curves, 0.75)  # without a frame in between
    curves.step(1)
    assert_follows_its_clip(curves, 0.75)
    assert_allclose(curves.dofs(), before, atol=1e-12)
    assert not state.history.undone_next and math.isclose(state.scene.time, 0.75)


def test_clip_files_are_loaded_into_the_undoable_state(drive, rig, tmp_path):
    """Poses loaded together with a clip are not a separate undo step."""
    (tmp_path / "wave.anim").write_text(clip_text())
    hand = drive(scene=viewer.load(*rig, tmp_path / "wave.anim"), size=SIZE, samples=1)
    hand.step(3)
    assert hand.undo_steps == 0


def test_following_camera_moves_with_undo(curves):
    state = curves.state
    go(curves, 0.75)
    toggle_following(state, 0, 1)
    curves.step(1)
    place, target = followed_point(state.actor, 1), state.camera.target.copy()
    place_key(state, (0, 1), value=3.0)  # the root slides farther
    curves.step(2)
    moved = followed_point(state.actor, 1) - place
    assert np.abs(moved).max() > 1e-3
    assert_allclose(state.camera.target, target + moved, atol=1e-12)
    curves.key("z", "ctrl")
    assert_allclose(followed_point(state.actor, 1), place, atol=1e-12)
    assert_allclose(state.camera.target, target, atol=1e-12)


def test_following_camera_does_not_move_while_a_pose_is_edited(curves):
    state = curves.state
    toggle_following(state, 0, 1)
    curves.step(1)
    target = state.camera.target.copy()
    state.actor.pose.dofs[0] += 0.5
    curves.step(2)
    assert_allclose(state.camera.target, target)
