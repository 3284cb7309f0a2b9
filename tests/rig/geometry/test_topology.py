"""Connected components and orientation, compared with simple graph traversals."""

import numpy as np
import pytest

from viewer.rig.geometry.topology import components, edges_of, orientations, welded


def walked(count: int, pairs: np.ndarray) -> list[int]:
    """Return the smallest member of each node's component by graph traversal."""
    beside: list[list[int]] = [[] for _ in range(count)]
    for a, b in pairs.tolist():
        beside[a].append(b)
        beside[b].append(a)
    labels = [-1] * count
    for start in range(count):
        stack = [start] if labels[start] < 0 else []
        while stack:
            node = stack.pop()
            if labels[node] < 0:
                labels[node] = start
                stack += beside[node]
    return labels


@pytest.mark.parametrize("seed", range(5))
def test_components_match_a_graph_traversal(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pairs = rng.integers(0, 200, (rng.integers(1, 250), 2))
    assert components(200, pairs).tolist() == walked(200, pairs)


def test_long_chain_is_one_component() -> None:
    order = np.random.default_rng(0).permutation(50_000)
    pairs = np.stack([order[:-1], order[1:]], axis=1)
    assert (components(50_000, pairs) == 0).all()


def test_nodes_without_pairs_are_separate_components() -> None:
    assert components(3, np.zeros((0, 2), np.int64)).tolist() == [0, 1, 2]


def test_welding_maps_equal_positions_to_the_first_one() -> None:
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 0], [1, 0, 1e-12], [1, 0, 0]])
    corners = welded(positions, np.array([[2, 4, 3], [0, 1, 2]], dtype=np.int32))
    assert corners.tolist() == [[0, 1, 3], [0, 1, 0]]


@pytest.mark.parametrize("seed", range(3))
def test_flipped_triangles_of_a_grid_are_found(seed: int) -> None:
    grid = np.arange(20 * 20).reshape(20, 20)
    a, b, c, d = (
        part.ravel() for part in (grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:])
    )
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    flipped = np.random.default_rng(seed).random(len(triangles)) < 0.3
    triangles[flipped] = triangles[flipped][:, ::-1]
    component, found, one_sided = orientations(len(triangles), edges_of(triangles))
    assert (component == 0).all() and not one_sided.any()
    assert np.array_equal(found, flipped)


def test_ties_are_resolved_in_favour_of_the_first_triangle() -> None:
    triangles = np.array([[0, 1, 2], [0, 1, 3]])  # both run from 0 to 1
    assert orientations(2, edges_of(triangles))[1].tolist() == [False, True]


def test_triangles_of_each_edge_are_counted() -> None:
    two = edges_of(np.array([[0, 1, 2], [1, 0, 3]]))
    assert two.counts.tolist() == [2, 1, 1, 2, 1, 1] and two.pairs.tolist() == [[0, 1]]
    three = edges_of(np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]]))
    assert three.counts.tolist() == [3, 1, 1, 3, 1, 1, 3, 1, 1] and len(three.pairs) == 0
