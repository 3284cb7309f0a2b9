"""Rendered marks: position, size, depth, and clipping behind the eye."""

import math

import numpy as np
import pytest
from rendering.drawn_figures import square
from rendering.front_view import PIXELS, drawn, front_view, pixel

from viewer.rendering.camera import Camera
from viewer.rendering.offscreen import Offscreen
from viewer.rendering.options import DisplayOptions
from viewer.rendering.overlay.annotation import MARK_COLOR, Marks, mark_annotation
from viewer.rig.figure import Figure
from viewer.rig.scene import Actor, Scene

COLOR = [round(255 * channel) for channel in MARK_COLOR]
NOTHING = Scene([])


@pytest.fixture
def offscreen():
    with Offscreen() as result:
        yield result


def marked(offscreen, marks, scene=NOTHING, **options):
    offscreen.renderer.marks = marks
    return front_view(offscreen, scene, **options)


def points(*places, radius=4.0) -> Marks:
    return Marks(np.array(places, dtype=float), np.full(len(places), radius))


def test_point_is_drawn_as_a_bright_disc_with_a_dark_border(offscreen):
    picture = marked(offscreen, points((0.5, -1.0, 0.0)))
    assert pixel(picture, 0.5, -1.0) == [*COLOR, 255]
    # A unit is 20 pixels; the border is 4.5 pixels from the centre, and pixels at a distance of 8
    # are empty.
    border = pixel(picture, 0.5 + 4.5 / 20, -1.0)
    assert max(border[:3]) < 60 and border[3] == 255
    assert pixel(picture, 0.5 + 8 / 20, -1.0)[3] == 0
    # The disc has a radius of 4 and a border of 1.5 pixels.
    assert picture[..., 3].sum() / 255 == pytest.approx(math.pi * 5.5**2, rel=0.03)


def test_line_is_drawn_from_end_to_end(offscreen):
    line = Marks(lines=np.array([[[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]]))
    picture = marked(offscreen, line)
    for x in (-0.9, 0.0, 0.9):
        assert pixel(picture, x, 0.0)[3] == 255
    rows = picture[:, PIXELS // 2, 3] / 255
    assert rows.sum() == pytest.approx(2 * (1.0 + 1.5), abs=0.2)  # radius plus border
    columns = np.nonzero(drawn(picture).any(axis=0))[0]
    assert columns.min() == pytest.approx(20 - 2.5, abs=1)
    assert columns.max() == pytest.approx(60 + 2.5, abs=1)


def test_marks_behind_a_surface_are_faint_and_marks_on_it_are_not(offscreen):
    scene = Scene([Actor(Figure("square", square()))])
    alone = marked(offscreen, None, scene)
    on_it = marked(offscreen, points((0.0, 0.0, 0.0)), scene)
    behind = marked(offscreen, points((0.0, 0.0, -0.5)), scene)
    assert pixel(on_it, 0.0, 0.0)[:3] == COLOR
    plain = np.array(pixel(alone, 0.0, 0.0)[:3])
    mixed = 0.5 * np.array(COLOR) + 0.5 * plain
    assert pixel(behind, 0.0, 0.0)[:3] == pytest.approx(mixed, abs=2)


def test_no_marks_draw_no_pixels(offscreen):
    assert not drawn(marked(offscreen, Marks())).any()
    assert not drawn(marked(offscreen, None)).any()


def perspective(offscreen, marks):
    """Return an image from z = 2 towards the origin, with a 90 degree field of view."""
    offscreen.renderer.marks = marks
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0)
    options = DisplayOptions(background="transparent", grid=False, samples=1)
    box = np.array([[-2.0, -2.0, -2.0], [2.0, 2.0, 2.0]])
    return offscreen.render(NOTHING, (PIXELS, PIXELS), camera, options, box)


def test_point_size_does_not_depend_on_distance(offscreen):
    sizes = [drawn(perspective(offscreen, points((0, 0, z)))).sum() for z in (1.0, 0.0, -2.0)]
    assert max(sizes) - min(sizes) <= 2


def test_marks_behind_the_eye_are_not_drawn(offscreen):
    assert not drawn(perspective(offscreen, points((0.1, 0.1, 5.0)))).any()
    both_behind = Marks(lines=np.array([[[-1.0, 0.0, 3.0], [1.0, 0.0, 4.0]]]))
    assert not drawn(perspective(offscreen, both_behind)).any()


def test_line_that_passes_the_eye_is_clipped(offscreen):
    # The line runs from the image centre to the right and behind the eye, so only the right half
    # shows it.
    line = Marks(lines=np.array([[[0.0, 0.0, 0.0], [3.0, 0.0, 6.0]]]))
    mask = drawn(perspective(offscreen, line))
    assert mask[PIXELS // 2, PIXELS // 2 :].all()
    assert not mask[:, : PIXELS // 2 - 5].any()


def test_points_are_drawn_over_lines(offscreen):
    line = np.array([[[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]])
    both = Marks(np.zeros((1, 3)), np.array([6.0]), line)
    found = mark_annotation(both).segments
    assert found.starts.tolist() == [[-1, 0, 0], [0, 0, 0]]
    assert found.ends.tolist() == [[1, 0, 0], [0, 0, 0]]
    assert found.widths.tolist() == [2, 12]
    # If the line were over the point, its dark border would be visible 3 pixels from the centre.
    assert pixel(marked(offscreen, both), 0.0, 3 / 20) == [*COLOR, 255]


def test_marks_far_from_the_origin_do_not_jitter(offscreen):
    far = 1e7
    camera = Camera(np.array([far, 0.0, 0.0]), 2.0, 0.0, 0.0, 90.0, orthographic=True)
    options = DisplayOptions(background="transparent", grid=False, samples=1)
    offscreen.renderer.marks = points((far + 0.5, 0.0, 0.0))
    box = np.array([[far - 1, -1, -1], [far + 1, 1, 1]])
    picture = offscreen.render(NOTHING, (PIXELS, PIXELS), camera, options, box)
    assert pixel(picture, 0.5, 0.0) == [*COLOR, 255]
