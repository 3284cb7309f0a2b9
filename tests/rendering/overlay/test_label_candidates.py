"""Label candidates, for which batched results are compared with point-by-point checks."""

import numpy as np
import pytest

from viewer.rendering.overlay.labels import (
    Cells,
    Dots,
    clear_places,
    crowded,
    crowded_lines,
    label_places,
    line_pixels,
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


@pytest.fixture(params=[60, 300, 1500], scope="module")
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
    clear, beside = room
    found = crowded(places, points, dots, GAP)
    is_near = clear < 1.5 * np.where(places.has_line, GAP, places.own)
    assert not (found & ~is_near).any()
    pixels, are_part = line_pixels(places, GAP)
    lines = crowded_lines(places, pixels, are_part, dots, GAP)
    assert not (lines & (beside >= 0.75 * GAP)).any()
    if len(points) > 1000:
        assert found.mean() > 0.9 and lines[places.has_line].mean() > 0.9


def test_cells_larger_than_the_space_next_to_a_line_are_inconclusive(scene):
    points, places, _ = scene
    pixels, are_part = line_pixels(places, GAP)
    dots = Dots(Cells(PICTURE, 5), points)
    assert not crowded_lines(places, pixels, are_part, dots, GAP).any()
