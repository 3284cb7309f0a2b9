"""Label candidates, for which batched results are compared with point-by-point checks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viewer.rendering.overlay.labels import (
    Cells,
    Dots,
    clear_places,
    crowded,
    label_places,
    lay_out,
    line_pixels,
    spread,
    summed,
    sums_within,
)

PICTURE, GAP = (300, 200), 8.0


def test_label_in_the_middle_has_eight_positions_at_three_distances():
    places = label_places(np.array([(150.0, 100.0)]), np.array([(30, 10)]), PICTURE, GAP)
    assert places.ranks.tolist() == list(range(24))
    assert places.has_line.tolist() == [False] * 8 + [True] * 16
    # The positions are right, left, above and below, and the same at three times the distance.
    rows = [0, 1, 6, 7, 8, 9, 14, 15]
    assert places.low[rows].tolist() == [
        [158, 95], [112, 95], [135, 82], [135, 108],
        [174, 95], [96, 95], [135, 66], [135, 124],
    ]  # fmt: skip
    np.testing.assert_array_equal(places.own[rows], [8.0] * 4 + [24.0] * 4)


def test_positions_outside_the_image_are_excluded():
    places = label_places(np.array([(4.0, 100.0)]), np.array([(30, 10)]), PICTURE, GAP)
    assert (places.low[:, 0] >= 0).all() and 1 not in places.ranks
    # There is room above the point, because the label may be shifted sideways.
    assert places.low[places.ranks == 6].tolist() == [[0, 82]]


def test_leader_line_starts_half_a_margin_from_the_point_and_ends_a_pixel_before_the_label():
    places = label_places(np.array([(150.0, 100.0)]), np.array([(30, 10)]), PICTURE, GAP)
    pixels, are_part = line_pixels(places, GAP)
    assert not are_part[:8].any()
    assert pixels[8, are_part[8]].tolist() == [[x, 100] for x in range(154, 173)]


@pytest.fixture(params=[60, 300, 1050], scope="module")
def scene(request):
    """Return points at least a quarter of a pixel apart, label candidates, and dots."""
    rng = np.random.default_rng(2)
    points = np.unique(rng.integers(0, 4 * np.array(PICTURE), (request.param, 2)), axis=0) / 4.0
    sizes = rng.integers(2, 30, (len(points), 2)).astype(np.int32)
    places = label_places(points, sizes, PICTURE, GAP)
    return points, places, Dots(Cells(PICTURE, 4), points)


@pytest.fixture(scope="module")
def room(scene):
    """Return the distances of the scene's candidates and their lines to other points."""
    points, places, _ = scene
    return by_hand(points, places)


def by_hand(points, places):
    """Return the distances of candidates and their lines to distinct points, (M,)."""
    clear, beside = np.full((2, len(places.labels)), np.inf)
    for label in np.unique(places.labels):
        rows = np.flatnonzero(places.labels == label)
        anchor = places.anchors[rows[0]]
        others = points[np.abs(points - anchor).max(axis=1) >= 1.0]
        nearest = np.clip(others, places.low[rows, None], places.high[rows, None])
        clear[rows] = shortest(others - nearest)
        rows = rows[places.has_line[rows]]
        along = places.ends[rows] - anchor
        fractions = (along @ (others - anchor).T) / places.own[rows, None] ** 2
        on_line = anchor + np.clip(fractions, 0, 1)[..., None] * along[:, None]
        beside[rows] = shortest(others - on_line)
    return clear, beside


def shortest(vectors):
    """Return the length of the shortest vector in each row, (M,); ``vectors``: (M, N, 2)."""
    return np.sqrt((vectors[..., 0] ** 2 + vectors[..., 1] ** 2).min(axis=1))


def test_positions_are_sorted_by_distance_from_other_points(scene, room):
    points, places, dots = scene
    clear, beside = room
    least = 1.5 * np.where(places.has_line, GAP, places.own)
    fits = (clear >= least) & (beside >= 0.75 * GAP)
    manner = np.where(places.has_line, 2, np.where(clear >= 3.0 * places.own, 0, 1))
    wanted = sorted(zip(places.labels[fits], manner[fits], places.ranks[fits], strict=True))
    found = clear_places(places, dots, GAP)
    assert list(zip(found.labels, found.ranks, strict=True)) == [
        (label, rank) for label, _, rank in wanted
    ]
    assert len(wanted) > 0 or len(points) > 1000


def test_crowding_test_has_no_false_positives_and_few_misses(scene, room):
    points, places, dots = scene
    clear, _ = room
    found = crowded(places, points, dots, GAP)
    is_near = clear < 1.5 * np.where(places.has_line, GAP, places.own)
    assert not (found & ~is_near).any()
    if len(points) > 1000:
        assert found.mean() > 0.9


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
def dotted(request):
    """Return distinct dots on a grid of quarter pixels, and rectangles."""
    rng = np.random.default_rng(1)
    points = np.unique(rng.integers(-20, 420, (request.param, 2)), axis=0) / 4.0
    low = rng.uniform(-10, 100, (50, 2))
    return points, low, low + rng.uniform(0, 40, (50, 2))


def within(points, low, high):
    return ((points >= low[:, None]) & (points <= high[:, None])).all(axis=2)


def test_counts_within_rectangles_are_bounded(dotted):
    points, low, high = dotted
    dots = Dots(Cells((100, 90), 4), points)
    counts = within(points, low, high).sum(axis=1)
    fewest, most = dots.fewest_within(low, high), dots.most_within(low, high)
    assert (fewest <= counts).all() and (counts <= most).all()
    # The upper bound includes two more cells on either side.
    wider = within(points, low - 8.0, high + 8.0).sum(axis=1)
    is_inside = (low >= 8.0).all(axis=1) & (high <= (92.0, 82.0)).all(axis=1)
    assert is_inside.any() and (most <= wider)[is_inside].all()


def test_every_dot_in_a_rectangle_is_listed_once(dotted):
    points, low, high = dotted
    dots = Dots(Cells((100, 90), 4), points)
    seen = []
    for owners, found in dots.pairs(low, high):
        seen += zip(owners.tolist(), map(tuple, found.tolist()), strict=True)
    assert len(seen) == len(set(seen))
    rows, columns = np.nonzero(within(points, low, high))
    wanted = zip(rows.tolist(), map(tuple, points[columns].tolist()), strict=True)
    assert set(wanted) <= set(seen)


def test_dots_within_a_quarter_of_a_pixel_count_once():
    points = np.array([(10.0, 10.0), (10.0, 10.0), (10.2, 10.1), (10.3, 10.1)])
    dots = Dots(Cells((40, 40), 4), points)
    ((owners, found),) = dots.pairs(np.array([(9.0, 9.0)]), np.array([(11.0, 11.0)]))
    assert owners.tolist() == [0, 0] and sorted(found[:, 0].tolist()) == [10.0, 10.3]


def test_cells_without_dots_are_empty():
    dots = Dots(Cells((40, 40), 4), np.zeros((0, 2)))
    low, high = np.zeros((1, 2)), np.full((1, 2), 40.0)
    assert dots.fewest_within(low, high) == dots.most_within(low, high) == 0
    assert sum(len(owners) for owners, _ in dots.pairs(low, high)) == 0


SMALL_PICTURE = (100, 60)


def placed(anchors, sizes, order=None, gap=4.0):
    """Return the placed labels: index to upper left corner."""
    order = np.arange(len(anchors)) if order is None else np.array(order)
    layout = lay_out(np.array(anchors, float), order, np.array(sizes), SMALL_PICTURE, gap)
    return dict(zip(layout.chosen.tolist(), map(tuple, layout.corners.tolist()), strict=True))


def test_label_is_placed_right_of_its_point():
    assert placed([(20.0, 30.0)], [(30, 10)]) == {0: (24, 25)}


def test_label_at_the_right_edge_is_placed_left_of_its_point():
    assert placed([(80.0, 30.0)], [(30, 10)]) == {0: (46, 25)}


def test_label_is_within_the_picture_vertically():
    assert placed([(20.0, 2.0)], [(30, 10)]) == {0: (24, 0)}
    assert placed([(20.0, 59.0)], [(30, 10)]) == {0: (24, 50)}


def test_labels_of_one_point_are_right_and_left_and_with_lines_above_and_below():
    same, sizes = np.full((5, 2), [50.0, 30.0]), np.full((5, 2), [30, 10])
    layout = lay_out(same, np.arange(5), sizes, SMALL_PICTURE, 4.0)
    # The other labels are three gaps above and below; the oblique positions are behind the first
    # two.
    assert layout.corners.tolist() == [[54, 25], [16, 25], [35, 8], [35, 42]]
    assert layout.has_line.tolist() == [False, False, True, True]
    assert layout.ends.tolist() == [[54.0, 30.0], [46.0, 30.0], [50.0, 18.0], [50.0, 42.0]]


def test_first_label_has_priority():
    same = [(50.0, 30.0)] * 3
    assert placed(same, [(30, 10)] * 3, order=[2, 0, 1]) == {2: (54, 25), 0: (16, 25), 1: (35, 8)}


def test_half_a_margin_remains_free_next_to_a_label():
    # The first label ends at column 64, so there is no room right of the second point.
    assert placed([(40.0, 30.0), (90.0, 30.0)], [(20, 10)] * 2) == {0: (44, 25), 1: (66, 25)}
    # With one column less, the label is up and to the left, by 4 sqrt(1/2) in both directions.
    assert placed([(40.0, 30.0), (89.0, 30.0)], [(20, 10)] * 2) == {0: (44, 25), 1: (66, 17)}


def test_label_does_not_cover_another_point():
    assert placed([(50.0, 30.0), (60.0, 30.0)], [(30, 10)] * 2) == {0: (16, 25), 1: (64, 25)}


def test_free_position_is_preferred_to_one_near_another_point():
    # The right position ends 7 pixels before the other point, less than three distances of 4.
    assert placed([(50.0, 30.0), (91.0, 30.0)], [(30, 10)] * 2)[0] == (16, 25)
    assert placed([(50.0, 30.0), (97.0, 30.0)], [(30, 10)] * 2)[0] == (54, 25)
    # There is no room left of the point, and more room above it than to its right.
    assert placed([(20.0, 30.0), (61.0, 30.0)], [(30, 10)] * 2)[0] == (5, 16)


def test_crowded_point_gets_a_leader_line():
    row = np.array([(38.0, 30.0), (50.0, 30.0), (62.0, 30.0)])
    layout = lay_out(row, np.array([1, 0, 2]), np.full((3, 2), [30, 10]), SMALL_PICTURE, 4.0)
    # All positions 4 pixels away are closer than 6 to another point.
    assert layout.chosen[0] == 1 and layout.has_line[0]
    left, top = layout.corners[0]
    for x, y in row[[0, 2]]:
        away = max(left - x, x - left - 30, 0.0), max(top - y, y - top - 10, 0.0)
        assert np.hypot(*away) >= 6.0


WIDE = (1920, 1080)


def instances(n_across, step):
    """Return a square of points."""
    steps = np.arange(n_across) * step
    return np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) + 300.0


def drawn(anchors, size=(60, 14), gap=7.0):
    """Return the indices of the labels that are drawn in a large image."""
    order = np.arange(len(anchors), dtype=np.int32)
    return lay_out(anchors, order, np.tile(size, (len(anchors), 1)), WIDE, gap).chosen


LONELY = np.array([(1000.0, 200.0), (1000.0, 500.0), (1400.0, 300.0), (1500.0, 800.0),
                   (900.0, 900.0)])  # fmt: skip


@pytest.mark.parametrize(("n_across", "step"), [(16, 4.0), (50, 4.0), (24, 1.0), (24, 0.1)])
def test_isolated_points_are_labelled_regardless_of_order(n_across, step):
    near = instances(n_across, step)
    found = drawn(np.concatenate([near, LONELY]))
    assert set(range(len(near), len(near) + 5)) <= set(found.tolist())


def test_labels_at_one_point_leave_room_for_a_neighbour():
    # Four of 2,000 labels at one position fit.
    anchors = np.concatenate([np.full((2000, 2), 300.0), LONELY[:1]])
    found = drawn(anchors)
    assert len(found) == 5 and found[-1] == 2000


def test_all_points_with_space_around_them_are_labelled():
    # With 96 x 54 cells of 20 x 20 pixels and labels of 6 x 6, there is always room to the right.
    grid = np.stack(np.meshgrid(np.arange(96), np.arange(54)), axis=-1).reshape(-1, 2)
    assert len(drawn(grid * 20.0 + 5.0, (6, 6), 3.0)) == 96 * 54


def test_label_wider_than_the_picture_is_left_out():
    assert placed([(50.0, 30.0)], [(120, 10)]) == {}
    assert placed([(50.0, 30.0)], [(10, 70)]) == {}


@given(
    st.lists(
        st.tuples(st.integers(0, 396), st.integers(0, 236), st.integers(1, 40), st.integers(1, 20)),
        max_size=30,
    )
)
def test_labels_do_not_overlap_and_are_unambiguous(rows):
    # Points within a quarter of a pixel count as one.
    anchors = np.array([row[:2] for row in rows], dtype=float).reshape(-1, 2) / 4.0
    sizes = np.array([row[2:] for row in rows], dtype=np.int32).reshape(-1, 2)
    layout = lay_out(anchors, np.arange(len(rows)), sizes, SMALL_PICTURE, 3.0)
    cover = np.zeros(SMALL_PICTURE[::-1], dtype=int)
    for index, (left, top), leads in zip(
        layout.chosen, layout.corners, layout.has_line, strict=True
    ):
        width, height = sizes[index]
        assert left >= 0 and left + width <= 100 and top >= 0 and top + height <= 60
        cover[top : top + height, left : left + width] += 1
        nearest = np.clip(anchors, (left, top), (left + width, top + height))
        away = np.linalg.norm(nearest - anchors, axis=1)
        others = np.abs(anchors - anchors[index]).max(axis=1) >= 1.0
        own = 3.0 if leads else away[index]
        assert (away[others] >= 1.5 * own - 1e-9).all()
    assert cover.max(initial=0) <= 1
