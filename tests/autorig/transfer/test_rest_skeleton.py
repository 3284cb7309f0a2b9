"""Rest skeletons fitted to posed joints by inverting forward kinematics."""

from dataclasses import replace

import numpy as np
import pytest
from autorig.rigged_shapes import arm, turn
from faults import told
from numpy.testing import assert_allclose

from viewer.autorig.alignment.similarity import Similarity
from viewer.autorig.transfer.rest_skeleton import fit_rest_skeleton
from viewer.rig.figure import Figure
from viewer.rig.kinematics import skinning_matrices, world_matrices
from viewer.rig.pose import placement_matrix, rest_pose
from viewer.rig.skeleton import Skeleton, ball_skeleton
from viewer.rig.skin import bind_positions

EXACT = 1e-12
ROTATION = turn([1, -1, 2], 2.3)
PLACED = Similarity(5.0, ROTATION, np.array([7.0, 8.0, 9.0]), np.ones(3))


def bent(figure):
    pose = rest_pose(figure.skeleton)
    pose.dofs[:] = [0.1, -0.2, 0.3, 0.4, -0.5, 0.6, 0.7, -0.3, 0.2]
    pose.shape_weights = np.zeros(0)
    return pose


def placed_joints(figure, pose, similarity):
    return similarity.apply(
        (placement_matrix(pose) @ world_matrices(figure.skeleton, pose))[:, :3, 3]
    )


def test_same_proportions_result_in_the_scaled_skeleton_and_bind_matrices():
    figure = arm()
    pose = bent(figure)
    pose.figure_scale = 1.5
    pose.figure_translation[:] = 3.0, 2.0, 1.0
    joints = placed_joints(figure, pose, PLACED)
    found = fit_rest_skeleton(figure, pose, PLACED, joints, np.ones(2, bool))
    # The alignment scales by 5, the pose by 1.5.
    assert_allclose(found.skeleton.rest_translations, [[0, 0, 0], [0, 7.5, 0]], atol=EXACT)
    assert_allclose(
        np.linalg.inv(found.inverse_bind)[:, :3, 3], [[0, 0, 0], [0, 7.5, 0]], atol=EXACT
    )
    assert found.lines == () and found.pose.figure_scale == 1.0


def test_pose_has_the_fitted_joint_positions_and_the_aligned_rotations():
    figure = arm()
    pose = bent(figure)
    joints = placed_joints(figure, pose, PLACED)
    joints[1] += [0.5, 0.3, -0.2]  # the upper arm of the target is longer
    found = fit_rest_skeleton(figure, pose, PLACED, joints, None)
    world = placement_matrix(found.pose) @ world_matrices(found.skeleton, found.pose)
    assert_allclose(world[:, :3, 3], joints, atol=1e-11)
    wanted = ROTATION @ world_matrices(figure.skeleton, pose)[:, :3, :3]
    assert_allclose(world[:, :3, :3], wanted, atol=EXACT)


def test_bind_matrices_keep_rotations_and_get_the_new_lengths():
    figure = arm()
    bind = np.linalg.inv(figure.skin.inverse_bind)
    bind[0, :3, :3] = turn([0, 0, 1], np.pi / 2)
    bind[1] = bind[0] @ np.linalg.inv(figure.skin.inverse_bind)[1]  # bound in a pose bent to -x
    bent_bind = Figure(
        "bent", figure.mesh, figure.skeleton, replace(figure.skin, inverse_bind=np.linalg.inv(bind))
    )
    pose = bent(figure)
    straight = Similarity(1.0, np.eye(3), np.zeros(3), np.ones(3))
    joints = placed_joints(figure, pose, straight)
    longer = joints[0] + 1.5 * (joints[1] - joints[0])
    found = fit_rest_skeleton(
        bent_bind, pose, straight, np.array([joints[0], longer]), np.ones(2, bool)
    )
    places = np.linalg.inv(found.inverse_bind)
    assert_allclose(places[1, :3, 3], [-1.5, 0, 0], atol=EXACT)
    assert_allclose(places[:, :3, :3], bind[:, :3, :3], atol=EXACT)


def test_root_limits_are_widened_and_lengths_scaled():
    figure = arm(limit=0.8)
    pose = bent(figure)
    joints = placed_joints(figure, pose, PLACED)
    found = fit_rest_skeleton(figure, pose, PLACED, joints, None)
    limits = found.skeleton.dof_limits
    assert_allclose(limits[:3], np.tile([-4.0, 4.0], (3, 1)))  # lengths are scaled by five
    assert_allclose(limits[6:], np.tile([-0.8, 0.8], (3, 1)))  # angles of the tip
    angles = found.pose.dofs[3:6]
    assert (limits[3:6, 0] <= angles).all() and (angles <= limits[3:6, 1]).all()
    assert told(found.lines) == [("R008.limits-widened", {"joint": "base"})]


def test_root_without_a_ball_joint_rotates_by_its_quaternion():
    figure = arm()
    kept = [0, 1, 2, 3, 6, 7, 8]  # the root rotates about x only
    skeleton = figure.skeleton
    one = replace(
        skeleton,
        dof_joints=skeleton.dof_joints[kept],
        dof_kinds=skeleton.dof_kinds[kept],
        rest_dofs=skeleton.rest_dofs[kept],
        dof_limits=skeleton.dof_limits[kept],
    )
    stiff = Figure("stiff", figure.mesh, one, figure.skin)
    pose = rest_pose(one)
    pose.dofs[:] = [0, 0, 0, 0.4, 0.7, -0.3, 0.2]
    joints = placed_joints(stiff, pose, PLACED)
    found = fit_rest_skeleton(stiff, pose, PLACED, joints, None)
    assert_allclose(found.pose.dofs[3:], pose.dofs[3:])
    world = placement_matrix(found.pose) @ world_matrices(found.skeleton, found.pose)
    assert_allclose(world[:, :3, 3], joints, atol=1e-11)
    assert_allclose(world[:, :3, :3], ROTATION @ world_matrices(one, pose)[:, :3, :3], atol=EXACT)


def spread() -> Figure:
    """Return a root with a left and a right joint, and a mesh of one triangle."""
    figure = arm()
    joints = np.array([[0.0, 1, 0], [1, 1, 0], [-1, 1, 0], [0, 2, 0]])
    skeleton = ball_skeleton(("root", "left", "right", "top"), np.array([-1, 0, 0, 0]), joints)
    skin = replace(
        figure.skin, inverse_bind=np.tile(np.eye(4), (4, 1, 1)), joints=0 * figure.skin.joints
    )
    return Figure("spread", figure.mesh, skeleton, skin)


@pytest.mark.parametrize(
    ("transferred", "left", "right"),
    [
        ([True] * 4, 1.25, 1.25),  # both joints were measured, so their mean is used
        ([True, True, False, True], 1.4, 1.4),  # one joint was measured and is used for both
        ([True, False, False, True], 1.25, 1.25),
    ],
)
def test_symmetric_skeletons_stay_symmetric(transferred, left, right):
    figure = spread()
    assert isinstance(figure.skeleton, Skeleton)
    pose = rest_pose(figure.skeleton)
    joints = np.array([[0.0, 1, 0], [1.4, 1, 0], [-1.1, 1, 0], [0.2, 2, 0]])
    straight = Similarity(1.0, np.eye(3), np.zeros(3), np.ones(3))
    found = fit_rest_skeleton(figure, pose, straight, joints, np.array(transferred))
    offsets = found.skeleton.rest_translations
    assert_allclose(offsets[1:3], [[left, 0, 0], [-right, 0, 0]], atol=EXACT)
    # The middle joint is its own mirror counterpart and returns to the middle.
    assert_allclose(offsets[3], [0, 1, 0], atol=EXACT)


def test_bind_pose_agrees_with_the_rest_pose():
    figure = arm()
    found = fit_rest_skeleton(
        figure, bent(figure), PLACED, placed_joints(figure, bent(figure), PLACED), None
    )
    zero = rest_pose(found.skeleton)
    zero.dofs[:] = 0.0
    palette = skinning_matrices(world_matrices(found.skeleton, zero), found.inverse_bind)
    assert_allclose(palette, np.tile(np.eye(4), (2, 1, 1)), atol=EXACT)
    assert_allclose(bind_positions(replace(figure.skin, inverse_bind=found.inverse_bind))[1, 1], 5)


def test_root_uses_angles_within_its_limits():
    # A rotation by 120 degrees about y has the angles (180, 60, 180) or (0, 120, 0).
    figure = arm(limit=2.2)
    pose = rest_pose(figure.skeleton)
    similarity = Similarity(1.0, turn([0, 1, 0], np.radians(120)), np.zeros(3), np.ones(3))
    joints = placed_joints(figure, pose, similarity)
    found = fit_rest_skeleton(figure, pose, similarity, joints, None)
    assert_allclose(found.pose.dofs[3:6], [0.0, np.radians(120), 0.0], atol=EXACT)
    assert found.lines == ()
