"""Weighted offsets: blend shapes, pose correctives, and joints regressed from the mesh."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rig.hand_made import turn_x, turn_y, turn_z

from viewer.errors import RigError
from viewer.rig.arrays import Deferred
from viewer.rig.blendshapes import (
    BlendShapes,
    Correctives,
    JointRegressor,
    active_rows,
    corrective_weights,
    regress_joints,
)

OFFSETS = np.array([[[1.0, 0, 0], [0, 2, 0]], [[0, 0, 4], [0, 0, 0]], [[0, 8, 0], [16, 0, 0]]])


def shapes(**changes):
    return BlendShapes(**{"names": ("a", "b", "c"), "offsets": OFFSETS, **changes})


def test_displacement_is_the_weighted_sum():
    # 2 (1,0,0) - 1 (0,0,4) + 0.5 (0,8,0), and 2 (0,2,0) + 0.5 (16,0,0).
    found = shapes().displacement(np.array([2.0, -1.0, 0.5]))
    assert found.tolist() == [[2, 4, -4], [8, 4, 0]]


def test_missing_weights_are_zero():
    assert shapes().displacement(np.array([3.0])).tolist() == [[3, 0, 0], [0, 6, 0]]
    assert shapes().displacement(np.zeros(0)).tolist() == [[0, 0, 0]] * 2


def test_too_many_weights_are_refused():
    with pytest.raises(RigError) as caught:
        shapes().displacement(np.zeros(4))
    assert str(caught.value) == "expected at most 3 shape weights, found 4"


def test_blend_shapes_belong_to_the_shape_group_by_default():
    assert shapes().groups == ("shape",) * 3
    assert (shapes().n_shapes, shapes().n_vertices) == (3, 2)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"names": ("a",)}, "offsets: expected shape 1 x any x 3, found 3 x 2 x 3"),
        ({"groups": ("shape",)}, "groups: expected 3, found 1"),
        ({"offsets": OFFSETS[0]}, "offsets: expected shape 3 x any x 3, found 2 x 3"),
        (
            {"offsets": Deferred((2, 2, 3), "f8", lambda: OFFSETS)},
            "offsets: expected shape (3, 2, 3), found (2, 2, 3)",
        ),
    ],
)
def test_blend_shapes_refuse_parts_that_do_not_fit(changes, message):
    with pytest.raises(RigError) as caught:
        shapes(**changes)
    assert str(caught.value) == message


def counted(values):
    """Return a deferred array and the list that grows each time it is loaded."""
    loads = []

    def load():
        loads.append(1)
        return values.copy()

    return Deferred(values.shape, values.dtype, load), loads


def test_deferred_offsets_are_read_once_and_only_for_nonzero_weights():
    deferred, loads = counted(OFFSETS)
    lazy = shapes(offsets=deferred)
    lazy.displacement(np.zeros(3))
    assert loads == []
    assert lazy.displacement(np.array([0.0, 1.0])).tolist() == [[0, 0, 4], [0, 0, 0]]
    lazy.displacement(np.array([1.0]))
    assert loads == [1]


def test_corrective_weights_are_rotation_entries_minus_the_identity():
    rotations = np.array([turn_x(0.3), turn_z(np.pi / 2), np.eye(3)])
    found = corrective_weights(rotations)
    # Rz(90) is ((0,-1,0), (1,0,0), (0,0,1)); the root has no weights.
    assert_allclose(found[:9], [-1, -1, 0, 1, -1, 0, 0, 0, 0], atol=1e-15)
    assert found[9:].tolist() == [0] * 9


def test_single_root_has_no_corrective_weights():
    assert corrective_weights(turn_x(1.0)[None]).shape == (0,)


def random_correctives(n_joints, n_vertices=7, seed=0):
    return np.random.default_rng(seed).normal(size=(9 * (n_joints - 1), n_vertices, 3))


@pytest.mark.parametrize(
    "turned", [(), (1,), (5,), (1, 2), (2, 4), (1, 5), (1, 2, 3, 4, 5)], ids=str
)
def test_correctives_are_the_weighted_sum_for_any_rotated_joints(turned):
    offsets = random_correctives(6)
    rotations = np.tile(np.eye(3), (6, 1, 1))
    for joint in turned:
        rotations[joint] = turn_y(0.4 * joint) @ turn_x(1.0)
    weights = corrective_weights(rotations)
    expected = sum(weight * direction for weight, direction in zip(weights, offsets, strict=True))
    assert_allclose(Correctives(offsets).displacement(weights), expected, atol=1e-13)


def test_active_rows_are_runs_of_rotated_joints():
    weights = np.zeros((5, 9))
    weights[[0, 1, 3], [8, 0, 4]] = 1.0, -2.0, 1e-300
    assert active_rows(weights.ravel()) == [slice(0, 18), slice(27, 36)]
    assert active_rows(np.zeros(45)) == []
    assert active_rows(np.ones(45)) == [slice(0, 45)]
    assert active_rows(np.zeros(0)) == []


def test_deferred_correctives_are_read_when_a_joint_rotates():
    offsets = random_correctives(3)
    deferred, loads = counted(offsets)
    lazy = Correctives(deferred)
    assert lazy.displacement(np.zeros(18)).tolist() == [[0, 0, 0]] * 7
    assert loads == []
    lazy.displacement(np.ones(18))
    assert loads == [1]
    assert np.array_equal(lazy.values(), offsets)


def test_correctives_require_nine_rows_per_joint():
    with pytest.raises(RigError) as caught:
        Correctives(np.zeros((10, 2, 3)))
    assert str(caught.value) == "offsets: expected nine for each joint except the root, found 10"


def test_sparse_regression_matches_the_dense_matrix():
    rng = np.random.default_rng(1)
    dense = rng.normal(size=(6, 20)) * (rng.random((6, 20)) < 0.3)
    dense[4] = 0.0  # a joint with an empty regressor row stays at the origin
    joints, vertices = np.nonzero(dense)
    positions = rng.normal(size=(20, 3))
    order = rng.permutation(len(joints))
    regressor = JointRegressor(6, joints[order], vertices[order], dense[joints, vertices][order])
    assert_allclose(regress_joints(regressor, positions), dense @ positions, atol=1e-14)


def test_entries_listed_twice_are_added():
    regressor = JointRegressor(1, [0, 0], [1, 1], [0.25, 0.5])
    assert regress_joints(regressor, np.array([[9.0, 9, 9], [4, 8, 0]])).tolist() == [[3, 6, 0]]


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ((2, [0, 2], [0, 0], [1.0, 1.0]), "joints: expected indices 0 to 1"),
        ((2, [0, -1], [0, 0], [1.0, 1.0]), "joints: expected indices 0 to 1"),
        ((2, [0, 1], [0, -1], [1.0, 1.0]), "vertices: expected indices from 0 on"),
        ((2, [0, 1], [0], [1.0, 1.0]), "vertices: expected shape 2, found 1"),
        ((2, [0], [0], [np.inf]), "weights: expected finite numbers, found inf at index 0"),
    ],
)
def test_regressor_refuses_indices_that_do_not_exist(parts, message):
    with pytest.raises(RigError) as caught:
        JointRegressor(*parts)
    assert str(caught.value) == message
