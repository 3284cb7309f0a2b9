"""Pose vectors of models, as rotation vectors or z-y-x angles, converted to a pose and back."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rig.hand_made import skeleton, turn_x, turn_y, turn_z

from viewer.errors import RigError
from viewer.rig.figure import Figure
from viewer.rig.motion.evaluation import pose_actors
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing
from viewer.rig.pose import joint_rotations, rest_pose
from viewer.rig.posing.pose_vector import (
    PoseLayout,
    own_numbers,
    read_vector,
    rotation_rows,
    set_joint_rotations,
    write_vector,
)
from viewer.rig.scene import Actor
from viewer.rig.skeleton import ball_skeleton

BALLS = ball_skeleton(tuple("abcd"), np.array([-1, 0, 1, 1]), np.eye(4, 3))
SMPL = PoseLayout(12, 3 * np.arange(4), np.zeros(4, bool))
# The layout of PIG: translation, root angles about z, y, x, rotation vectors of the other joints,
# scale.
PIG = PoseLayout(16, 3 + 3 * np.arange(4), np.arange(4) == 0, translation=0, scale=15)


def about(vector):
    """Return the rotation about an axis by the series of the matrix exponential."""
    x, y, z = np.asarray(vector) / 64.0
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    term, total = np.eye(3), np.eye(3)
    for power in range(1, 15):
        term = term @ cross / power
        total = total + term
    return np.linalg.matrix_power(total, 64)


def posed(layout, vector, bones=BALLS):
    pose = rest_pose(bones)
    read_vector(layout, bones, pose, np.asarray(vector, dtype=float))
    return pose


def test_smpl_numbers_are_rotation_vectors():
    vector = np.random.default_rng(0).uniform(-1.5, 1.5, 12)
    found = joint_rotations(BALLS, posed(SMPL, vector))
    assert_allclose(found, [about(row) for row in vector.reshape(4, 3)], atol=1e-13)


def test_pig_root_is_rotated_about_x_then_y_then_z():
    vector = np.arange(16) / 10.0
    pose = posed(PIG, vector)
    found = joint_rotations(BALLS, pose)
    # The first value rotates about z: R = Rz(0.3) Ry(0.4) Rx(0.5).
    assert_allclose(found[0], turn_z(0.3) @ turn_y(0.4) @ turn_x(0.5), atol=1e-15)
    for joint in (1, 2, 3):
        assert_allclose(found[joint], about(vector[3 + 3 * joint : 6 + 3 * joint]), atol=1e-13)
    assert pose.figure_translation.tolist() == [0.0, 0.1, 0.2]
    assert pose.figure_scale == 1.5


@pytest.mark.parametrize("layout", [SMPL, PIG], ids=["smpl", "pig"])
def test_pose_values_round_trip(layout):
    rng = np.random.default_rng(1)
    for _ in range(20):
        vector = rng.uniform(-1.5, 1.5, layout.n_numbers)
        found = write_vector(layout, BALLS, posed(layout, vector))
        assert_allclose(found, vector, atol=1e-12)


def test_long_vectors_round_trip_as_the_same_rotation():
    vector = np.zeros(12)
    vector[3:6] = 0.0, 5.0, 0.0
    assert_allclose(write_vector(SMPL, BALLS, posed(SMPL, vector))[4], 5.0 - 2.0 * np.pi)


def test_pig_root_at_a_right_angle_about_y_keeps_its_rotation():
    vector = np.zeros(16)
    vector[3:6] = 0.7, np.pi / 2, -0.4
    z, y, x = write_vector(PIG, BALLS, posed(PIG, vector))[3:6]
    wanted = turn_z(0.7) @ turn_y(np.pi / 2) @ turn_x(-0.4)
    assert_allclose(turn_z(z) @ turn_y(y) @ turn_x(x), wanted, atol=1e-13)


def test_raw_pose_values_are_those_of_each_joint():
    root = turn_z(0.3) @ turn_y(0.4) @ turn_x(0.5)
    rotations = np.array([root, about([0.1, 0.2, 0.3]), np.eye(3), np.eye(3)])
    expected = [[0.3, 0.4, 0.5], [0.1, 0.2, 0.3], [0, 0, 0], [0, 0, 0]]
    assert_allclose(own_numbers(PIG, rotations), expected, atol=1e-14)


def test_values_may_be_in_a_different_order_than_the_joints():
    layout = PoseLayout(13, [9, 0, 6, 3], np.zeros(4, bool), scale=12)
    vector = np.zeros(13)
    vector[0], vector[12] = 0.5, 2.0
    pose = posed(layout, vector)
    assert pose.dofs.reshape(4, 3)[1].tolist() == [0.5, 0, 0]
    assert pose.figure_scale == 2.0
    assert_allclose(write_vector(layout, BALLS, pose), vector, atol=1e-15)


def test_model_without_layout_uses_its_dofs():
    bones = skeleton([-1, 0], [(0, "tx", 0.0), (1, "z", 0.0, -1.0, 1.0)])
    pose = posed(None, [3.0, 2.0], bones)
    assert pose.dofs.tolist() == [3.0, 1.0]  # the second DOF is clamped to its limits
    written = write_vector(None, bones, pose)
    assert written.tolist() == [3.0, 1.0]
    written[0] = 9.0  # changing the returned copy does not change the pose
    assert pose.dofs[0] == 3.0


@pytest.mark.parametrize(("layout", "count"), [(SMPL, 12), (PIG, 16), (None, 12)])
@pytest.mark.parametrize("extra", [-1, 1, 3])
def test_wrong_number_of_values_is_refused(layout, count, extra):
    pose = rest_pose(BALLS)
    with pytest.raises(RigError) as caught:
        read_vector(layout, BALLS, pose, np.ones(count + extra))
    assert str(caught.value) == f"expected {count} pose numbers, found {count + extra}"
    assert not pose.dofs.any()


def test_reading_a_vector_does_not_change_shape_weights():
    pose = rest_pose(BALLS)
    pose.shape_weights = np.array([1.0, 2.0])
    read_vector(SMPL, BALLS, pose, np.ones(12))
    assert pose.shape_weights.tolist() == [1.0, 2.0]


def test_rotation_rows_are_only_those_of_ball_joints():
    dofs = [(0, "x", 0.0), (0, "y", 0.0), (0, "z", 0.0)]
    dofs += [(1, "z", 0.0), (1, "y", 0.0), (1, "x", 0.0)]  # in another order
    dofs += [(2, "x", 0.0), (2, "z", 0.0)]
    dofs += [(3, "tx", 0.0), (3, "x", 0.0), (3, "y", 0.0), (3, "z", 0.0)]
    dofs += [(4, "x", 0.0), (4, "y", 0.0), (4, "z", 0.0), (4, "x", 0.0)]
    bones = skeleton([-1, 0, 1, 2, 3, 4], dofs)
    found = rotation_rows(bones).tolist()
    assert found == [[0, 1, 2], [-1] * 3, [-1] * 3, [9, 10, 11], [-1] * 3, [-1] * 3]


@pytest.mark.parametrize(
    "axes", ["xyz", "zyx", "xz", "y", "", "xyx"], ids=lambda axes: axes or "none"
)
@pytest.mark.parametrize("turned_rest", [False, True])
def test_any_joint_accepts_any_rotation(axes, turned_rest):
    bones = skeleton([-1, 0], [(1, axis, 0.3) for axis in axes])
    if turned_rest:
        bones = replace(bones, rest_rotations=[[0, 0, 0, 1], [0.5, 0.5, 0.5, 0.5]])
    wanted = about([0.4, -0.9, 2.0])
    pose = rest_pose(bones)
    set_joint_rotations(bones, pose, np.array([1]), wanted[None])
    found = joint_rotations(bones, pose)
    assert_allclose(found, [np.eye(3), wanted], atol=1e-14)


def test_limits_apply_to_ball_joints_unless_disabled():
    bones = skeleton([-1], [(0, "x", 0.0, -0.1, 0.1), (0, "y", 0.0), (0, "z", 0.0)])
    pose = rest_pose(bones)
    joint = np.array([0])
    set_joint_rotations(bones, pose, joint, turn_x(0.5)[None])
    assert_allclose(pose.dofs, [0.1, 0, 0], atol=1e-15)
    set_joint_rotations(bones, pose, joint, turn_x(0.5)[None], "dofs")
    assert_allclose(pose.dofs, [0.5, 0, 0], atol=1e-15)


def test_motion_beyond_limits_is_posed_as_it_is_exported():
    dofs = [(joint, axis, 0.0, -0.2, 0.3) for joint in range(2) for axis in "xyz"]
    bones = replace(skeleton([-1, 0], dofs), rest_rotations=[[0, 0, 0, 1], [0.5, 0.5, 0.5, 0.5]])
    # About z by 0.25, and about (1, 2, 2) / 3 by 2 radians.
    sine, cosine = np.sin(1.0) / 3.0, np.cos(1.0)
    turned = [[0, 0, np.sin(0.125), np.cos(0.125)], [sine, 2 * sine, 2 * sine, cosine]]
    clip = SampledClip("c", Timing(1.0, [0, 1]), np.array([turned[::-1], turned]))
    actor = Actor(Figure("f", skeleton=bones), clip=clip)
    pose_actors([actor], 1.0)
    wanted = [turn_z(0.25), about(np.array([1.0, 2.0, 2.0]) * 2.0 / 3.0)]
    assert_allclose(joint_rotations(bones, actor.pose), wanted, atol=1e-14)
    assert (actor.pose.dofs >= -0.2).all() and (actor.pose.dofs <= 0.3).all()
    # Within the limits, the DOFs have all of the rotation.
    assert_allclose(actor.pose.dofs[:3], [0, 0, 0.25], atol=1e-15)
    assert actor.pose.rotations[0].tolist() == [0, 0, 0, 1]
    assert actor.pose.dofs[5] in (-0.2, 0.3)


def test_rotation_beyond_a_hinge_is_stored_in_its_quaternion():
    bones = skeleton([-1], [(0, "x", 0.5, 0.25, 2.0)])
    pose = rest_pose(bones)
    set_joint_rotations(bones, pose, np.array([0]), turn_x(0.75)[None])
    assert pose.dofs.tolist() == [0.25]
    assert_allclose(pose.rotations, [[np.sin(0.25), 0, 0, np.cos(0.25)]], atol=1e-15)


def test_only_the_selected_joints_rotate():
    pose = rest_pose(BALLS)
    pose.dofs[:] = 0.25
    set_joint_rotations(BALLS, pose, np.array([2]), np.eye(3)[None])
    assert pose.dofs.tolist() == [0.25] * 6 + [0.0] * 3 + [0.25] * 3


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (([0.5], [False]), "starts: expected whole numbers that fit int32"),
        (([0, 3], [False]), "is_euler: expected shape 2, found 1"),
    ],
)
def test_layout_refuses_parts_that_do_not_fit(parts, message):
    with pytest.raises(RigError) as caught:
        PoseLayout(6, *parts)
    assert str(caught.value) == message
