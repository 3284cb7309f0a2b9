"""Edits of joints: the mesh at rest stays, and joints turn about their new places."""

from dataclasses import replace

import numpy as np
import pytest
from builders import axis_turn, quaternions
from numpy.testing import assert_allclose

from viewer.errors import RigError
from viewer.rigs.constraints.constraint import Constraint
from viewer.rigs.figure import Figure
from viewer.rigs.joint_edits import (
    Plane,
    added,
    at_rest,
    mirrored,
    moved,
    partners,
    removed,
    renamed,
    rest_worlds,
    with_below,
)
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import rest_pose
from viewer.rigs.skeleton import Skeleton, ball_skeleton
from viewer.rigs.skin import skin_from_lists
from viewer.rigs.skinning import deform

X = Plane(np.array([1.0, 0.0, 0.0]), 0.5)
ROUNDING = 1e-12


def rest(figure):
    return deform(figure, rest_pose(figure.skeleton))[0]


def places(figure):
    return rest_worlds(figure)[:, :3, 3]


def figure_of(skeleton, vertices, influences, inverse=None):
    """Return a figure with a vertex per row; bound at rest unless inverse bind matrices differ."""
    count = len(vertices)
    triangles = np.array([[0, 1 % count, 2 % count]], dtype=np.int32)
    mesh = Mesh(np.array(vertices, dtype=float), np.tile([0.0, 0, 1], (count, 1)), triangles)
    bare = Figure("bar", skeleton=skeleton)
    inverse = np.linalg.inv(rest_worlds(bare)) if inverse is None else inverse
    return Figure("bar", mesh, skeleton, skin_from_lists(influences, inverse))


@pytest.fixture
def crooked():
    """Return a chain with rotations, scales, translation DOFs and a bind pose unlike its rest."""
    skeleton = Skeleton(
        names=("hip", "knee", "foot"),
        parents=np.array([-1, 0, 1]),
        rest_translations=np.array([[1.0, 2, 3], [0, 4, 0], [0, 0, 2]]),
        rest_rotations=quaternions([[0, 0, np.pi / 2], [0.3, -0.4, 0.2], [0, 1, 0]]),
        rest_scales=np.array([[2.0, 2, 2], [1, 1, 1], [0.5, 0.5, 0.5]]),
        dof_joints=np.array([0, 0, 1, 1]),
        dof_kinds=np.array([1, 5, 0, 3]),
        rest_dofs=np.array([0.7, 0.2, -0.3, 0.5]),
        dof_limits=np.array([[-2.0, 2], [-1, 1], [-1, 1], [0, 2]]),
    )
    worlds = rest_worlds(Figure("bare", skeleton=skeleton))
    bind = worlds.copy()
    bind[:, :3, 3] += [[0.1, 0, 0], [0, 0.2, 0], [0.3, 0, 0.1]]
    vertices = [[0.0, 1, 2], [3, 4, 5], [2, 2, 2], [1, 5, 3]]
    rows = [[(0, 1.0)], [(0, 0.4), (1, 0.6)], [(1, 0.5), (2, 0.5)], [(2, 1.0)]]
    return figure_of(skeleton, vertices, rows, np.linalg.inv(bind))


def test_moved_joint_is_where_it_was_put_and_nothing_else_moves(crooked):
    goal = np.array([-1.5, 0.25, 6.0])
    edited = moved(crooked, {1: goal})
    assert_allclose(places(edited)[1], goal, atol=ROUNDING)
    assert_allclose(places(edited)[[0, 2]], places(crooked)[[0, 2]], atol=ROUNDING)
    assert_allclose(rest(edited), rest(crooked), atol=ROUNDING)
    # Axes, limits and DOFs are the same; only the offsets of two joints differ.
    assert_allclose(rest_worlds(edited)[:, :3, :3], rest_worlds(crooked)[:, :3, :3], atol=ROUNDING)
    assert_allclose(edited.skeleton.rest_dofs, crooked.skeleton.rest_dofs)
    assert_allclose(edited.skeleton.dof_limits, crooked.skeleton.dof_limits)


def test_moved_joint_rotates_its_vertices_about_its_new_place(crooked):
    goal = np.array([2.0, -1.0, 0.5])
    edited = moved(crooked, {2: goal})
    pose = rest_pose(edited.skeleton)
    pose.rotations[2] = quaternions([[0, 1 + 0.6, 0]])[0]  # 0.6 about its own y axis
    axes = rest_worlds(crooked)[2, :3, :3]
    axes = axes / np.linalg.norm(axes, axis=0)
    turn = axes @ axis_turn(1, 0.6) @ axes.T
    # Vertex 3 follows this joint alone.
    expected = goal + turn @ (rest(crooked)[3] - goal)
    assert_allclose(deform(edited, pose)[0][3], expected, atol=1e-9)


def test_joints_below_move_along(crooked):
    shift = np.array([0.5, -2.0, 1.0])
    goals = with_below(crooked, 1, places(crooked)[1] + shift)
    assert sorted(goals) == [1, 2]
    assert_allclose(goals[2], places(crooked)[2] + shift, atol=ROUNDING)


def test_added_joint_rotates_freely_and_has_no_weights(crooked):
    edited = added(crooked, 2, np.array([7.0, 8, 9]))
    skeleton = edited.skeleton
    assert skeleton.names[3] == "joint" and skeleton.parents[3] == 2
    assert_allclose(places(edited)[3], [7, 8, 9], atol=1e-9)
    assert_allclose(rest_worlds(edited)[3, :3, :3], np.eye(3), atol=1e-9)  # axes of the figure
    assert skeleton.dof_kinds[skeleton.dof_joints == 3].tolist() == [3, 4, 5]
    assert_allclose(rest(edited), rest(crooked), atol=ROUNDING)
    assert 3 not in edited.skin.joints
    again = added(edited, 3, np.zeros(3))
    assert again.skeleton.names[4] == "joint_2"


def test_removed_joint_leaves_children_and_weights_to_the_one_above():
    skeleton = ball_skeleton(
        ("a", "b", "c", "d"), np.array([-1, 0, 1, 1]),
        np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0]]),
    )  # fmt: skip
    vertices = [[0.5, 0, 0], [1.5, 0, 0], [2.5, 0, 0]]
    rows = [[(0, 0.75), (1, 0.25)], [(1, 0.5), (2, 0.5)], [(3, 1.0)]]
    edited = removed(figure_of(skeleton, vertices, rows), {1})
    assert edited.skeleton.names == ("a", "c", "d")
    assert edited.skeleton.parents.tolist() == [-1, 0, 0]
    assert_allclose(places(edited), [[0, 0, 0], [2, 0, 0], [2, 1, 0]], atol=ROUNDING)
    assert edited.skin.starts.tolist() == [0, 1, 3, 4]  # 0.75 and 0.25 of the same joint are one
    assert edited.skin.joints.tolist() == [0, 0, 1, 2]
    assert_allclose(edited.skin.weights, [1.0, 0.5, 0.5, 1.0])
    assert_allclose(rest(edited), vertices, atol=ROUNDING)


def test_children_of_a_removed_joint_keep_their_axes(crooked):
    edited = removed(crooked, {1})
    assert_allclose(rest_worlds(edited)[1], rest_worlds(crooked)[2], atol=1e-9)


def test_only_a_root_with_one_child_can_be_removed():
    spots = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]])
    chain = ball_skeleton(("a", "b", "c"), np.array([-1, 0, 1]), spots[:3])
    rows = [[(0, 1.0)], [(0, 0.5), (1, 0.5)], [(2, 1.0)]]
    edited = removed(figure_of(chain, spots[:3], rows), {0})
    assert edited.skeleton.parents.tolist() == [-1, 0]
    assert edited.skin.joints.tolist() == [0, 0, 1]
    fork = ball_skeleton(("a", "b", "c"), np.array([-1, 0, 0]), spots[:3])
    with pytest.raises(RigError, match="a is a root with 2 joints below it"):
        removed(figure_of(fork, spots[:3], rows), {0})
    single = ball_skeleton(("a",), np.array([-1]), spots[:1])
    with pytest.raises(RigError, match="a is a root with 0 joints below it"):
        removed(figure_of(single, spots[:3], [[(0, 1.0)]] * 3), {0})


def arm_of(names, shift=0.0):
    spots = np.array([[0.5, 0, 0], [1.5, 1, 0], [2.5, 1, 0.25]]) + shift
    skeleton = ball_skeleton(names, np.array([-1, 0, 1]), spots)
    return figure_of(skeleton, spots, [[(0, 1.0)], [(1, 1.0)], [(2, 1.0)]])


@pytest.mark.parametrize(
    ("names", "here", "there"),
    [
        (("chest", "arm.L", "HandLeft"), ("arm.L", "HandLeft"), ("arm.R", "HandRight")),
        (("chest", "l_a", "a_1_left_end"), ("l_a", "a_1_left_end"), ("r_a", "a_1_right_end")),
        (("chest", "joint", "tip"), ("joint_left", "tip_left"), ("joint_right", "tip_right")),
    ],
)
def test_mirrored_chain_has_names_of_the_other_side(names, here, there):
    edited = mirrored(arm_of(names), 1, X)
    assert edited.skeleton.names == ("chest", *here, *there)
    assert edited.skeleton.parents.tolist() == [-1, 0, 1, 0, 3]
    # p.x is reflected at 0.5.
    assert_allclose(places(edited)[3:], [[-0.5, 1, 0], [-1.5, 1, 0.25]], atol=ROUNDING)
    assert partners(edited, X) == [0, 3, 4, 1, 2]


def test_mirroring_moves_a_counterpart_that_exists():
    edited = mirrored(arm_of(("chest", "arm_l", "hand_l")), 1, X)
    bent = moved(edited, {2: np.array([3.0, 2.0, 1.0])})
    again = mirrored(bent, 2, X)
    assert again.skeleton.n_joints == 5
    assert_allclose(places(again)[4], [-2, 2, 1], atol=ROUNDING)
    assert_allclose(places(again)[3], places(bent)[3], atol=ROUNDING)


@pytest.mark.parametrize("kind", range(6))
def test_mirrored_dofs_move_mirror_images(crooked, kind):
    """A DOF of the image with the reflected value moves what is below it to the mirror image."""
    old = crooked.skeleton
    limits = np.array([[-2.0, 2], [-1, 1], [-0.25, 1.5]])
    # Translation DOFs are along the axes of the joint above, which must be symmetric.
    turned = quaternions([[0.6, 0, 0] if kind < 3 else [0.5, 0.4, 0.3]])
    skeleton = replace(
        old,
        rest_rotations=np.concatenate([turned, old.rest_rotations[1:]]),
        dof_joints=np.array([0, 0, 1]),
        dof_kinds=np.array([1, 5, kind]),
        rest_dofs=np.array([0.7, 0.0, 0.4]),
        dof_limits=limits,
    )
    plane = Plane(np.array([1.0, 0.0, 0.0]), -2.0)
    figure = renamed(replace(crooked, skeleton=skeleton), 1, "knee_left")
    edited = mirrored(figure, 1, plane)
    own, image = (np.flatnonzero(edited.skeleton.dof_joints == joint)[0] for joint in (1, 3))
    low, high = edited.skeleton.dof_limits[image]
    reverses = low == -1.5
    assert reverses == (kind in (0, 4, 5))  # translation along x, rotations about y and z
    assert (low, high) == ((-1.5, 0.25) if reverses else (-0.25, 1.5))
    pose = rest_pose(edited.skeleton)
    pose.dofs[own] = 1.1
    pose.dofs[image] = -1.1 if reverses else 1.1
    worlds = world_matrices(edited.skeleton, pose)[:, :3, 3]
    for joint, other in ((1, 3), (2, 4)):
        assert_allclose(worlds[other], plane.image(worlds[joint]), atol=1e-9)


def test_joints_in_the_plane_have_no_mirror_image():
    with pytest.raises(RigError, match="chest is in the plane of symmetry"):
        mirrored(removed(arm_of(("chest", "arm", "hand")), {1, 2}), 0, X)
    both = mirrored(arm_of(("chest", "arm_l", "hand_l")), 1, X)
    with pytest.raises(RigError, match="joints of both sides below"):
        mirrored(both, 0, X)


def test_partners_without_names_are_found_by_their_places():
    spots = np.array([[0.5, 0, 0], [1.5, 0, 0], [-0.5, 0.01, 0], [3.0, 0, 0]])
    skeleton = ball_skeleton(("a", "b", "c", "d"), np.array([-1, 0, 0, 0]), spots)
    figure = figure_of(skeleton, spots, [[(0, 1.0)]] * 4)
    assert partners(figure, X) == [0, 2, 1, -1]


def test_joints_with_constraints_can_be_moved_only(crooked):
    tied = replace(crooked.skeleton, constraints=(Constraint(2, 0, "rotation"),))
    figure = replace(crooked, skeleton=tied)
    with pytest.raises(RigError, match="this skeleton has constraints"):
        added(figure, 0, np.zeros(3))
    with pytest.raises(RigError, match="this skeleton has constraints"):
        removed(figure, {1})


def test_rest_pose_can_be_any_pose(crooked):
    pose = rest_pose(crooked.skeleton)
    pose.dofs[:] = 0.1, -0.4, 0.2, 1.2
    pose.translations[1] = 0.3, 0.2, 0.1
    pose.rotations[2] = quaternions([[0.4, 0.1, 0.2]])[0]
    there = replace(crooked, skeleton=at_rest(crooked.skeleton, pose))
    assert_allclose(rest(there), deform(crooked, pose)[0], atol=ROUNDING)
