"""Morph targets, which are stored and summed for the moved vertices only."""

import numpy as np
from numpy.testing import assert_array_equal

from viewer.formats._scene_graph.content import MorphTargets

UP = np.array([[0, 0, 0], [0, 1, 0], [0, 0, 0], [0, 2, 0]], dtype=np.float32)
ASIDE = np.array([[1, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0, 0]], dtype=np.float32)


def test_only_moved_vertices_are_stored() -> None:
    targets = MorphTargets(4, [UP, None, ASIDE])
    vertices, offsets = targets.moved(0)
    assert_array_equal(vertices, [1, 3])
    assert_array_equal(offsets, [[0, 1, 0], [0, 2, 0]])
    assert len(targets) == 3 and len(targets.moved(1)[0]) == 0


def test_weighted_sum_matches_the_dense_array() -> None:
    targets = MorphTargets(4, [UP, None, ASIDE])
    expected = [[-3, 0, 0], [-3, 0.5, 0], [-3, 0, 0], [-3, 1, 0]]
    assert_array_equal(targets.weighted(np.array([0.5, 7.0, -3.0])), expected)
    assert_array_equal(targets.dense(), [UP, np.zeros((4, 3)), ASIDE])


def test_rows_select_vertices_of_the_file() -> None:
    targets = MorphTargets(2, [UP, ASIDE], rows=np.array([3, 0]))
    assert_array_equal(targets.dense(), [UP[[3, 0]], ASIDE[[3, 0]]])
