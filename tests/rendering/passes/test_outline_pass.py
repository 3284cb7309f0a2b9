"""Outlines of constant width around actors, joints and points, but not inside them."""

import numpy as np
import pytest
from rendering.drawn_figures import skeleton
from rendering.front_view import PIXELS, alone, front_view, grid_figure

from viewer.rendering.camera import Camera
from viewer.rendering.gpu.target import Target, picture_rows
from viewer.rendering.offscreen import Offscreen
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.outline_pass import Outlined
from viewer.rig.figure import Figure
from viewer.rig.scene import scene_box


@pytest.fixture(scope="module")
def offscreen():
    with Offscreen() as result:
        yield result


def changed(offscreen, scene, *outlined, **options):
    """Return a mask of the pixels covered by outlines, and the image with straight alpha."""
    front_view(offscreen, scene, **options)
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)
    shown = DisplayOptions(samples=1, **options)
    with offscreen.context as context:
        target, box = Target(context, (PIXELS, PIXELS), 1), scene_box(scene)
        offscreen.renderer.draw_outlines(outlined, scene, camera, shown, target, box)
        picture = picture_rows(target.framebuffer.read(components=4), target.size).copy()
        target.release()
    return picture[..., 3] > 0, picture


def test_outline_has_equal_width_on_all_sides_and_covers_no_inner_pixels(offscreen):
    scene = alone(grid_figure())
    lines, picture = changed(offscreen, scene, Outlined(0))
    # The square extends from pixel 10 to 70; at the smallest scale, 0.8, the coloured line is 1.6
    # pixels wide and the dark line extends a pixel further.
    assert not lines[11:69, 11:69].any()
    middle = PIXELS // 2
    for row in (lines[middle], lines[middle, ::-1], lines[:, middle], lines[::-1, middle]):
        assert np.flatnonzero(row[:middle]).tolist() in ([7, 8, 9], [7, 8, 9, 10])
    red, green, blue, alpha = picture[middle, 9].tolist()
    assert red > green > 2 * blue and alpha > 200
    # The corners are round.
    assert not lines[7, 7] and lines[8, 8]


def test_hovered_and_selected_actors_have_different_colours(offscreen):
    scene = alone(grid_figure())
    _, selected = changed(offscreen, scene, Outlined(0))
    _, hovered = changed(offscreen, scene, Outlined(0, is_hovered=True))
    assert hovered[PIXELS // 2, 9, 2] > 150 > selected[PIXELS // 2, 9, 2]


@pytest.mark.parametrize("style", ["boxes", "octahedra", "axes"])
def test_outline_of_a_joint_does_not_outline_other_joints(offscreen, style):
    joints = skeleton([-1, 0, 1], [[-1.5, 0.0, 0.0], [1.5, 0.0, 0.0], [1.5, 0.0, 0.0]])
    scene = alone(Figure("bones", skeleton=joints))
    lines, _ = changed(offscreen, scene, Outlined(0, 1), bones=style)
    assert lines[:, PIXELS // 2 - 4 :].any() and not lines[:, : PIXELS // 2 - 6].any()


def test_points_are_outlined_and_the_option_outlines_the_selection(offscreen):
    scene = alone(grid_figure())
    where = np.array([[1.0, 0.0, 0.0]])
    lines, _ = changed(offscreen, scene, Outlined(0, points=where))
    rows, columns = np.nonzero(lines)
    away = np.hypot(rows - 39.5, columns - 59.5)
    # The diameter is 9 pixels at the smallest scale, plus the line around it.
    assert away.max() < 8.0 and away.min() > 2.5
    plain, outlined = (front_view(offscreen, scene, outline=on) for on in (False, True))
    assert (plain != outlined).any()
