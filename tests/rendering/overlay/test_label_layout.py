"""Layout of labels next to their points, without overlap or ambiguity."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viewer.rendering.overlay.labels import lay_out

PICTURE = (100, 60)


def placed(anchors, sizes, order=None, gap=4.0):
    """Return the placed labels: index to upper left corner."""
    order = np.arange(len(anchors)) if order is None else np.array(order)
    layout = lay_out(np.array(anchors, float), order, np.array(sizes), PICTURE, gap)
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
    layout = lay_out(same, np.arange(5), sizes, PICTURE, 4.0)
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
    layout = lay_out(row, np.array([1, 0, 2]), np.full((3, 2), [30, 10]), PICTURE, 4.0)
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


@pytest.mark.parametrize(("n_across", "step"), [(16, 4.0), (50, 4.0), (50, 1.0), (50, 0.1)])
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
    layout = lay_out(anchors, np.arange(len(rows)), sizes, PICTURE, 3.0)
    cover = np.zeros(PICTURE[::-1], dtype=int)
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
