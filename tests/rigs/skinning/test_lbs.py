import numpy as np
import pytest
from numpy.testing import assert_allclose
from rigs.hand_made import matrix, mesh, plain_skinning, skeleton, turn_x, turn_z

from viewer.errors import RigError
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import rest_pose
from viewer.rigs.skin import skin_from_lists
from viewer.rigs.skinning import METHODS, deform
from viewer.rigs.skinning.lbs import blended_matrices
from viewer.rigs.skinning.lbs import deform as lbs

RIGID = [matrix(turn_x(0.8), (1, 2, 3)), matrix(turn_z(-2.0), (-4, 0, 1)), np.eye(4)]
PALETTE = np.array(RIGID)
POINT = mesh([[1, 2, 3]], [[0.6, 0.0, 0.8]])


def skin_mesh(shape, skin, palette):
    return lbs(shape.positions, shape.normals, skin, palette)


def skinned(pairs, palette=PALETTE):
    return skin_mesh(POINT, skin_from_lists([pairs], np.tile(np.eye(4), (3, 1, 1))), palette)


def random_figure(seed, n_vertices=40, n_joints=6):
    rng = np.random.default_rng(seed)
    offsets = rng.uniform(-1, 1, (n_joints, 3))
    dofs = [(j, axis, rng.uniform(-3, 3)) for j in range(n_joints) for axis in "xyz"]
    parents = [-1] + [int(rng.integers(0, j)) for j in range(1, n_joints)]
    normals = rng.normal(size=(n_vertices, 3))
    shape = Mesh(rng.uniform(-2, 2, (n_vertices, 3)), normals, [[0, 1, 2]])
    influences = [
        [(int(rng.integers(n_joints)), rng.uniform(-0.5, 1)) for _ in range(rng.integers(0, 7))]
        for _ in range(n_vertices)
    ]
    bind = np.array([matrix(turn_x(a), (b, c, 0)) for a, b, c in rng.uniform(-3, 3, (n_joints, 3))])
    skin = skin_from_lists(influences, np.linalg.inv(bind))
    return Figure("random", shape, skeleton(parents, dofs, offsets=offsets), skin), influences


def test_bind_pose_returns_the_mesh():
    arm = skeleton([-1, 0], [(1, "z", 0.0)], offsets=[[0, 1, 0], [2, 0, 0]])
    bind = np.array([matrix(None, (0, 1, 0)), matrix(None, (2, 1, 0))])
    shape = mesh([[0, 1, 0], [1, 1, 0], [3, 1, 1]])
    weights = [[(0, 1.0)], [(0, 0.5), (1, 0.5)], [(1, 1.0)]]
    figure = Figure("arm", shape, arm, skin_from_lists(weights, np.linalg.inv(bind)))
    positions, normals = deform(figure, rest_pose(arm))
    assert_allclose(positions, shape.positions, atol=1e-15)
    assert_allclose(normals, shape.normals, atol=1e-15)


@pytest.mark.parametrize("joint", [0, 1, 2])
def test_one_influence_is_a_rigid_motion(joint):
    positions, normals = skinned([(joint, 1.0)])
    assert_allclose(positions[0], (RIGID[joint] @ [1, 2, 3, 1])[:3], atol=1e-15)
    assert_allclose(normals[0], RIGID[joint][:3, :3] @ [0.6, 0, 0.8], atol=1e-15)


def test_two_influences_result_in_the_weighted_mean():
    # The joints move by +2 and -1 along x with weights 3/4 and 1/4: 1 + 1.5 - 0.25.
    palette = np.array([matrix(None, (2, 0, 0)), matrix(None, (-1, 0, 0)), np.eye(4)])
    assert skinned([(0, 0.75), (1, 0.25)], palette)[0].tolist() == [[2.25, 2, 3]]


def test_twist_of_180_degrees_collapses_to_the_axis():
    palette = np.array([np.eye(4), matrix(np.diag([-1.0, -1.0, 1.0])), np.eye(4)])
    assert skinned([(0, 0.5), (1, 0.5)], palette)[0].tolist() == [[0, 0, 3]]


def test_weights_that_do_not_sum_to_one_are_used_as_stored():
    assert skinned([(2, 0.5)])[0].tolist() == [[0.5, 1, 1.5]]
    assert skinned([(2, 2.0)])[0].tolist() == [[2, 4, 6]]
    assert skinned([(2, -1.0)])[0].tolist() == [[-1, -2, -3]]


def test_weights_that_cancel_send_the_vertex_to_the_origin():
    positions, normals = skinned([(2, 1.0), (2, -1.0)])
    assert positions.tolist() == [[0, 0, 0]]
    assert normals.tolist() == [[0, 0, 0]]


def test_weights_of_a_joint_listed_twice_are_added():
    once, twice = skinned([(0, 0.75), (1, 0.25)]), skinned([(0, 0.5), (1, 0.25), (0, 0.25)])
    assert_allclose(twice[0], once[0], atol=1e-15)
    assert_allclose(twice[1], once[1], atol=1e-15)


@pytest.mark.parametrize("pairs", [[], [(0, 0.0)], [(0, 0.0), (1, 0.0)]])
def test_vertex_without_influence_does_not_move(pairs):
    positions, normals = skinned(pairs)
    assert positions.tolist() == [[1, 2, 3]]
    assert_allclose(normals, [[0.6, 0, 0.8]], atol=1e-15)


def test_vertices_without_influence_at_either_end_do_not_affect_the_others():
    skin = skin_from_lists([[], [(0, 1.0)], [], [], [(1, 1.0)], []], np.tile(np.eye(4), (3, 1, 1)))
    blended = blended_matrices(skin, PALETTE)
    for vertex, expected in enumerate([2, 0, 2, 2, 1, 2]):
        assert_allclose(blended[vertex], RIGID[expected][:3], atol=0)


def test_mesh_without_any_influence_does_not_move():
    skin = skin_from_lists([[]], np.tile(np.eye(4), (3, 1, 1)))
    assert skin_mesh(POINT, skin, PALETTE)[0].tolist() == [[1, 2, 3]]


def test_thousands_of_influences_are_summed():
    # Joints 0 and 1 are listed 2,500 times each with 1/4096, so both matrices have the exact sum
    # 0.6103515625.
    pairs = [(number % 2, 1 / 4096) for number in range(5000)]
    positions, _ = skinned(pairs)
    share = 2500 / 4096
    expected = share * (RIGID[0] @ [1, 2, 3, 1]) + share * (RIGID[1] @ [1, 2, 3, 1])
    # The tolerance is 5,000 rounding errors of numbers near 1e-3.
    assert_allclose(positions[0], expected[:3], atol=1e-13)


@pytest.mark.parametrize("seed", range(8))
def test_deform_matches_the_direct_sum(seed):
    figure, influences = random_figure(seed)
    from viewer.rigs.kinematics import world_matrices

    palette = world_matrices(figure.skeleton, rest_pose(figure.skeleton)) @ figure.skin.inverse_bind
    expected = plain_skinning(figure.mesh.positions, figure.mesh.normals, influences, palette)
    positions, normals = deform(figure, rest_pose(figure.skeleton))
    assert_allclose(positions, expected[0], atol=1e-12)
    assert_allclose(normals, expected[1], atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_normals_have_unit_length(seed):
    figure, _ = random_figure(seed)
    lengths = np.linalg.norm(deform(figure)[1], axis=1)
    assert_allclose(lengths, 1.0, atol=1e-15)


def test_normalising_keeps_zero_vectors():
    assert unit(np.array([[0.0, 0, 0], [0, -3, 0]])).tolist() == [[0, 0, 0], [0, -1, 0]]


def test_deform_without_skeleton_returns_the_bind_pose():
    figure = Figure("a", mesh=mesh([[1, 2, 3]], [[0, 0, 5.0]]))
    positions, normals = deform(figure)
    assert (positions.tolist(), normals.tolist()) == ([[1, 2, 3]], [[0, 0, 1]])
    positions[0] = 0  # changing the returned copy does not change the mesh
    assert figure.mesh.positions.tolist() == [[1, 2, 3]]


def test_deform_without_pose_uses_the_rest_pose():
    figure, _ = random_figure(1)
    assert np.array_equal(deform(figure)[0], deform(figure, rest_pose(figure.skeleton))[0])


def test_deform_refuses_a_figure_without_mesh_and_an_unknown_method():
    with pytest.raises(RigError) as caught:
        deform(Figure("a", skeleton=skeleton([-1])))
    assert str(caught.value) == "figure a has no mesh to deform"
    with pytest.raises(RigError) as caught:
        deform(Figure("a", mesh=POINT), method="magic")
    expected = f'method: no value "magic"; there are {len(METHODS)}: {", ".join(METHODS)}'
    assert str(caught.value) == expected
