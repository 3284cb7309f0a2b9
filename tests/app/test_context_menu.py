"""Context menus: entries for what was clicked, each of which can be undone."""

import pytest

from viewer.app.context_menu import ContextMenu
from viewer.app.posing.gizmo import joint_places
from viewer.app.weights.weights_panel import Weights


@pytest.fixture
def bones(drive, rig):
    """A test driver on the tiny figure with its skeleton."""
    hand = drive(*rig)
    hand.state.options.show = "both"
    hand.step(2)
    return hand


def joint(hand, index):
    return tuple(float(side) for side in joint_places(hand.state)[index])


def right_click(hand, place):
    hand.click(place, button=1)
    hand.step(3)


def test_menu_of_a_joint_resets_it_as_one_step(bones):
    bones.state.actor.pose.dofs[bones.dof_index("arm.x")] = 0.4
    bones.step(2)
    right_click(bones, joint(bones, 1))
    assert bones.state.of(ContextMenu).spot.joint == 1
    steps = bones.undo_steps
    bones.click("Reset joint")
    assert bones.dof("arm.x") == 0.2 and bones.undo_steps == steps + 1
    bones.key("z", "ctrl")
    assert bones.dof("arm.x") == 0.4


def test_menu_of_the_skin_explains_its_vertex_and_selects_its_joint(hand):
    right_click(hand, joint(hand, 0))
    spot = hand.state.of(ContextMenu).spot
    assert spot.vertex >= 0 and spot.joint >= 0
    hand.click("Select joint")
    assert hand.state.selected_joint == spot.joint
    right_click(hand, joint(hand, 0))
    hand.click("Explain vertex")
    assert hand.state.of(Weights).pinned.vertex == spot.vertex


def test_hidden_actor_is_shown_again_by_the_menu_of_the_background(hand):
    right_click(hand, joint(hand, 0))
    hand.click("Hide actor")
    assert not hand.state.actor.visible
    x, y, _, _ = hand.state.view_rect
    right_click(hand, (x + 30.0, y + 60.0))
    assert hand.state.of(ContextMenu).spot is None
    hand.click("Show all actors")
    assert hand.state.actor.visible
    hand.key("z", "ctrl")
    assert not hand.state.actor.visible


def test_right_drag_pans_and_opens_no_menu(hand):
    x, y = hand.middle
    before = hand.state.camera.target.copy()
    hand.pull((x, y), (x + 40.0, y), button=1)
    hand.step(3)
    assert (hand.state.camera.target != before).any()
    assert "Find an action…" not in hand.state.item_rects


def test_escape_closes_only_the_menu(bones):
    bones.state.selected_joint = 0
    right_click(bones, joint(bones, 1))
    bones.key("escape")
    bones.step(2)
    assert "Reset joint" not in bones.state.item_rects and bones.state.selected_joint == 0
