"""Label cells: the contents of rectangles, compared with brute force."""

import numpy as np
import pytest

from viewer.rendering.overlay.labels import Cells, Dots, spread, summed, sums_within


def test_cells_are_numbered_from_one_with_a_border_for_outside_points():
    cells = Cells((10, 7), 4)  # 3 columns, 2 rows
    assert cells.shape == (4, 5)
    points = np.array([(0.0, 0.0), (3.9, 4.0), (9.0, 6.9), (-0.1, 99.0), (12.0, 3.0)])
    assert cells.of(points).tolist() == [[1, 1], [1, 2], [3, 2], [0, 3], [4, 1]]


def test_cells_within_and_touching_a_rectangle_are_found():
    cells = Cells((40, 40), 4)
    low, high = np.array([[3.0, 4.0]]), np.array([[12.0, 11.9]])
    first, after = cells.within(low, high)
    # Columns from 4 to 12 are cells 2 and 3, rows from 4 to 8 are cell 2.
    assert first.tolist() == [[2, 2]] and after.tolist() == [[4, 3]]
    first, after = cells.touching(low, high)
    assert first.tolist() == [[1, 2]] and after.tolist() == [[5, 4]]


def test_rectangle_smaller_than_a_cell_contains_none():
    first, after = Cells((40, 40), 4).within(np.array([[5.0, 1.0]]), np.array([[7.0, 39.0]]))
    assert first[0, 0] == after[0, 0]


def test_rectangle_sums_match_direct_sums():
    table = np.random.default_rng(0).integers(0, 9, (5, 7)).astype(np.int32)
    found = sums_within(summed(table), np.array([[1, 2], [0, 0]]), np.array([[4, 4], [7, 5]]))
    assert found.tolist() == [table[2:4, 1:4].sum(), table.sum()]


def test_ranges_are_concatenated():
    owners, numbers = spread(np.array([5, 0, 9]), np.array([2, 0, 3]))
    assert owners.tolist() == [0, 0, 2, 2, 2] and numbers.tolist() == [5, 6, 9, 10, 11]


@pytest.fixture(params=[40, 6000], ids=["few", "instance"])
def scene(request):
    """Return distinct dots on a grid of quarter pixels, and rectangles."""
    rng = np.random.default_rng(1)
    points = np.unique(rng.integers(-20, 420, (request.param, 2)), axis=0) / 4.0
    low = rng.uniform(-10, 100, (50, 2))
    return points, low, low + rng.uniform(0, 40, (50, 2))


def within(points, low, high):
    return ((points >= low[:, None]) & (points <= high[:, None])).all(axis=2)


def test_counts_within_rectangles_are_bounded(scene):
    points, low, high = scene
    dots = Dots(Cells((100, 90), 4), points)
    counts = within(points, low, high).sum(axis=1)
    fewest, most = dots.fewest_within(low, high), dots.most_within(low, high)
    assert (fewest <= counts).all() and (counts <= most).all()
    # The upper bound includes two more cells on either side.
    wider = within(points, low - 8.0, high + 8.0).sum(axis=1)
    is_inside = (low >= 8.0).all(axis=1) & (high <= (92.0, 82.0)).all(axis=1)
    assert is_inside.any() and (most <= wider)[is_inside].all()


def test_every_dot_in_a_rectangle_is_listed_once(scene):
    points, low, high = scene
    dots = Dots(Cells((100, 90), 4), points)
    assert dots.n_layers == (3 if len(points) > 1000 else 1)
    seen = []
    for layer in range(dots.n_layers):
        for owners, found in dots.pairs(low, high, layer):
            seen += zip(owners.tolist(), map(tuple, found.tolist()), strict=True)
    assert len(seen) == len(set(seen))
    rows, columns = np.nonzero(within(points, low, high))
    wanted = zip(rows.tolist(), map(tuple, points[columns].tolist()), strict=True)
    assert set(wanted) <= set(seen)


def test_dots_within_a_quarter_of_a_pixel_count_once():
    points = np.array([(10.0, 10.0), (10.0, 10.0), (10.2, 10.1), (10.3, 10.1)])
    dots = Dots(Cells((40, 40), 4), points)
    assert dots.count_at(np.array([[10, 10], [20, 10]])).tolist() == [2, 0]


def test_cells_without_dots_are_empty():
    dots = Dots(Cells((40, 40), 4), np.zeros((0, 2)))
    low, high = np.zeros((1, 2)), np.full((1, 2), 40.0)
    assert dots.fewest_within(low, high) == dots.most_within(low, high) == 0
    assert sum(len(owners) for owners, _ in dots.pairs(low, high, 0)) == 0
