"""Segments and dots on the screen: width, round ends and depth."""

import math

import moderngl
import numpy as np
import pytest
from numpy.testing import assert_allclose
from rendering.drawn_figures import square
from rendering.front_view import PIXELS, drawn, front_view, pixel

from viewer.rendering.camera import Camera
from viewer.rendering.gpu.program import Programs
from viewer.rendering.options import DisplayOptions
from viewer.rendering.overlay.annotation import MARK_COLOR, Marks, mark_annotation
from viewer.rendering.overlay.segments import (
    HIDDEN,
    SegmentPass,
    Segments,
    SegmentStyle,
    dots,
    joined,
)
from viewer.rendering.projection import project
from viewer.rendering.view import view_of
from viewer.rigs.figure import Figure
from viewer.rigs.scene import Actor, Scene

SIDE = 80  # pixels; x and y are from -2 to 2, so a unit is 20 pixels
BOX = np.array([[-2.0, -2.0, -2.0], [2.0, 2.0, 2.0]])
RED = (1.0, 0.0, 0.0, 1.0)


@pytest.fixture
def picture(ctx):
    """Draw segments seen from +z; return colour and opacity, (H, W, 4) float, first row on top."""
    programs = Programs(ctx)
    target = ctx.framebuffer(
        [ctx.texture((SIDE, SIDE), 4, dtype="f4")], ctx.depth_renderbuffer((SIDE, SIDE))
    )
    passes = SegmentPass(ctx, programs)
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)

    def draw(segments, depth=1.0, target_point=(0.0, 0.0, 0.0), **style):
        camera.target = np.array(target_point)
        target.use()
        ctx.viewport = (0, 0, SIDE, SIDE)
        target.clear(depth=depth)
        ctx.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND)
        ctx.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        ctx.depth_func = "<"
        view = view_of(camera, (SIDE, SIDE), BOX + camera.target)
        passes.draw(segments, view, (SIDE, SIDE), SegmentStyle(**style))
        rows = np.frombuffer(target.read(components=4, dtype="f4"), dtype="f4")
        return rows.reshape(SIDE, SIDE, 4)[::-1]

    yield draw
    passes.release()
    programs.release()
    for item in (*target.color_attachments, target.depth_attachment, target):
        item.release()


def line(start, end, width=4.0, color=RED):
    return Segments(np.array([start]), np.array([end]), np.array([color]), np.array([width]))


def test_line_has_the_requested_width_and_length(picture):
    opacity = picture(line((-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)))[..., 3]
    # The line is from column 20 to 60 and four pixels wide; round ends extend two pixels further.
    assert_allclose(opacity[:, 40].sum(), 4.0, atol=0.02)
    assert_allclose(opacity.sum(), 4.0 * 40.0 + np.pi * 4.0, rtol=0.01)
    assert_allclose(opacity[:, 22:58], opacity[:, 40:41].repeat(36, axis=1), atol=1e-5)


def test_slanted_line_covers_the_same_area(picture):
    opacity = picture(line((-0.6, -0.8, 0.0), (0.6, 0.8, 0.0)))[..., 3]
    assert_allclose(opacity.sum(), 4.0 * 40.0 + np.pi * 4.0, rtol=0.02)


def test_segment_of_zero_length_is_a_round_dot(picture):
    opacity = picture(dots(np.zeros((1, 3)), np.array(RED), 20.0))[..., 3]
    assert_allclose(opacity.sum(), np.pi * 100.0, rtol=0.01)
    # Graphics cards round the distances to the centre differently on its two sides.
    assert_allclose(opacity, opacity.T, atol=1e-5)
    assert_allclose(opacity, opacity[::-1], atol=1e-5)


def test_colours_are_multiplied_by_opacity(picture):
    found = picture(dots(np.zeros((1, 3)), np.array([0.2, 0.4, 0.8, 0.5]), 20.0))[40, 40]
    assert_allclose(found, [0.1, 0.2, 0.4, 0.5], atol=1e-6)


def test_later_segments_are_drawn_over_earlier_ones(picture):
    both = joined(
        [dots(np.zeros((1, 3)), np.array(RED), 20.0),
         dots(np.zeros((1, 3)), np.array([0.0, 1.0, 0.0, 1.0]), 8.0)]
    )  # fmt: skip
    found = picture(both)
    assert_allclose(found[40, 40], [0, 1, 0, 1], atol=1e-6)
    assert_allclose(found[40, 47], [1, 0, 0, 1], atol=1e-6)


def test_hidden_segments_are_faint_unless_on_top(picture):
    dot = dots(np.zeros((1, 3)), np.array(RED), 20.0)
    assert_allclose(picture(dot, depth=0.0)[40, 40, 3], HIDDEN, atol=1e-6)
    assert_allclose(picture(dot, depth=0.0, on_top=True)[40, 40, 3], 1.0, atol=1e-6)


def test_border_is_blended_around_the_segment(picture):
    blue = (0.0, 0.0, 1.0)
    found = picture(dots(np.zeros((1, 3)), np.array(RED), 20.0), border=4.0, border_color=blue)
    assert_allclose(found[40, 40], RED, atol=1e-6)
    assert_allclose(found[40, 51], (0, 0, 1, 1), atol=1e-6)  # 11.5 pixels from the middle
    # The disc has a radius of 14 in total, and 10 in red.
    assert_allclose(found[..., 3].sum(), np.pi * 14.0**2, rtol=0.01)
    assert_allclose(found[..., 0].sum(), np.pi * 10.0**2, rtol=0.01)


def test_hidden_opacity_is_configurable(picture):
    dot = dots(np.zeros((1, 3)), np.array(RED), 20.0)
    assert_allclose(picture(dot, depth=0.0, hidden=0.75)[40, 40, 3], 0.75, atol=1e-6)


def test_lifted_segments_are_visible_on_a_surface(picture):
    # The eye is at a distance of 2, so a lift of a quarter moves a dot from z = 0 to z = 0.5 only.
    dot, other = (dots(np.array([[0.5, 0.5, z]]), np.array(RED), 20.0) for z in (0.0, 0.4))
    near = picture(dot)
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)
    at = project(view_of(camera, (SIDE, SIDE), BOX), (SIDE, SIDE), np.array([[0.0, 0.0, 0.25]]))
    between = 0.5 + 0.5 * float(at.depths[0])
    assert_allclose(picture(dot, depth=between)[30, 50, 3], HIDDEN, atol=1e-6)
    assert_allclose(picture(dot, depth=between, lift=0.25), near, atol=1e-6)
    assert_allclose(picture(other, depth=between)[30, 50, 3], 1.0, atol=1e-6)


def test_empty_list_of_segments_is_drawn(picture):
    assert not picture(dots(np.zeros((0, 3)), np.array(RED), 5.0)).any()


def test_buffer_grows_for_many_more_segments(picture):
    picture(line((-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)))
    points = np.stack([np.linspace(-1.9, 1.9, 200), np.zeros(200), np.zeros(200)], axis=1)
    found = picture(dots(points, np.array(RED), 4.0))
    assert_allclose(found[40, 4:76, 3], 1.0, atol=0.02)


def test_segments_far_from_the_origin_do_not_jitter(picture):
    near = picture(line((-1.0, 0.3, 0.0), (1.0, 0.3, 0.0)))
    # At this distance float32 has steps of 8.
    away = np.array([1e8, 0.0, 0.0])
    far = line(away + np.array([-1.0, 0.3, 0.0]), away + np.array([1.0, 0.3, 0.0]))
    assert_allclose(picture(far, target_point=away), near, atol=1e-3)


COLOR = [round(255 * channel) for channel in MARK_COLOR]
NOTHING = Scene([])


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
