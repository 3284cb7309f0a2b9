"""The toolbar: buttons, greyed reasons, shortcuts, clips, and poses between figures."""

import numpy as np
import pytest
from app.posing_rigs import SIZE, arm_figure, arm_scene, around, drag_along, joint_seen
from imgui_bundle import imgui
from numpy.testing import assert_allclose, assert_array_equal

from viewer.app.posing.posing import Posing
from viewer.app.posing.rotate_tool import RADIUS
from viewer.app.posing.toolbar import no_chain, no_keys, no_orientation, no_tool
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.pose import joint_rotations
from viewer.rigs.scene import Actor, Scene


def waving():
    """A clip that rotates the shoulder about z from 0 to 1 in two seconds."""
    linear = (("linear", "linear"),) * 2
    return Clip("wave", (Channel(2, np.array([0.0, 2.0]), np.array([0.0, 1.0]), linear),), 0.0, 2.0)


@pytest.fixture
def arm(drive):
    hand = drive(scene=arm_scene(), size=SIZE, samples=1)
    hand.key("f")
    return hand


@pytest.fixture
def moved(drive):
    """A test driver on an arm with a keyed clip, and with the tool Rotate at the shoulder."""
    scene = arm_scene()
    scene.actors[0].clip = waving()
    hand = drive(scene=scene, size=SIZE, samples=1)
    hand.key("f")
    hand.state.selected_joint = 0
    hand.key("e")
    return hand


def turn(hand, held=""):
    drag_along(hand, around(joint_seen(hand, 0), 1.2 * RADIUS, 0.3, 1.1), held)


def test_buttons_and_keys_activate_tools(arm):
    seen = []
    for name in ("Rotate", "Move", "Select"):
        arm.click(f"tool {name}")
        seen.append(arm.state.of(Posing).tool)
    for key in "edq":
        arm.key(key)
        seen.append(arm.state.of(Posing).tool)
    assert seen == ["rotate", "move", "select"] * 2


def test_buttons_of_posing_are_shown_only_with_a_posing_tool(arm):
    assert "tool Mirror" not in arm.state.item_rects
    arm.key("e")
    arm.step(2)
    assert {"tool Mirror", "tool Copy", "tool Paste", "tool Key"} <= set(arm.state.item_rects)
    assert "Chain" not in arm.state.item_rects
    arm.key("d")
    arm.step(2)
    assert "Chain" in arm.state.item_rects


def test_axes_are_chosen_by_key_and_list(arm):
    arm.key("e")
    seen = []
    for _ in range(3):
        arm.key("x")
        seen.append(arm.state.of(Posing).orientation)
    assert seen == ["parent", "world", "local"]
    arm.step(2)
    arm.pick("##axes", 2)
    assert arm.state.of(Posing).orientation == "world"


def test_chain_length_ranges_from_one_to_the_depth_of_the_joint(arm):
    arm.key("d")
    arm.state.selected_joint = 2
    arm.step(2)
    arm.pull(arm.place("Chain", 0.9), arm.place("Chain", 0.02))
    assert arm.state.of(Posing).chain_length == 1
    arm.pull(arm.place("Chain", 0.1), arm.place("Chain", 1.5))
    assert arm.state.of(Posing).chain_length == 2


def test_greyed_buttons_show_their_reason(arm):
    state = arm.state
    assert no_keys(state) == "there is no clip: create one with Edit > New clip"
    assert no_chain(state) == "chains apply only to the Move tool (D)"
    arm.key("d")
    assert no_chain(state) == "select a joint"
    state.selected_joint = 0
    assert no_chain(state) == "no joint above shoulder can rotate"
    state.selected_joint = 2
    assert no_chain(state) == ""
    assert no_orientation(state) == "this joint is dragged in the image plane"
    arm.key("e")
    assert no_orientation(state) == ""
    state.selected_joint = 1
    assert no_orientation(state) == "this joint rotates only about the axes of its DOFs"
    state.actor.visible = False
    assert no_tool(state) == "this actor is not shown"


def test_greyed_button_has_no_effect(arm):
    arm.key("e")
    arm.step(2)
    arm.click("tool Key")
    assert arm.state.actor.clip is None


def test_figure_without_joints_has_no_tools(drive, rig):
    hand = drive(rig[1], size=SIZE, samples=1)
    assert "##tools" not in hand.state.item_rects
    hand.key("e")
    assert hand.state.of(Posing).tool == "select"
    assert hand.says("Rotate: this figure has no joints to pose")


def test_small_views_hide_the_toolbar(drive):
    hand = drive(scene=arm_scene(), size=(400, 300), samples=1)
    assert "##tools" not in hand.state.item_rects
    hand.key("e")
    hand.step(3)
    hand.assert_sane()


def test_mirror_button_mirrors_the_pose_and_can_be_undone(drive_body):
    hand = drive_body(size=SIZE)
    hand.key("e")
    hand.step(2)
    hand.state.actor.pose.dofs[hand.dof_index("joint_1.x")] = 0.5
    hand.step(2)
    hand.click("tool Mirror")
    assert hand.dof("joint_2.x") == pytest.approx(0.5)
    hand.key("z", "ctrl")
    assert hand.dof("joint_1.x") == pytest.approx(0.5)


def test_edit_pauses_the_clip_with_a_note(moved):
    moved.state.clock.playing = True
    moved.step(3)
    time = moved.state.clock.time
    assert time > 0
    center = joint_seen(moved, 0)
    places = around(center, 1.2 * RADIUS, 0.3, 1.1)
    drag_along(moved, places)
    assert not moved.state.clock.playing
    assert moved.says("Paused: the clip overwrites this pose when the time changes; press Key")
    edited, stopped = moved.dofs(), moved.state.clock.time
    moved.step(3)
    assert_array_equal(moved.dofs(), edited)
    assert moved.state.clock.time == stopped


@pytest.mark.parametrize("shake", [0, 2])
def test_click_on_a_handle_does_not_pause(moved, shake):
    moved.state.clock.playing = True
    moved.step(3)
    x, y = around(joint_seen(moved, 0), 1.2 * RADIUS, 0.3, 1.1)[0]
    moved.move((x, y))
    moved.press()
    assert moved.state.of(Posing).drag is not None
    time = moved.state.clock.time
    moved.move((x + shake, y))
    moved.step(3)
    # Time does not advance while the handle is held.
    assert moved.state.clock.playing and moved.state.clock.time == time
    moved.let_go()
    moved.step(3)
    assert moved.state.clock.playing and moved.state.clock.time > time
    assert not moved.says("Paused") and moved.undo_steps == 0


def test_key_button_adds_the_pose_to_the_clip_and_can_be_undone(moved):
    moved.state.clock.seek(1.0)
    moved.step(2)
    turn(moved, held="ctrl")
    edited, old = moved.dofs(), moved.state.actor.clip
    moved.click("tool Key")
    moved.step(2)
    assert moved.state.actor.clip is not old
    for time in (0.0, 1.0):
        moved.state.clock.seek(time)
        moved.step(2)
    assert_allclose(moved.dofs(), edited, atol=1e-9)
    moved.key("z", "ctrl")
    assert moved.state.actor.clip is old
    moved.key("z", "ctrl")
    assert moved.dofs()[2] == pytest.approx(0.5)  # halfway through the clip


def test_slider_drag_pauses_the_clip(moved):
    moved.state.clock.playing = True
    moved.step(2)
    x, y = moved.place("shoulder.x")
    moved.pull((x, y), (x + 30, y))
    assert not moved.state.clock.playing and moved.says("Paused: the clip")


@pytest.fixture
def two(drive):
    """A driver showing two arms with differently ordered DOFs; the second has no joint "hand"."""
    first = arm_figure(orders=("xyz", "xyz", "xyz"), name="first")
    second = arm_figure(orders=("zyx", "yxz", ""), name="second")
    object.__setattr__(second.skeleton, "names", ("shoulder", "elbow", "claw"))
    hand = drive(scene=Scene([Actor(first), Actor(second)]), size=SIZE, samples=1)
    hand.state.actor.pose.dofs[:] = 0.4, -0.3, 0.7, 0.2, 0.9, -0.5, 0, 0, 0
    hand.key("e")
    hand.step(2)
    return hand


def rotations(hand):
    actor = hand.state.actor
    return joint_rotations(actor.figure.skeleton, actor.pose)


def test_pose_is_pasted_as_rotations_if_dofs_differ(two):
    wanted = rotations(two)
    two.click("tool Copy")
    two.state.choose_actor(1)
    two.step(2)
    steps = two.undo_steps
    two.click("tool Paste")
    assert_allclose(rotations(two)[:2], wanted[:2], atol=1e-12)
    assert two.says("second has no joint named hand") and two.says("Pose pasted")
    assert not two.state.error and two.undo_steps == steps + 1
    two.key("z", "ctrl")
    assert not two.dofs().any()


def test_pasted_text_from_other_programs_is_matched_by_labels(two):
    two.key("c", "ctrl")
    imgui.set_clipboard_text('{"dofs": {"elbow.z": 0.25}}')
    two.state.choose_actor(1)
    two.key("v", "ctrl")
    assert two.dof("elbow.z") == 0.25


def test_pose_without_a_common_joint_is_refused(drive):
    first, second = arm_figure(name="first"), arm_figure(orders=("x", "y", "z"), name="second")
    object.__setattr__(second.skeleton, "names", ("a", "b", "c"))
    hand = drive(scene=Scene([Actor(first), Actor(second)]), size=SIZE, samples=1)
    hand.key("c", "ctrl")
    hand.state.choose_actor(1)
    hand.key("v", "ctrl")
    assert hand.state.error == "clipboard: first and second have no joint names in common"
