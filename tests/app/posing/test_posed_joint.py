"""A joint's position and axes in the scene, and its observed rotation axis."""

import numpy as np
import pytest
from app.posing_rigs import arm_figure
from numpy.testing import assert_allclose

from viewer.app.posing.posed_joint import posed_joint
from viewer.rig.geometry.rotation import rotation_vector_to_matrix
from viewer.rig.pose import joint_rotations, placement_matrix
from viewer.rig.scene import Actor


def turned_actor():
    """An arm with the shoulder rotated by 90 degrees about z and the elbow by -45 about its z."""
    actor = Actor(arm_figure())
    actor.pose.dofs[2], actor.pose.dofs[3] = np.pi / 2, -np.pi / 4
    return actor


def test_positions_and_axes_match_hand_calculation() -> None:
    actor = turned_actor()
    elbow = posed_joint(actor, 1)
    assert_allclose(elbow.center, [0, 1, 0], atol=1e-12)
    assert_allclose(elbow.axes("world"), np.eye(3))
    # The shoulder's x axis points up; the elbow's points 45 degrees to the right of that.
    assert_allclose(elbow.axes("parent")[:, 0], [0, 1, 0], atol=1e-12)
    assert_allclose(elbow.axes("local")[:, 0], np.array([1, 1, 0]) / np.sqrt(2), atol=1e-12)


def test_placement_and_scale_of_the_figure_are_applied() -> None:
    actor = turned_actor()
    actor.placement[:3, 3] = 1, 2, 3
    actor.pose.figure_scale = 2.0
    assert_allclose(posed_joint(actor, 1).center, [1, 4, 3], atol=1e-12)
    assert_allclose(posed_joint(actor, 1).axes("local")[:, 2], [0, 0, 1], atol=1e-12)


def test_missing_joint_returns_none() -> None:
    actor = turned_actor()
    assert posed_joint(actor, -1) is None and posed_joint(actor, 3) is None
    actor.pose = None
    assert posed_joint(actor, 0) is None


PLACEMENTS = {
    "turned": rotation_vector_to_matrix(np.array([0.3, -0.8, 0.5])),
    "mirrored": np.diag([-1.0, 1.0, 1.0]),
    "mirrored along two": np.diag([-1.0, 1.0, -2.0]),
    "point": -np.eye(3),
}


@pytest.mark.parametrize("name", PLACEMENTS)
@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0.6, 0, 0.8)])
def test_rotation_axis_matches_observed_rotation(name, axis) -> None:
    actor = Actor(arm_figure())
    actor.placement[:3, :3] = PLACEMENTS[name]
    joint = posed_joint(actor, 0)
    inside = rotation_vector_to_matrix(1e-6 * np.array(axis, float))
    seen = joint.rotation_axis(np.array(axis, float))
    # No point moves along the axis, and all move around it by the right-hand rule.
    for point in np.eye(3):
        step = PLACEMENTS[name] @ (inside - np.eye(3)) @ np.linalg.solve(PLACEMENTS[name], point)
        assert abs(step @ seen) < 1e-12
        assert np.cross(seen, point) @ step >= -1e-12
    if name != "mirrored along two":  # that placement stretches
        assert_allclose(joint.parent_axis(seen), axis, atol=1e-9)


def test_world_matrices_cover_every_joint() -> None:
    actor = turned_actor()
    joint = posed_joint(actor, 2)
    assert joint.world.shape == (3, 4, 4)
    assert_allclose(joint.placement, actor.placement @ placement_matrix(actor.pose))
    local = joint_rotations(joint.skeleton, actor.pose)
    assert_allclose(joint.world[2, :3, :3], local[0] @ local[1] @ local[2], atol=1e-12)
