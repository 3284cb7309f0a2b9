"""Labels beside their points: right, else left, else not at all; never over each other."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from viewer.rendering.label_layout import lay_out

PICTURE = (100, 60)


def placed(anchors, sizes, order=None, gap=4.0):
    """Return what was placed: index to left upper corner."""
    order = np.arange(len(anchors)) if order is None else np.array(order)
    layout = lay_out(np.array(anchors, float), order, np.array(sizes), PICTURE, gap)
    return dict(zip(layout.chosen.tolist(), map(tuple, layout.corners.tolist()), strict=True))


def test_label_lies_right_of_its_point():
    assert placed([(20.0, 30.0)], [(30, 10)]) == {0: (24, 25)}


def test_label_at_the_right_edge_lies_left_of_its_point():
    assert placed([(80.0, 30.0)], [(30, 10)]) == {0: (46, 25)}


def test_label_stays_within_the_picture_vertically():
    assert placed([(20.0, 2.0)], [(30, 10)]) == {0: (24, 0)}
    assert placed([(20.0, 59.0)], [(30, 10)]) == {0: (24, 50)}


def test_second_label_takes_the_other_side_and_the_third_none():
    same = [(50.0, 30.0)] * 3
    assert placed(same, [(30, 10)] * 3) == {0: (54, 25), 1: (16, 25)}


def test_first_in_order_comes_first():
    same = [(50.0, 30.0)] * 3
    assert placed(same, [(30, 10)] * 3, order=[2, 0, 1]) == {2: (54, 25), 0: (16, 25)}


def test_half_a_gap_stays_free_beside_a_label():
    # The first ends at column 24; the other would begin at 25 + 4 - 4.
    found = placed([(0.0, 30.0), (21.0, 30.0), (22.0, 30.0)], [(20, 10)] * 3)
    assert found == {0: (4, 25), 2: (26, 25)}


def test_label_wider_than_the_picture_is_left_out():
    assert placed([(50.0, 30.0)], [(120, 10)]) == {}
    assert placed([(50.0, 30.0)], [(10, 70)]) == {}


@given(
    st.lists(
        st.tuples(st.floats(0, 99), st.floats(0, 59), st.integers(1, 40), st.integers(1, 20)),
        max_size=30,
    )
)
def test_no_two_labels_overlap(rows):
    anchors = np.array([row[:2] for row in rows]).reshape(-1, 2)
    sizes = np.array([row[2:] for row in rows], dtype=np.int32).reshape(-1, 2)
    layout = lay_out(anchors, np.arange(len(rows)), sizes, PICTURE, 3.0)
    cover = np.zeros(PICTURE[::-1], dtype=int)
    for index, (left, top) in zip(layout.chosen, layout.corners, strict=True):
        width, height = sizes[index]
        assert left >= 0 and left + width <= 100 and top >= 0 and top + height <= 60
        cover[top : top + height, left : left + width] += 1
    assert cover.max(initial=0) <= 1
