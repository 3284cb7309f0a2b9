"""Timeline tracks: minimum bar width, ruler labels and track colours."""

import numpy as np
import pytest
from app.captured import people, walk

from viewer.app.playback.tracks import bars, present_spans, ruler_text_place
from viewer.rig.srgb import decode_color, encode_color


@pytest.mark.parametrize(
    ("places", "drawn"),
    [
        ([0, 9], [(0, 9)]),
        ([10, 10], [(10, 15)]),  # the minimum width
        ([40, 40], [(35, 40)]),  # at the end of the track the bar grows to the left
        ([20, 20, 22, 30], [(16, 21), (22, 30)]),  # one point remains free before the next bar
        ([0, 18, 20, 20, 22, 30], [(0, 18), (19, 21), (22, 30)]),  # between other bars
        ([], []),
    ],
)
def test_bars_are_never_too_narrow(places, drawn):
    assert bars(places, 5, 40) == drawn


def test_single_frame_is_a_span_of_zero_length():
    present = [False, True, False, False, True, True]
    assert present_spans(walk(present, 1), 0.01) == [(0.1, 0.1), (0.4, 0.5)]


@pytest.mark.parametrize(
    ("x", "begin"),
    [(0.0, 3.0), (77.0, 80.0), (77.5, 54.5), (100.0, 77.0)],
)
def test_ruler_labels_stay_within_the_ruler(x, begin):
    assert ruler_text_place(x, 20.0, 100.0) == begin


def test_last_ruler_label_is_not_cut_off(drive, rig):
    scene = people(rig, np.ones(121, dtype=bool))
    hand = drive(scene=scene, size=(1280, 800), samples=1, pixels_per_point=1.0)
    _, y0, x1, _ = hand.state.item_rects["Scrubber"]
    picture = hand.screen()[round(y0) : round(y0) + 14].astype(int).sum(axis=2)
    # The digits are the brightest pixels there; those of the last number are left of the end.
    letters = np.flatnonzero((picture > 380).any(axis=0))
    last = letters[letters > x1 - 45]
    assert len(last) > 10 and last.max() < x1 - 1


def test_srgb_round_trip():
    color = (0.001, 0.2, 0.9)
    # In IEC 61966-2-1, dark values are 12.92 times the linear value; 0.2 is 0.4845 by its formula.
    assert encode_color(color)[:2] == pytest.approx((0.01292, 0.484529), abs=1e-6)
    assert decode_color(encode_color(color)) == pytest.approx(color, abs=1e-12)


def _row(hand, index):
    """The pixels of an actor's track, a line through its middle."""
    x0, _, x1, _ = hand.state.item_rects["Scrubber"]
    _, y0, _, y1 = hand.state.item_rects[f"track {index}"]
    return hand.screen()[round((y0 + y1) / 2), round(x0) : round(x1)].astype(int)


def test_single_frame_is_visible_and_tracks_have_the_colour_of_their_actor(drive, rig):
    lone = np.zeros(2000, dtype=bool)
    lone[1000] = True
    scene = people(rig, np.ones(2000, dtype=bool), lone)
    scene.actors[0].color = decode_color((0.2, 0.8, 0.4))
    scene.actors[1].color = decode_color((0.9, 0.1, 0.1))
    hand = drive(scene=scene, size=(1280, 800), samples=1, pixels_per_point=1.0)
    first = _row(hand, 0)
    # The middle of the bar, where neither ruler nor current time are drawn.
    assert np.abs(first - [51, 204, 102]).max(axis=1).min() <= 2
    second = _row(hand, 1)
    red = np.flatnonzero((second[:, 0] > 120) & (second[:, 1] < 70))
    assert 4 <= len(red) <= 10
    assert abs(red.mean() - 1000 / 1999 * len(second)) < 8
