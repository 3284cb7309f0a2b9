"""Rendered joints: bones seen through the skin, names, axes, and picking."""

import numpy as np
import pytest
from rendering.drawn_figures import skeleton
from rendering.front_view import PIXELS, alone, drawn, front_view, grid_figure, pixel

from viewer.rendering.camera import Camera
from viewer.rendering.offscreen import Offscreen
from viewer.rendering.options import DisplayOptions
from viewer.rig.figure import Figure
from viewer.rig.scene import Actor, Scene, scene_box

OFFSETS = [[-1.0, 0.0, -0.5], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]]  # behind the square


@pytest.fixture(scope="module")
def offscreen():
    with Offscreen() as result:
        yield result


def boned() -> Scene:
    """Return a square in front of bones from (-1, 0) to (1, 0) to (1, 1)."""
    figure = grid_figure()
    joints = Figure("bones", skeleton=skeleton([-1, 0, 1], OFFSETS))
    return Scene([Actor(Figure("square", figure.mesh)), Actor(joints)])


def test_bones_are_visible_through_a_translucent_skin(offscreen):
    plain = front_view(offscreen, boned())
    xray = front_view(offscreen, boned(), xray=True)
    assert pixel(plain, 0.0, -1.0)[3] == 255
    assert 80 < pixel(xray, 0.0, -1.0)[3] < 130  # two fifths of the square's colour
    assert pixel(xray, 0.0, 0.0)[3] > 200  # the bone is opaque
    assert pixel(xray, 1.0, 0.5)[3] > 200


def test_translucent_skins_form_one_layer_in_any_order(offscreen):
    once = front_view(offscreen, boned(), xray=True)
    for place in (0, 1):
        scene = boned()
        behind = Actor(scene.actors[0].figure)
        behind.placement[2, 3] = -0.4
        scene.actors.insert(place, behind)
        np.testing.assert_array_equal(front_view(offscreen, scene, xray=True), once)


def test_scalar_colours_are_unchanged(offscreen):
    shown = {"shading": "scalar", "scalar": "influences"}
    plain = front_view(offscreen, alone(grid_figure()), **shown)
    xray = front_view(offscreen, alone(grid_figure()), xray=True, **shown)
    assert pixel(plain, -1.2, -1.2) == pixel(xray, -1.2, -1.2)


def test_overlapping_actors_are_translucent(offscreen):
    figure = grid_figure()
    actors = [Actor(figure) for _ in range(9)]
    for number, actor in enumerate(actors):
        actor.placement[0, 3] = 10.0 * number
    picture = front_view(offscreen, Scene(actors), xray=True)
    assert 80 < pixel(picture, -1.2, -1.2)[3] < 130


def test_bones_are_not_drawn_in_bind_pose(offscreen):
    plain = front_view(offscreen, alone(grid_figure()), show="binding")
    names = front_view(offscreen, alone(grid_figure()), show="binding", joint_names=True)
    np.testing.assert_array_equal(plain, names)


def test_x_axis_points_right_and_y_axis_up(offscreen):
    scene = alone(Figure("bones", skeleton=skeleton([-1, 0], [[-1.5, 0, 0], [3.0, 0, 0]])))
    picture = front_view(offscreen, scene, joint_axes=True, show="skeleton")
    # An axis is a twentieth of 3 units, 3 pixels; a dot of 5.6 pixels covers the start of the axes.
    plain = front_view(offscreen, scene, show="skeleton")
    column, row = 10, 40
    there = (picture[row - 6 : row + 6, column - 6 : column + 8].astype(int)
             - plain[row - 6 : row + 6, column - 6 : column + 8])  # fmt: skip
    assert np.abs(there).sum() > 0


def test_names_are_counted_and_drawn(offscreen):
    scene = alone(Figure("bones", skeleton=skeleton([-1] * 4, [[0, 0, z] for z in range(4)])))
    plain = front_view(offscreen, scene, joint_axes=True)
    named = front_view(offscreen, scene, joint_names=True, joint_axes=True)
    assert offscreen.renderer.names_left_out == (0, 4)
    changed = (plain != named).any(axis=-1)
    assert changed[:, PIXELS // 2 + 5 :].any() and changed[:, : PIXELS // 2 - 5].any()
    front_view(offscreen, scene, joint_axes=True)
    assert offscreen.renderer.names_left_out == (0, 0)


def test_new_names_are_added_to_the_drawn_names(offscreen):
    first = alone(Figure("a", skeleton=skeleton([-1], [[0, 0, 0]])))
    once = front_view(offscreen, first, joint_names=True)
    front_view(offscreen, boned(), joint_names=True)
    np.testing.assert_array_equal(front_view(offscreen, first, joint_names=True), once)


def test_picking_finds_bones_visible_through_the_skin(offscreen):
    scene = boned()
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)

    def picked(x, y, **options):
        place = PIXELS * (0.5 + x / 4), PIXELS * (0.5 - y / 4)
        with offscreen.context:
            found = offscreen.renderer.pick(
                scene, camera, DisplayOptions(**options), (PIXELS, PIXELS), *place,
                scene_box(scene),
            )  # fmt: skip
        return None if found is None else (found.actor, found.joint)

    assert picked(0.0, 0.0) == (0, -1)
    assert picked(0.0, 0.0, xray=True) == (1, 0)
    assert picked(0.0, 0.0, joint_names=True) == (0, -1)  # bones are not drawn
    assert picked(1.0, 0.0, joint_names=True) == (1, 1)
    assert picked(0.0, -1.0, xray=True) == (0, -1)


def test_images_without_marks_are_unchanged(offscreen):
    assert drawn(front_view(offscreen, boned())).any()
    assert not DisplayOptions().xray
