"""Transfer of joints with the surrounding surface."""

from dataclasses import replace

import numpy as np
import pytest
from autorig.rigged_shapes import arm, tube, turn
from faults import told
from numpy.testing import assert_allclose, assert_array_equal

from viewer.autorig.alignment.similarity import Similarity
from viewer.autorig.transfer.inverse_skinning import invert_skinning, repair_tears
from viewer.autorig.transfer.joint_transfer import (
    boundary_weights,
    outside,
    surface_shifts,
    transfer_joints,
)
from viewer.autorig.transfer.rest_skeleton import fit_rest_skeleton, leg_scale
from viewer.rigs.blendshapes import JointRegressor
from viewer.rigs.figure import Figure
from viewer.rigs.kinematics import skinning_matrices, world_matrices
from viewer.rigs.pose import placement_matrix, rest_pose
from viewer.rigs.skeleton import Skeleton, ball_skeleton
from viewer.rigs.skin import bind_positions, skin_from_lists

PARENTS = np.array([-1, 0, 1])
JOINTS = np.array([[0.0, 0, 0], [0, 1, 0], [0, 2, 0]])


def table(regressor, n_vertices):
    dense = np.zeros((regressor.n_joints, n_vertices))
    np.add.at(dense, (regressor.joints, regressor.vertices), regressor.weights)
    return dense


def test_boundary_has_weights_of_both_a_joint_and_its_parent():
    influences = [
        [(0, 1.0)],
        [(0, 0.25), (1, 0.75)],
        [(1, 0.5), (2, 0.5)],
        [(2, 0.5), (0, 0.5)],
        [(1, 0.2), (0, 0.8), (1, 0.2)],  # a joint listed twice is used once with the sum
    ]
    skin = skin_from_lists(influences, np.tile(np.eye(4), (3, 1, 1)))
    child = [0.0, 0.25 * 0.75, 0.0, 0.0, 0.4 * 0.8]
    expected = [child, child, [0.0, 0.0, 0.25, 0.0, 0.0]]
    assert_allclose(table(boundary_weights(skin, PARENTS), 5), expected, atol=1e-15)


def test_skin_without_influences_has_no_boundary():
    skin = skin_from_lists([[], []], np.tile(np.eye(4), (3, 1, 1)))
    assert len(boundary_weights(skin, PARENTS).weights) == 0


def regressor():
    # Joint 1 depends on vertices 0 and 1, joint 2 on vertex 2 only, and the root on none.
    return JointRegressor(3, [1, 1, 2], [0, 1, 2], [0.5, 0.5, 1.0])


SHIFTS = np.array([[1.0, 0, 0], [0, 2, 0], [0, 0, 3]])


def test_joints_move_by_the_weighted_mean_of_their_surface():
    found = transfer_joints(JOINTS, PARENTS, regressor(), SHIFTS, np.array([True, True, True]))
    assert_allclose(found.positions, [[0, 0, 0], [0.5, 2, 0], [0, 2, 3]])
    assert found.transferred.tolist() == [False, True, True]
    assert found.measurable.tolist() == [False, True, True]


def test_joint_without_surface_follows_its_parent():
    found = transfer_joints(JOINTS, PARENTS, regressor(), SHIFTS, np.array([True, False, False]))
    # Half of the weights of joint 1 remain, which is enough, but none of joint 2.
    assert_allclose(found.positions, [[0, 0, 0], [1, 1, 0], [1, 2, 0]])
    assert found.transferred.tolist() == [False, True, False]
    assert found.measurable.tolist() == [False, True, True]


def test_rows_that_cancel_out_are_ignored():
    rows = JointRegressor(3, [1, 1], [0, 1], [1.0, -0.9])
    found = transfer_joints(JOINTS, PARENTS, rows, SHIFTS, np.ones(3, bool))
    assert_array_equal(found.positions, JOINTS)
    assert not found.transferred.any()


def test_shifts_point_to_the_surface_and_are_used_if_it_is_close_and_similar():
    square = np.array([[-1.0, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    points = np.array([[0.0, 0.1, 0], [0, 0.9, 0], [0.2, 0.1, 0.3], [0.5, -0.1, 0]])
    normals = np.array([[0.0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0]])
    shifts, matched = surface_shifts(points, normals, square, triangles, 0.5)
    assert_allclose(shifts, [[0, -0.1, 0], [0, -0.9, 0], [0, -0.1, 0], [0, 0.1, 0]], atol=1e-15)
    assert matched.tolist() == [True, False, False, True]


def test_joints_inside_and_outside_the_mesh_are_distinguished():
    positions, triangles = tube()
    joints = np.array([[0.0, 1.0, 0.05], [0.0, 3.0, 0.0], [0.9, 1.0, 0.0]])
    assert outside(positions, triangles, joints).tolist() == [False, True, True]
    assert outside(positions, triangles[:, ::-1], joints).tolist() == [False, True, True]


def stick(up="y", leg=1.0, arm=0.5):
    """Return a root with two legs of two bones, and a raised arm."""
    names = ("root", "knee_l", "foot_l", "knee_r", "foot_r", "hand")
    places = np.zeros((6, 3))
    places[:, 0] = 0.0, 0.1, 0.1, -0.1, -0.1, 0.0
    heights = 3.0 + np.array([0.0, -leg / 2, -leg, -leg / 2, -leg, arm])
    places[:, "xyz".index(up)] = heights
    return ball_skeleton(names, np.array([-1, 0, 1, 0, 3, 0]), places)


@pytest.mark.parametrize("up", ["y", "z"])
def test_only_leg_length_affects_the_ratio(up):
    longer = stick(up, leg=1.4, arm=0.9)
    assert leg_scale(stick(up), longer, up, 7.0) == pytest.approx(1.4)


def test_feet_are_taken_from_the_first_skeleton():
    tiptoe = stick()
    raised = tiptoe.rest_translations.copy()
    raised[4, 1] += 0.2  # one foot is 0.2 higher, so the mean is 0.9 below the root
    assert leg_scale(stick(), replace(tiptoe, rest_translations=raised), "y", 7.0) == (
        pytest.approx(0.9)
    )


@pytest.mark.parametrize("leg", [0.0, 0.1, -1.0])
def test_figures_without_legs_have_no_ratio(leg):
    # The root is (nearly) the lowest joint.
    assert leg_scale(stick(leg=leg), stick(), "y", 7.0) == 7.0


def test_skeleton_of_one_joint_has_no_ratio():
    one = ball_skeleton(("a",), np.array([-1]), np.ones((1, 3)))
    assert leg_scale(one, one, "y", 2.5) == 2.5


def test_feet_above_the_root_result_in_the_fallback():
    assert leg_scale(stick(), stick(leg=-1.0), "y", 2.0) == 2.0


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


def palette(angle):
    """Return the palette of a base at rest and a tip rotated about z through (0, 1, 0)."""
    matrices = np.tile(np.eye(4), (2, 1, 1))
    rotation = turn([0, 0, 1], angle)
    matrices[1, :3, :3] = rotation
    matrices[1, :3, 3] = [0, 1, 0] - rotation @ [0, 1, 0]
    return matrices


def skinned(positions, skin, matrices):
    """Skin vertex by vertex, directly by the formula."""
    moved = []
    for vertex, point in enumerate(positions):
        span = slice(skin.starts[vertex], skin.starts[vertex + 1])
        blended = sum(
            w * matrices[j] for j, w in zip(skin.joints[span], skin.weights[span], strict=True)
        )
        moved.append((blended @ [*point, 1.0])[:3])
    return np.array(moved)


def test_skinned_mesh_is_inverted_exactly():
    figure = arm()
    matrices = palette(1.2)
    posed = skinned(figure.mesh.positions, figure.skin, matrices)
    found = invert_skinning(posed, figure.skin, matrices)
    assert_allclose(found.positions, figure.mesh.positions, atol=EXACT)
    assert not found.guarded.any()


@pytest.mark.parametrize(("degrees", "guarded"), [(156.0, False), (158.0, True), (180.0, True)])
def test_equal_weights_are_singular_beyond_157_degrees(degrees, guarded):
    # The smallest singular value of (I + R) / 2 is cos(angle / 2), here 0.208 and 0.191.
    skin = skin_from_lists([[(0, 0.5), (1, 0.5)]], np.tile(np.eye(4), (2, 1, 1)))
    found = invert_skinning(np.array([[0.3, 0.2, 0.1]]), skin, palette(np.radians(degrees)))
    assert found.guarded.tolist() == [guarded]
    assert np.abs(found.positions).max() < 10.0


def test_singular_vertex_is_inverted_with_the_nearest_rotation():
    # The mean of the identity and 160 degrees about z is cos(80 deg) times a rotation by 80
    # degrees.
    angle = np.radians(160.0)
    skin = skin_from_lists([[(0, 0.5), (1, 0.5)]], np.tile(np.eye(4), (2, 1, 1)))
    matrices = palette(angle)
    point = np.array([0.4, 1.5, -0.2])
    found = invert_skinning(point[None], skin, matrices)
    shift = 0.5 * matrices[1, :3, 3]
    assert_allclose(found.positions[0], turn([0, 0, 1], -angle / 2) @ (point - shift), atol=EXACT)


def test_vertex_without_influence_does_not_move():
    skin = skin_from_lists([[], [(1, 1.0)]], np.tile(np.eye(4), (2, 1, 1)))
    found = invert_skinning(np.ones((2, 3)), skin, palette(0.5))
    assert_allclose(found.positions[0], [1.0, 1.0, 1.0])
    assert not found.guarded.any()


def test_repair_moves_only_the_neighbourhood_and_improves_the_pose():
    figure = arm()
    matrices = palette(np.radians(170.0))
    posed = skinned(figure.mesh.positions, figure.skin, matrices)
    found = invert_skinning(posed, figure.skin, matrices)
    assert found.guarded.any() and not found.guarded.all()
    mended = repair_tears(found, posed, figure.mesh.triangles)
    assert (mended[found.guarded] != found.positions[found.guarded]).any()
    # No vertex moves three rings away from the fold, at least 0.45 from y = 1.
    away = np.abs(figure.mesh.positions[:, 1] - 1.0) > 0.45
    assert (mended[away] == found.positions[away]).all()
    before, after = (
        np.linalg.norm(skinned(rest, figure.skin, matrices) - posed, axis=1).max()
        for rest in (found.positions, mended)
    )
    assert after < 0.5 * before


def test_no_vertex_is_repaired_without_singular_vertices():
    figure = arm()
    matrices = palette(0.3)
    posed = skinned(figure.mesh.positions, figure.skin, matrices)
    found = invert_skinning(posed, figure.skin, matrices)
    assert repair_tears(found, posed, figure.mesh.triangles) is found.positions
