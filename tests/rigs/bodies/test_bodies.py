"""Body models: phenotypes, features of the pose, and sparse offsets."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rigs.hand_made import mesh, skeleton

from viewer.errors import RigError
from viewer.rigs.blendshapes import Correctives
from viewer.rigs.bodies.offsets import SparseOffsets
from viewer.rigs.bodies.phenotypes import PHENOTYPES, target_masks, weights_of
from viewer.rigs.bodies.pose_features import QuaternionFeature
from viewer.rigs.figure import Figure
from viewer.rigs.pose import rest_pose
from viewer.rigs.shape import pose_weights, rest_positions
from viewer.rigs.skin import skin_from_lists


def values(**changed):
    return np.array([changed.get(name, 0.5) for name in PHENOTYPES])


@pytest.mark.parametrize(
    ("target", "changed", "coefficient"),
    [
        (("female", "young"), {"gender": 0.25, "age": 2 / 3}, 0.25),
        # Ages have anchors at -1/3, 0, 1/3, 2/3 and 1.
        (("child",), {"age": 0.4}, 0.8),
        (("young",), {"age": 0.4}, 0.2),
        (("newborn",), {"age": -0.3}, 0.9),
        (("old",), {"age": 7.0}, 1.0),
        (("averagemuscle", "maxweight"), {"muscle": 0.75, "weight": 0.9}, 0.4),
        (("maxheight", "idealproportions"), {"height": 0.3, "proportions": 0.2}, 0.24),
        # Origins are normalised: 0.2 / (0.2 + 0.5 + 0.3).
        (("african",), {"african": 0.2, "caucasian": 0.3}, 0.2),
        (("asian",), {"african": 0.0, "asian": 0.0, "caucasian": 0.0}, 1 / 3),
        (("mincup", "maxfirmness"), {"cupsize": 0.1, "firmness": 1.0}, 0.8),
    ],
)
def test_coefficient_is_the_product_of_variation_weights(target, changed, coefficient):
    found = weights_of(values(**changed), target_masks([target]))
    assert_allclose(found, [coefficient], atol=1e-12)


def test_target_weights_of_one_phenotype_sum_to_one():
    ages = [("newborn",), ("baby",), ("child",), ("young",), ("old",)]
    for age in np.linspace(-0.4, 1.1, 7):
        assert_allclose(weights_of(values(age=age), target_masks(ages)).sum(), 1.0, atol=1e-12)


ROUNDING = 1e-12


def chain():
    dofs = [(joint, axis, 0.0) for joint in range(3) for axis in "xyz"]
    return skeleton([-1, 0, 1], dofs)


def test_weights_are_half_angle_sines_and_cosines():
    bones = chain()
    pose = rest_pose(bones)
    pose.dofs[[0, 4, 8]] = 0.4, -1.0, 3.0  # x of the root, y and z of the others
    pose.shape_weights = np.array([9.0, 0.7])
    found = QuaternionFeature(3, has_root=False, shape=1).weights(bones, pose)
    second = [0.0, np.sin(-0.5), 0.0, np.cos(0.5) - 1.0]
    third = [0.0, 0.0, np.sin(1.5), np.cos(1.5) - 1.0]
    assert_allclose(found, [*second, *third, 0.7], atol=ROUNDING)
    root = QuaternionFeature(3, has_root=True).weights(bones, pose)
    assert_allclose(root[:4], [np.sin(0.2), 0.0, 0.0, np.cos(0.2) - 1.0], atol=ROUNDING)
    assert len(root) == QuaternionFeature(3, has_root=True).n_weights == 12


def test_rest_pose_has_zero_weights_and_missing_shapes_are_zero():
    bones = chain()
    found = QuaternionFeature(3, has_root=False, shape=1).weights(bones, rest_pose(bones))
    assert_allclose(found, np.zeros(9), atol=ROUNDING)


def test_feature_correctives_move_the_rest_mesh():
    bones = chain()
    offsets = np.zeros((9, 3, 3))
    offsets[1, 0] = 1.0, 2.0, 3.0  # sine of the second joint about y
    offsets[8, 2] = 0.0, 0.0, 5.0  # shape
    figure = Figure(
        "arm",
        mesh=mesh([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]),
        skeleton=bones,
        skin=skin_from_lists([[(0, 1.0)]] * 3, np.tile(np.eye(4), (3, 1, 1))),
        correctives=Correctives(offsets, QuaternionFeature(3, has_root=False, shape=0)),
    )
    pose = rest_pose(bones)
    pose.dofs[4], pose.shape_weights = np.pi / 3, np.array([2.0])
    assert pose_weights(figure.correctives, bones, pose).shape == (9,)
    moved = rest_positions(figure, figure.mesh, pose) - figure.mesh.positions
    assert_allclose(moved, [[0.5, 1.0, 1.5], [0, 0, 0], [0, 0, 10]], atol=ROUNDING)


def test_correctives_without_a_row_per_feature_weight_are_refused():
    with pytest.raises(RigError, match="expected shape 8 x any x 3, found 9 x 3 x 3"):
        Correctives(np.zeros((9, 3, 3)), QuaternionFeature(3, has_root=False))


ROWS, VERTICES = 200, 50


class AnyWeights:
    """A stand-in for a feature with the same number of weights."""

    n_weights = ROWS

    def weights(self, skeleton, pose):
        raise NotImplementedError


def array(density: float) -> np.ndarray:
    generator = np.random.default_rng(1)
    values = generator.normal(size=(ROWS, VERTICES, 3))
    values *= generator.random(values.shape) < density
    values[:, 7] = 0.0  # a vertex that is never moved
    values[3] = 0.0
    return values.astype(np.float32)


def sparse(values: np.ndarray, loads: list[str], count: int = 7) -> SparseOffsets:
    def load() -> np.ndarray:
        loads.append("whole")
        return values.copy()

    def blocks():
        loads.append("blocks")
        room = np.empty((count, *values.shape[1:]), values.dtype)
        for start in range(0, len(values), count):
            block = room[: len(values[start : start + count])]
            block[:] = values[start : start + count]
            yield block

    return SparseOffsets(values.shape, values.dtype, load, blocks)


@pytest.mark.parametrize(("density", "ways"), [(0.05, ["blocks"]), (0.8, ["blocks", "whole"])])
def test_sums_are_those_of_the_whole_array(density, ways):
    values, loads = array(density), []
    correctives = Correctives(sparse(values, loads), AnyWeights())
    generator = np.random.default_rng(2)
    for _ in range(3):
        weights = generator.normal(size=ROWS)
        expected = np.einsum("p,pva->va", weights, values.astype(np.float64))
        assert_allclose(correctives.displacement(weights), expected, atol=1e-12)
        few = np.array([7, 0, 31])
        assert_allclose(correctives.of_vertices(few, weights), expected[few], atol=1e-12)
    assert loads == ways
    assert_array_equal(correctives.values(), values)


def test_offsets_of_some_vertices_are_the_stored_ones():
    values = array(0.05)
    few = np.array([7, 49, 0], dtype=np.int32)
    assert_array_equal(sparse(values, []).columns(few), values[:, few].astype(np.float64))


def test_rest_pose_reads_no_data():
    loads: list[str] = []
    correctives = Correctives(sparse(array(0.05), loads), AnyWeights())
    assert not correctives.displacement(np.zeros(ROWS)).any() and loads == []


@pytest.mark.parametrize("count", [ROWS, 0])
def test_arrays_of_zeros_have_no_offsets(count):
    offsets = sparse(np.zeros((count, VERTICES, 3), np.float32), [])
    assert_array_equal(offsets.total(np.ones(count)), np.zeros((VERTICES, 3)))
    assert not offsets.columns(np.arange(3)).any()


def test_check_reads_the_file_once():
    loads: list[str] = []
    correctives = Correctives(sparse(array(0.05), loads), AnyWeights())
    correctives.check_values()
    correctives.check_values()
    assert loads == ["blocks"]
