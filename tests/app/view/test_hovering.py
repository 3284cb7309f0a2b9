"""Outlines and names of objects that a click would select, and the pick distance of joints."""

import numpy as np
import pytest

from viewer.app.posing.gizmo import joint_places
from viewer.app.view.hovering import Hovered
from viewer.app.view.outlines import outlined_parts
from viewer.rendering.passes.outline_pass import Outlined


@pytest.fixture
def bones(drive, rig):
    """A test driver on the tiny figure with its skeleton."""
    hand = drive(*rig, pixels_per_point=1.0)
    hand.state.options.show = "both"
    hand.step(2)
    return hand


@pytest.fixture
def pair(drive, rig):
    """A test driver on two tiny figures side by side."""
    return drive(*rig, *rig, size=(1280, 800))


def keys(hand):
    return [part.key() for part in outlined_parts(hand.state)]


def beside(hand, joint, across=11.0):
    x, y = joint_places(hand.state)[joint]
    return float(x) + across, float(y)


def middle_of(hand, actor):
    hand.state.chosen_actor, kept = actor, hand.state.chosen_actor
    places = joint_places(hand.state)
    hand.state.chosen_actor = kept
    return tuple(float(side) for side in places[0])


def test_joint_near_the_pointer_is_outlined_and_selected_by_a_click(bones):
    bones.move(beside(bones, 1))
    bones.step(2)
    assert bones.state.of(Hovered).joint == 1
    assert keys(bones) == [Outlined(0, 1, is_hovered=True).key()]
    bones.click(beside(bones, 1))
    assert bones.state.selected_joint == 1
    assert keys(bones) == [Outlined(0, 1).key()]
    bones.move((1.0, 1.0))
    assert bones.state.of(Hovered).joint == -1


def test_hidden_joints_are_not_hovered(hand):
    hand.move(beside(hand, 1, 2.0))
    hand.step(10)
    assert hand.state.of(Hovered).joint == -1 and not keys(hand)


def test_outlines_are_drawn_in_the_window_but_not_in_pictures(bones):
    plain = bones.scene_picture()
    bones.menu("menu View", "Selection outlines")
    bones.state.selected_joint = 1
    bones.step(3)
    selected = bones.scene_picture()
    bones.menu("menu View", "Selection outlines")
    bones.step(2)
    rows, columns = (slice(round(a), round(b)) for a, b in zip((100, 260), (500, 600), strict=True))
    with_outline = bones.screen()[rows, columns]
    assert (bones.scene_picture() == selected).all() and (selected != plain).any()
    bones.menu("menu View", "Selection outlines")
    bones.move((1.0, 1.0))
    assert (bones.screen()[rows, columns] != with_outline).any()


def test_chosen_actor_among_several_is_outlined(pair):
    assert not keys(pair)
    pair.state.select_actor(1)
    pair.step()
    assert keys(pair) == [Outlined(1).key()]
    pair.key("escape")
    assert not keys(pair) and pair.state.chosen_actor == 1


def test_actor_under_a_resting_pointer_is_outlined(pair):
    pair.move(middle_of(pair, 1))
    pair.step(6)
    assert pair.state.of(Hovered).actor == 1
    assert keys(pair) == [Outlined(1, is_hovered=True).key()]


@pytest.mark.parametrize(("away", "orbits"), [(16.0, False), (60.0, True)])
def test_drag_next_to_a_ring_does_not_orbit(bones, away, orbits):
    bones.state.selected_joint = 1
    bones.key("e")
    bones.step(2)
    x, y = joint_places(bones.state)[1]
    # The outermost ring faces the eye.
    from viewer.app.posing.rotate_tool import RADIUS

    start = float(x) + 1.18 * RADIUS + away, float(y)
    before, dofs = bones.state.camera.azimuth, bones.dofs()
    bones.pull(start, (start[0] + 40.0, start[1] + 10.0))
    assert (bones.state.camera.azimuth != before) == orbits
    np.testing.assert_array_equal(bones.dofs(), dofs)
