"""Segments and dots on the screen: width, round ends and depth."""

import moderngl
import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.rendering.camera import Camera
from viewer.rendering.gpu.program import Programs
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
