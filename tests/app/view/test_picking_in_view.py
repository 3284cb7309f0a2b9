"""Clicks in the view: activating actors, selecting joints, aiming the camera."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.rig.scene import actor_points


@pytest.fixture
def pair(drive, rig, tmp_path):
    """A test driver on two tiny figures side by side."""
    hand = drive(*rig, *rig, size=(1280, 800), samples=1)
    hand.step(3)
    return hand


def seen_at(hand, point):
    """The window coordinates of a point, by the camera's matrices."""
    camera = hand.state.camera
    x, y, width, height = hand.state.view_rect
    matrix = camera.projection_matrix(width / height, hand.state.box) @ camera.view_matrix()
    clip = matrix @ np.append(point, 1.0)
    across, upward = clip[:2] / clip[3]
    return x + width * (across + 1) / 2, y + height * (1 - upward) / 2


def middle_of(hand, index):
    points = actor_points(hand.state.scene.actors[index])
    return (points.min(axis=0) + points.max(axis=0)) / 2


def click(hand, place, times=1):
    io_place = (float(place[0]), float(place[1]))
    for _ in range(times):
        hand.pull(io_place, io_place)
    hand.step(2)


def test_click_activates_the_actor_under_it(pair):
    assert pair.state.chosen_actor == 0
    click(pair, seen_at(pair, middle_of(pair, 1)))
    assert pair.state.chosen_actor == 1
    click(pair, seen_at(pair, middle_of(pair, 0)))
    assert pair.state.chosen_actor == 0


def test_click_on_the_background_has_no_effect(pair):
    pair.state.choose_actor(1)
    x, y, width, _ = pair.state.view_rect
    click(pair, (x + width - 5, y + 5))
    assert pair.state.chosen_actor == 1 and pair.undo_steps == 0


def test_click_on_a_joint_selects_it(pair):
    pair.state.options.show = "skeleton"
    pair.step(2)
    from viewer.rig.geometry.transform import apply_transform
    from viewer.rig.skinning import joint_matrices

    actor = pair.state.scene.actors[1]
    joints = joint_matrices(actor.figure, actor.pose)[:, :3, 3]
    chosen = actor.figure.skeleton.n_joints - 1
    boxes = actor.figure.skeleton.boxes
    inside = boxes[chosen].mean(axis=0) if boxes is not None else np.zeros(3)
    world = joint_matrices(actor.figure, actor.pose)[chosen]
    place = apply_transform(actor.placement, apply_transform(world, inside[None]))[0]
    assert len(joints) > chosen
    click(pair, seen_at(pair, place))
    assert (pair.state.chosen_actor, pair.state.selected_joint) == (1, chosen)


def test_drag_orbits_and_selects_nothing(pair):
    azimuth = pair.state.camera.azimuth
    x, y = seen_at(pair, middle_of(pair, 1))
    pair.pull((x, y), (x + 60, y))
    pair.step(1)
    assert pair.state.camera.azimuth != azimuth
    assert pair.state.chosen_actor == 0


def test_double_click_aims_the_camera_at_the_surface(pair):
    distance = pair.state.camera.distance
    place = seen_at(pair, middle_of(pair, 1))
    click(pair, place, times=2)
    x, y, width, height = pair.state.view_rect
    # The clicked point is now in the middle of the view, at the distance of the previous target.
    points = actor_points(pair.state.scene.actors[1])
    size = np.ptp(points, axis=0).max()
    assert pair.state.camera.distance == distance
    assert np.linalg.norm(pair.state.camera.target - middle_of(pair, 1)) < size
    assert_allclose(
        seen_at(pair, pair.state.camera.target), (x + width / 2, y + height / 2), atol=1e-6
    )
