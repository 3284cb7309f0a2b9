import numpy as np
from scipy import sparse

from viewer.autorig.weights.weight_transfer import smooth, within

STRIP = np.array([[0, 1, 2], [2, 1, 3]])  # edges 01 02 12 13 23


def test_smoothing_adds_a_fifth_of_the_neighbour_mean():
    weights = sparse.csr_array(np.array([[1.0, 0], [0, 1], [0, 1], [0, 1]]))
    active = np.array([True, False, False, True])
    found = smooth(weights, STRIP, active, 1).toarray()
    np.testing.assert_allclose(found, [[0.8, 0.2], [0, 1], [0, 1], [0, 1]], atol=1e-12)
    found = smooth(weights, STRIP, active, 2).toarray()
    np.testing.assert_allclose(found[0], [0.64, 0.36], atol=1e-12)


def test_smoothing_reads_the_previous_iteration():
    weights = np.eye(4)
    mean = np.array([[0, 1, 1, 0], [1, 0, 1, 1], [1, 1, 0, 1], [0, 1, 1, 0]])
    step = 0.8 * np.eye(4) + 0.2 * mean / mean.sum(axis=1, keepdims=True)
    found = smooth(sparse.csr_array(weights), STRIP, np.ones(4, dtype=bool), 3).toarray()
    np.testing.assert_allclose(found, np.linalg.matrix_power(step, 3), atol=1e-12)


def test_smoothing_skips_isolated_vertices_and_drops_tiny_weights():
    weights = sparse.csr_array(np.array([[1.0, 0], [1, 0], [1, 0], [1 - 1e-8, 1e-8], [0.5, 0.5]]))
    active = np.array([True, True, False, False, True])
    found = smooth(weights, STRIP, active).toarray()
    assert found[2:].tolist() == weights.toarray()[2:].tolist()
    # The tiny weight spreads to vertex 1, where it is dropped.
    np.testing.assert_allclose(found[:2], [[1.0, 0.0], [1.0, 0.0]], atol=0.0)


def test_smoothing_keeps_sums():
    rng = np.random.default_rng(1)
    rows = rng.dirichlet([1, 1, 1], 4) * np.array([[1.0], [1], [1], [1]])
    found = smooth(sparse.csr_array(rows), STRIP, np.ones(4, dtype=bool))
    np.testing.assert_allclose(found.sum(axis=1), 1.0, atol=1e-12)


def test_within_follows_edges():
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [3, 0, 0], [0, 0, 0.1]])
    sources = np.array([True, False, False, False, False])
    assert within(positions, STRIP, sources, 0.9).tolist() == [1, 0, 0, 0, 0]
    assert within(positions, STRIP, sources, 1.0).tolist() == [1, 1, 0, 0, 0]
    assert within(positions, STRIP, sources, 1.5).tolist() == [1, 1, 1, 0, 0]
    # Vertex 4 is near but not connected by an edge.
    assert within(positions, STRIP, sources, 9.0).tolist() == [1, 1, 1, 1, 0]


def test_within_without_sources_is_empty():
    positions = np.zeros((4, 3))
    assert not within(positions, STRIP, np.zeros(4, dtype=bool), 1.0).any()
