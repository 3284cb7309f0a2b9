"""Skeletons drawn as octahedra, sticks and axes: direction, roll, ends, branches, and picking."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import skeleton
from rendering.front_view import alone

from viewer.rendering.camera import Camera
from viewer.rendering.options import DisplayOptions, Light, Lights
from viewer.rigs.figure import Figure
from viewer.rigs.scene import scene_box

SIDE = 96
STYLES = ("octahedra", "sticks", "axes")
DARK = Light(0.0, 0.0, (0.0, 0.0, 0.0), 0.0)


def scene_of(parents, offsets, *dofs, boxes=None):
    """Return a scene of a skeleton with DOFs set by (row, angle)."""
    scene = alone(Figure("bones", skeleton=skeleton(parents, offsets, boxes)))
    for row, angle in dofs:
        scene.actors[0].pose.dofs[row] = angle
    return scene


def draw(offscreen, scene, reach, bones="auto"):
    """Return the unlit front view of -reach to reach in x and y on a transparent background."""
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=reach, orthographic=True)
    flat = Lights(DARK, DARK, ambient=1.0, specular=0.0)
    options = DisplayOptions(background="transparent", grid=False, samples=1, lights=flat)
    options.bones = bones
    return offscreen.render(scene, (SIDE, SIDE), camera, options, scene_box(scene)).astype(int)


def at(picture, reach, x, y):
    column, row = (int(SIDE * (0.5 + 0.5 * value / reach)) for value in (x, -y))
    return picture[row, column]


def columns_of(picture, strongest):
    """Return the mean column of the pixels with a pure axis colour."""
    others = [channel for channel in range(3) if channel != strongest]
    pure = picture[..., 3] > 0
    for other in others:
        pure &= picture[..., strongest] > 1.5 * picture[..., other]
    return np.nonzero(pure)[1].mean() - SIDE / 2


@pytest.mark.parametrize("style", ["octahedra", "sticks"])
def test_ridge_rotates_with_the_roll(offscreen, style):
    chain = [-1, 0], [[0.0, 0.0, 0.0], [0.0, 1.5, 0.0]]
    # Red is the x axis, the first axis across the bone.
    assert columns_of(draw(offscreen, scene_of(*chain), 0.5, style), 0) > 0.8
    turned = scene_of(*chain, (1, math.pi))
    assert columns_of(draw(offscreen, turned, 0.5, style), 0) < -0.8


@pytest.mark.parametrize("style", STYLES)
def test_bone_is_drawn_to_every_child_and_not_between_the_children(offscreen, style):
    places = [[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [0.0, 1.5, 0.0], [-1.0, -1.0, 0.0]]
    picture = draw(offscreen, scene_of([-1, 0, 0, 0], places), 2.0, style)
    for x, y in ((0.4, 0.0), (0.0, 0.4), (-0.4, -0.4)):
        assert at(picture, 2.0, x, y)[3] > 0
    assert at(picture, 2.0, 0.5, 0.5)[3] == 0


@pytest.mark.parametrize("style", STYLES)
def test_skeleton_of_a_replaced_figure_is_drawn(offscreen, style):
    scene = scene_of([-1, 0], [[0.0, 0.0, 0.0], [1.5, 0.0, 0.0]])
    before = draw(offscreen, scene, 2.0, style)
    assert (at(before, 2.0, 0.4, 0.0)[3] > 0, at(before, 2.0, 0.0, 0.4)[3] > 0) == (True, False)
    places = [[0.0, 0.0, 0.0], [0.0, 1.5, 0.0]]
    scene.actors[0].figure = Figure("bones", skeleton=skeleton([-1, 0], places))
    after = draw(offscreen, scene, 2.0, style)
    assert (at(after, 2.0, 0.4, 0.0)[3] > 0, at(after, 2.0, 0.0, 0.4)[3] > 0) == (False, True)


def test_end_bone_continues_its_parent_and_rotates(offscreen):
    chain = [-1, 0], [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]]
    # The length is two fifths of the bone, but at most 7 % of the figure's size of 1.
    straight, turned = scene_of(*chain), scene_of(*chain, (5, -math.pi / 2))
    assert at(draw(offscreen, straight, 0.1, "octahedra"), 0.1, 0.0, 0.055)[3] > 0
    assert at(draw(offscreen, straight, 0.1, "octahedra"), 0.1, 0.055, 0.0)[3] == 0
    assert at(draw(offscreen, turned, 0.1, "octahedra"), 0.1, 0.055, 0.0)[3] > 0
    assert at(draw(offscreen, turned, 0.1, "octahedra"), 0.1, 0.0, 0.055)[3] == 0


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
def test_size_follows_the_figure_and_ignores_coincident_joints(offscreen, style, scale):
    places = scale * np.array([[0, 0, 0], [0, 0, 0], [0, 1.0, 0], [0, 0, 0]])
    picture = draw(offscreen, scene_of([-1, 0, 1, 2], places), 2.0 * scale, style)
    assert 20 < (picture[..., 3] > 0).sum() < 0.1 * SIDE**2
    usual = draw(offscreen, scene_of([-1, 0, 1, 2], places / scale), 2.0, style)
    assert abs((picture[..., 3] > 0).sum() - (usual[..., 3] > 0).sum()) <= 4


def test_bones_follow_a_child_that_is_moved(offscreen):
    scene = scene_of([-1, 0], [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    scene.actors[0].pose.translations[1] = 1.0, -1.0, 0.0
    picture = draw(offscreen, scene, 2.0, "sticks")
    assert at(picture, 2.0, 0.5, 0.0)[3] > 0 and at(picture, 2.0, 0.0, 0.5)[3] == 0


def test_axes_are_red_to_the_right_and_green_upwards(offscreen):
    picture = draw(offscreen, scene_of([-1, 0], [[0.0, 0.0, 0.0], [0, 0, -1.0]]), 0.1, "axes")
    right, up = at(picture, 0.1, 0.04, 0.0), at(picture, 0.1, 0.0, 0.04)
    assert right[0] > 2 * right[1] and up[1] > 1.3 * up[0]


def test_default_style_is_the_boxes_of_a_file_or_octahedra(offscreen):
    chain = [-1, 0], [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    boxes = np.tile([[-0.2] * 3, [0.2] * 3], (2, 1, 1))
    for given, style in ((boxes, "boxes"), (None, "octahedra")):
        scene = scene_of(*chain, boxes=given)
        found = draw(offscreen, scene, 2.0)
        np.testing.assert_array_equal(found, draw(offscreen, scene, 2.0, style))
        assert (found != draw(offscreen, scene, 2.0, "sticks")).any()


def test_default_style_of_boxes_made_from_bones_is_bones_to_the_far_ends(offscreen):
    """The far end of the last bone is the sum of its box's corners: 0.5 right and 0.5 up."""
    boxes = np.array([[[-0.1, 0.0, -0.1], [0.1, 1.0, 0.1]], [[0.1, 0.1, -0.1], [0.4, 0.4, 0.1]]])
    scene = scene_of([-1, 0], [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]], boxes=boxes)
    figure = scene.actors[0].figure
    made = replace(figure, skeleton=replace(figure.skeleton, boxes_from_bones=True))
    scene = alone(made)
    found = draw(offscreen, scene, 2.0)
    np.testing.assert_array_equal(found, draw(offscreen, scene, 2.0, "octahedra"))
    near = draw(offscreen, scene, 0.6)
    assert at(near, 0.6, 0.2, 0.2)[3] > 0 and at(near, 0.6, 0.4, 0.4)[3] > 0
    # Without a far end, the last bone would continue the one before it.
    assert at(near, 0.6, 0.0, 0.06)[3] == 0


@pytest.mark.parametrize("style", STYLES)
def test_bone_is_picked_as_its_joint(offscreen, style):
    scene = scene_of([-1, 0, 1], [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)
    options = DisplayOptions(bones=style)
    with offscreen.context:
        for joint, y in ((0, -0.6), (1, 0.4)):
            row = SIDE * (0.5 - y / 4)
            size, box = (SIDE, SIDE), scene_box(scene)
            found = offscreen.renderer.pick(scene, camera, options, size, SIDE / 2, row, box)
            assert found is not None and found.joint == joint
