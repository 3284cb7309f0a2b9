"""Weight quantities of a few vertices, each value calculated by hand."""

import math

import numpy as np
import pytest
from rig.hand_made import mesh, skeleton

from viewer.rig.figure import Figure
from viewer.rig.scalars import compute
from viewer.rig.skin import skin_from_lists
from viewer.rig.skinning import Skinning

ROWS = [
    [(0, 0.5), (1, 0.25), (2, 0.25)],
    [(2, 1.0)],
    [],
    [(0, 0.0)],
    [(1, 0.3), (0, 0.4), (1, 0.3)],  # joint 1 is listed twice with a sum of 0.6
    [(0, 1.5), (1, -0.5)],
    [(3, 0.5)],
]


def found(name, rows=ROWS, **how):
    count = len(rows)
    bones = skeleton([-1, 0, 1, 2])
    skin = skin_from_lists(rows, np.tile(np.eye(4), (4, 1, 1)))
    figure = Figure("rows", mesh(np.zeros((count, 3))), bones, skin)
    return compute(name, figure, None, Skinning(**how)).tolist()


def test_weight_of_a_joint_is_the_sum_of_its_entries():
    assert found("weight:j0") == [0.5, 0, 0, 0, 0.4, 1.5, 0]
    assert found("weight:j1") == [0.25, 0, 0, 0, 0.6, -0.5, 0]
    assert found("weight:#3") == [0, 0, 0, 0, 0, 0, 0.5]


def test_weights_follow_the_skinning_settings():
    # With two influences, 0.5 and 0.25 are scaled to a sum of 1; of equal weights the first is
    # kept.
    assert found("weight:j0", max_influences=2)[0] == pytest.approx(2 / 3)
    assert found("weight:j1", max_influences=2)[0] == pytest.approx(1 / 3)
    assert found("weight:j2", max_influences=2)[0] == 0.0
    assert found("weight:j3", normalize=True)[6] == 1.0


def test_dominant_joint_has_the_largest_weight_of_all_its_entries():
    assert found("dominant") == [0, 2, -1, -1, 1, 0, 3]


def test_dominant_joint_of_a_tie_is_the_first():
    assert found("dominant", [[(2, 0.5), (1, 0.5)]]) == [2]


def test_influences_are_counted_as_joints_with_a_weight():
    assert found("influences") == [3, 1, 0, 0, 2, 2, 1]
    assert found("influences", max_influences=2) == [2, 1, 0, 0, 2, 2, 1]


def test_sums_are_compared_with_one():
    assert found("sums") == [0, 0, 1, 1, 0, 0, 0.5]
    assert found("sums", normalize=True) == [0, 0, 1, 1, 0, 0, 0]


def test_sums_that_differ_from_one_only_by_rounding_are_one():
    tenths = [[(0, 0.1)] * 10]
    total = 0.0
    for _, weight in tenths[0]:
        total += weight
    assert total != 1.0
    assert found("sums", tenths) == [0.0]
    assert found("sums", [[(0, 1.0 + 1e-9)]])[0] == pytest.approx(1e-9, rel=1e-6)


def test_entropy_of_equal_weights_is_the_logarithm_of_their_number():
    rows = [[(0, 1.0)], [(0, 0.5), (1, 0.5)], [(0, 0.2), (1, 0.2), (2, 0.2), (3, 0.2)], []]
    np.testing.assert_allclose(found("entropy", rows), [0, 1, 2, 0], atol=1e-15)


def test_entropy_matches_hand_calculation():
    # 1/2 * 1 + 1/4 * 2 + 1/4 * 2 bits; then the entropies of 0.4 and 0.6, and of 3/4 and 1/4.
    binary = -0.4 * math.log2(0.4) - 0.6 * math.log2(0.6)
    quarter = -0.75 * math.log2(0.75) + 0.25 * 2
    np.testing.assert_allclose(found("entropy"), [1.5, 0, 0, 0, binary, quarter, 0], atol=1e-15)


def test_figure_without_triangles_or_weights_has_finite_values():
    for name in ("weight:j1", "influences", "entropy"):
        assert found(name, [[], []]) == [0, 0]
    assert found("dominant", [[], []]) == [-1, -1]
