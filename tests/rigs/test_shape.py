"""Shapes of the rest mesh, which joints and bindings follow and the rest pose reproduces."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest
from builders import family_figure
from exporters.plain_smpl import smpl_forward
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose
from rigs.hand_made import matrix, mesh, skeleton, turn_x, turn_y, turn_z

from viewer.errors import RigError
from viewer.rigs.blendshapes import BlendShapes, Correctives, JointRegressor
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.memo import Memo
from viewer.rigs.pose import rest_pose
from viewer.rigs.shape import rest_joints, rest_positions, shaped, shaped_skeleton, with_rest_mesh
from viewer.rigs.skin import skin_from_lists
from viewer.rigs.skinning import deform

# Two joints, each the mean of two vertices; the shape moves the last vertex by 2 along x.
POSITIONS = [[0.0, -1, 0], [0, 1, 0], [4, -1, 0], [4, 1, 0]]


def arm(**changes) -> Figure:
    directions = np.zeros((2, 4, 3))
    directions[0, 3, 0] = 2.0
    directions[1, :, 1] = 1.0
    bones = skeleton(
        [-1, 0],
        [(joint, axis, 0.0) for joint in (0, 1) for axis in "xyz"],
        None,
        [[0] * 3, [4, 0, 0]],
    )
    bind = np.array([np.eye(4), matrix(None, (4, 0, 0))])
    weights = [[(0, 1.0)], [(0, 1.0)], [(1, 1.0)], [(1, 0.5), (0, 0.5)]]
    parts = {
        "mesh": mesh(POSITIONS, triangles=[[0, 2, 1], [1, 2, 3]]),
        "skeleton": bones,
        "skin": skin_from_lists(weights, np.linalg.inv(bind)),
        "blend_shapes": BlendShapes(("longer", "higher"), directions),
        "joint_regressor": JointRegressor(2, [0, 0, 1, 1], [0, 1, 2, 3], [0.5] * 4),
        **changes,
    }
    return Figure("arm", **parts)


def test_shape_moves_vertices_joints_and_bindings():
    changed = shaped(arm(), np.array([1.0, 3.0]))
    # Vertex 3 moves by (2, 3, 0), the others by (0, 3, 0); joint 1 is the mean of vertices 2 and 3.
    assert changed.mesh.positions.tolist() == [[0, 2, 0], [0, 4, 0], [4, 2, 0], [6, 4, 0]]
    assert rest_joints(changed).tolist() == [[0, 3, 0], [5, 3, 0]]
    assert changed.skeleton.rest_translations.tolist() == [[0, 3, 0], [5, 0, 0]]
    assert changed.skin.inverse_bind[1].tolist() == matrix(None, (-5, -3, 0)).tolist()


def test_shaped_normals_are_those_of_the_new_surface():
    directions = np.zeros((1, 4, 3))
    directions[0, [2, 3], 2] = 4.0  # the square is tilted: z = x
    figure = arm(blend_shapes=BlendShapes(("lean",), directions))
    normals = shaped(figure, np.array([1.0])).mesh.normals
    assert_allclose(normals, np.tile([-np.sqrt(0.5), 0, np.sqrt(0.5)], (4, 1)), atol=1e-15)


def test_zero_weights_return_the_figure_itself():
    figure = arm()
    assert shaped(figure, np.zeros(2)) is figure
    assert shaped(figure, np.zeros(0)) is figure
    plain = replace(figure, blend_shapes=None)
    assert shaped(plain, np.zeros(0)) is plain


def test_too_many_weights_are_refused():
    with pytest.raises(RigError) as caught:
        shaped(arm(), np.array([0.0, 0.0, 1.0]))
    assert str(caught.value) == "expected at most 2 shape weights, found 3"


def test_equal_weights_return_the_same_figure():
    figure = arm()
    first = shaped(figure, np.array([1.0, 0.0]))
    assert shaped(figure, np.array([1.0, 0.0])) is first
    assert shaped(figure, np.array([2.0, 0.0])) is not first


def test_joints_do_not_move_without_a_regressor():
    figure = arm(joint_regressor=None)
    changed = shaped(figure, np.array([1.0, 3.0]))
    assert changed.skeleton is figure.skeleton
    assert changed.skin is figure.skin
    assert changed.mesh.positions[3].tolist() == [6, 4, 0]


def test_rest_pose_of_a_shaped_figure_returns_the_shaped_mesh():
    figure = arm()
    pose = figure_pose(figure)
    pose.shape_weights[:] = -0.7, 2.5
    positions, _ = deform(figure, pose)
    moves = positions - np.array(POSITIONS)
    assert_allclose(moves, [[0, 2.5, 0], [0, 2.5, 0], [0, 2.5, 0], [-1.4, 2.5, 0]], atol=1e-15)


def test_joint_rotates_about_its_shaped_position():
    figure = arm()
    pose = figure_pose(figure)
    pose.shape_weights[:] = 1.0, 0.0
    pose.dofs[5] = np.pi / 2  # joint 1 about z; it is at (5, 0, 0)
    positions, _ = deform(figure, pose)
    # Vertex 2 at (4, -1, 0) is (-1, -1) from the joint and rotates to (1, -1).
    assert_allclose(positions[2], [6, -1, 0], atol=1e-15)


def turned_chain(scale=1.0) -> Figure:
    """Return a chain of three joints with rest rotations, bound in its rest pose."""
    rng = np.random.default_rng(0)
    bones = skeleton(
        [-1, 0, 1],
        [(joint, axis, 0.0) for joint in range(3) for axis in "xyz"],
        offsets=rng.normal(size=(3, 3)),
    )
    half = np.sqrt(0.5)
    quaternions = [[half, 0, 0, half], [0, 0.6, 0, 0.8], [0.5, 0.5, 0.5, 0.5]]
    bones = replace(bones, rest_rotations=quaternions, rest_scales=np.full((3, 3), scale))
    worlds, world = [], np.eye(4)
    turns = [turn_x(np.pi / 2), None, None]
    turns[1] = np.array([[0.28, 0, 0.96], [0, 1, 0], [-0.96, 0, 0.28]])  # 2 asin 0.6 about y
    turns[2] = np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]])
    for turn, offset in zip(turns, bones.rest_translations, strict=True):
        world = world @ matrix(scale * turn, offset)
        worlds.append(world)
    count = 12
    influences = [[(v % 3, 0.25), ((v + 1) % 3, 0.75)] for v in range(count)]
    shape = mesh(rng.normal(size=(count, 3)), triangles=[[0, 1, 2]])
    regressor = JointRegressor(3, [0, 1, 2], [0, 5, 9], [1.0, 1.0, 1.0])
    return Figure(
        "chain",
        shape,
        bones,
        skin_from_lists(influences, np.linalg.inv(worlds)),
        blend_shapes=BlendShapes(("a", "b"), rng.normal(size=(2, count, 3))),
        joint_regressor=regressor,
    )


@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_rest_pose_returns_the_shaped_mesh_under_rest_rotations(scale):
    figure = turned_chain(scale)
    pose = figure_pose(figure)
    pose.shape_weights[:] = 0.8, -1.5
    directions = figure.blend_shapes.offsets
    expected = figure.mesh.positions + 0.8 * directions[0] - 1.5 * directions[1]
    # Joint 1 is vertex 5 and so on, in the shaped mesh.
    assert_allclose(
        rest_joints(shaped(figure, pose.shape_weights)), expected[[0, 5, 9]], atol=1e-14
    )
    before = rest_joints(figure)
    assert not np.allclose(before, figure.mesh.positions[[0, 5, 9]])
    # The bindings move with the joints, so the vertices move by their offsets only.
    assert_allclose(deform(figure, pose)[0], expected, atol=1e-13)


def test_rest_rotations_do_not_depend_on_the_shape():
    figure = turned_chain()
    changed = shaped(figure, np.array([1.0, 1.0]))
    assert np.array_equal(changed.skeleton.rest_rotations, figure.skeleton.rest_rotations)


def test_dofs_of_the_rest_pose_do_not_move_the_regressed_joints():
    figure = arm()
    bones = replace(figure.skeleton, rest_dofs=[0.0, 0, 1.0, 0, 0, 0.5])
    changed = shaped(replace(figure, skeleton=bones), np.array([1.0, 0.0]))
    assert rest_joints(changed).tolist() == [[0, 0, 0], [5, 0, 0]]
    assert changed.skeleton.rest_dofs.tolist() == [0, 0, 1, 0, 0, 0.5]


@pytest.mark.parametrize("kind", ["smpl", "smplh", "smplx", "mano", "flame"])
def test_family_at_rest_is_its_template_plus_the_shape(tmp_path, kind):
    arrays = model(kind)
    figure = family_figure(kind, tmp_path)
    weights = np.random.default_rng(0).normal(size=arrays["shapedirs"].shape[2])
    pose = figure_pose(figure)
    pose.shape_weights[:] = weights
    expected = arrays["v_template"] + arrays["shapedirs"] @ weights
    assert_allclose(deform(figure, pose)[0], expected, atol=1e-14)
    joints = arrays["J_regressor"] @ expected
    assert_allclose(rest_joints(shaped(figure, weights)), joints, atol=1e-14)


@pytest.mark.parametrize("kind", ["smpl", "flame"])
def test_family_in_a_pose_follows_the_published_forward_pass(tmp_path, kind):
    arrays = model(kind)
    figure = family_figure(kind, tmp_path)
    rng = np.random.default_rng(1)
    pose = figure_pose(figure)
    pose.dofs[:] = rng.uniform(-1, 1, len(pose.dofs))
    pose.shape_weights[:] = rng.normal(size=len(pose.shape_weights))
    x, y, z = pose.dofs.reshape(-1, 3).T
    turns = [turn_z(c) @ turn_y(b) @ turn_x(a) for a, b, c in zip(x, y, z, strict=True)]
    expected, _ = smpl_forward(arrays, pose.shape_weights, turns=turns)
    assert_allclose(deform(figure, pose)[0], expected, atol=1e-13)


def test_correctives_are_added_unless_left_out():
    offsets = np.arange(9 * 4 * 3, dtype=float).reshape(9, 4, 3)
    figure = arm(correctives=Correctives(offsets))
    pose = figure_pose(figure)
    assert rest_positions(figure, figure.mesh, pose) is figure.mesh.positions
    pose.dofs[:3] = 1.0  # the root has no correctives
    assert rest_positions(figure, figure.mesh, pose) is figure.mesh.positions
    pose.dofs[5] = np.pi  # Rz(180) - I is diag(-2, -2, 0): rows 0 and 4
    expected = np.array(POSITIONS) - 2.0 * offsets[0] - 2.0 * offsets[4]
    assert_allclose(rest_positions(figure, figure.mesh, pose), expected, atol=1e-13)
    assert rest_positions(figure, figure.mesh, pose, correct=False) is figure.mesh.positions


def test_different_rest_mesh_moves_the_joints_by_the_regressor():
    figure = arm()
    changed = with_rest_mesh(figure, 2.0 * np.array(POSITIONS))
    assert rest_joints(changed).tolist() == [[0, 0, 0], [8, 0, 0]]
    assert_allclose(deform(changed, rest_pose(changed.skeleton))[0], changed.mesh.positions)


class Owner:
    """An object that supports weak references."""


def test_memo_caches_a_few_results_per_owner():
    memo, owner, made = Memo(kept=2), Owner(), []

    def make(value):
        return lambda: made.append(value) or value

    assert [memo.get(owner, key, make(key)) for key in "aabab"] == list("aabab")
    assert made == ["a", "b"]
    memo.get(owner, "c", make("c"))  # the oldest, a, is evicted
    memo.get(owner, "b", make("b"))
    memo.get(owner, "a", make("a again"))
    assert made == ["a", "b", "c", "a again"]
    memo.get(Owner(), "a", make("other"))
    assert made[-1] == "other"


def test_shaped_figures_are_freed_with_their_figure():
    figure = arm()
    gone = weakref.ref(shaped(figure, np.array([1.0, 0.0])))
    assert gone() is not None
    del figure
    gc.collect()
    assert gone() is None


def test_failed_results_are_not_cached():
    memo, owner = Memo(), Owner()
    with pytest.raises(ZeroDivisionError):
        memo.get(owner, 1, lambda: 1 // 0)
    assert memo.get(owner, 1, lambda: 5) == 5


def test_skeletons_follow_the_shape_only_with_a_joint_regressor():
    figure, weights = arm(), np.array([1.0, 0.5])
    moved = shaped_skeleton(figure, weights)
    # The shape moves one of the second joint's two vertices by 2 along x, and all of them along y.
    assert_allclose(moved.rest_translations, [[0, 0.5, 0], [5, 0, 0]], atol=1e-12)
    free = arm(joint_regressor=None)
    assert shaped_skeleton(free, weights) is free.skeleton
    with pytest.raises(RigError):
        shaped_skeleton(arm(skeleton=None, skin=None, joint_regressor=None), weights)
