"""Rendered annotations: segments and labels of several annotations, their order, and omissions."""

import numpy as np
import pytest
from rendering.drawn_figures import square
from rendering.front_view import PIXELS, drawn, front_view, pixel

from viewer.rendering.offscreen import Offscreen
from viewer.rendering.overlay.annotation import Annotation, Labels
from viewer.rendering.overlay.segments import SegmentStyle, dots
from viewer.rig.figure import Figure
from viewer.rig.scene import Actor, Scene

RED, GREEN = (1.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 1.0)


@pytest.fixture(scope="module")
def offscreen():
    with Offscreen() as result:
        yield result


def dot(place, color, width=12.0, words=(), on_top=True):
    points = np.array([place], dtype=float)
    count = len(words)
    labels = Labels(
        tuple(words), np.repeat(points, count, axis=0), np.arange(count), np.ones((count, 3))
    )
    segments = dots(points, np.array(color), width)
    return Annotation(segments, SegmentStyle(on_top=on_top), labels if words else None)


def picture(offscreen, *annotations, scene=None):
    offscreen.renderer.annotations = annotations
    try:
        return front_view(offscreen, scene or Scene([]))
    finally:
        offscreen.renderer.annotations = ()


def test_later_annotations_are_drawn_over_earlier_ones(offscreen):
    found = picture(offscreen, dot((0, 0, 1), RED, 20.0), dot((0, 0, -1), GREEN, 8.0))
    assert pixel(found, 0.0, 0.0) == [0, 255, 0, 255]
    assert pixel(found, 0.35, 0.0) == [255, 0, 0, 255]


def test_segments_on_top_are_visible_through_a_surface_and_others_faint(offscreen):
    scene = Scene([Actor(Figure("square", square()))])
    through = picture(offscreen, dot((0, 0, -0.5), RED), scene=scene)
    behind = picture(offscreen, dot((0, 0, -0.5), RED, on_top=False), scene=scene)
    plain = np.array(pixel(picture(offscreen, scene=scene), 0.0, 0.0)[:3])
    assert pixel(through, 0.0, 0.0) == [255, 0, 0, 255]
    assert pixel(behind, 0.0, 0.0)[:3] == pytest.approx(
        0.4 * np.array([255, 0, 0]) + 0.6 * plain, abs=2
    )


def test_labels_are_drawn_next_to_their_point(offscreen):
    alone = drawn(picture(offscreen, dot((0, 0, 0), RED)))
    named = drawn(picture(offscreen, dot((0, 0, 0), RED, words=["ab", "cd", "ef"])))
    more = named & ~alone
    half = PIXELS // 2
    # One label is on each side, and the third above them with a leader line.
    assert more[half - 6 : half + 6, :half].any() and more[half - 6 : half + 6, half:].any()
    assert more[: half - 14].any() and not more[half + 12 :].any()
    assert more[half - 12 : half - 8, half - 1 : half + 1].all()


def test_labels_of_two_annotations_are_both_drawn(offscreen):
    low, high = dot((0, -1, 0), RED, words=["ab"]), dot((0, 1, 0), RED, words=["cd"])
    once, both = drawn(picture(offscreen, low)), drawn(picture(offscreen, low, high))
    np.testing.assert_array_equal(both[PIXELS // 2 :], once[PIXELS // 2 :])
    assert both[: PIXELS // 2].any()
