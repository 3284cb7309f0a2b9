"""Rendered keypoints: position, visibility through the surface, and the option that shows them."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.front_view import PIXELS, alone, drawn, front_view, grid_figure

from viewer.rendering.offscreen import Offscreen
from viewer.rig.annotations import Keypoints
from viewer.rig.scene import Actor

CORNER, CENTER = 24, 12  # vertices of the grid at (1.5, 1.5) and (0, 0)


@pytest.fixture(scope="module")
def offscreen():
    with Offscreen() as result:
        yield result


def marked(*vertices):
    """Return a grid with keypoints at vertices."""
    count = len(vertices)
    points = Keypoints(
        tuple(map(str, vertices)),
        np.full(count, -1),
        np.repeat(np.array(vertices)[:, None], 3, axis=1),
        np.tile([1.0, 0.0, 0.0], (count, 1)),
    )
    return grid_figure(keypoints=points)


def marks(offscreen, scene, **options):
    """Return a mask of the pixels changed by the markers."""
    bare = front_view(offscreen, scene, **options)
    with_them = front_view(offscreen, scene, keypoints=True, **options)
    return np.abs(with_them.astype(int) - bare).max(axis=-1) > 8


def middle(mask):
    """Return the centre of the marked pixels in units of the image plane."""
    rows, columns = np.nonzero(mask)
    x = (columns.mean() + 0.5) * 4 / PIXELS - 2.0
    return x, 2.0 - (rows.mean() + 0.5) * 4 / PIXELS


def test_marker_is_at_the_position_of_its_vertex(offscreen):
    for vertex, place in ((CORNER, (1.5, 1.5)), (CENTER, (0.0, 0.0)), (4, (1.5, -1.5))):
        mask = marks(offscreen, alone(marked(vertex)))
        assert 0 < mask.sum() < 16
        assert middle(mask) == pytest.approx(place, abs=0.05)


def test_marker_follows_pose_and_placement(offscreen):
    scene = alone(marked(CORNER))
    pose = scene.actors[0].pose
    pose.dofs[2] = np.pi / 2
    assert middle(marks(offscreen, scene)) == pytest.approx((-1.5, 1.5), abs=0.05)
    pose.figure_scale, pose.figure_translation[1] = 0.5, -1.0
    assert middle(marks(offscreen, scene)) == pytest.approx((-0.75, -0.25), abs=0.05)
    scene.actors[0].placement[0, 3] = 1.0
    assert middle(marks(offscreen, scene)) == pytest.approx((0.25, -0.25), abs=0.05)


def test_markers_are_visible_through_the_surface(offscreen):
    scene = alone(marked(CENTER))
    cover = Actor(grid_figure())
    cover.placement[2, 3] = 1.0
    scene.actors.append(cover)
    assert middle(marks(offscreen, scene)) == pytest.approx((0.0, 0.0), abs=0.05)


def test_every_keypoint_has_a_marker(offscreen):
    mask = marks(offscreen, alone(marked(CORNER, CENTER, 0, 4, 20)))
    one = marks(offscreen, alone(marked(CENTER)))
    assert 3 * one.sum() < mask.sum() < 7 * one.sum()


def test_keypoint_at_a_joint_is_drawn_at_the_joint(offscreen):
    figure = grid_figure()
    points = Keypoints(("hip",), [1], [[0, 0, 0]], [[1.0, 0, 0]])
    bones = replace(figure.skeleton, rest_translations=[[0, 0, 0], [1.0, -1.0, 0.0]])
    mask = marks(offscreen, alone(replace(figure, skeleton=bones, keypoints=points)))
    assert middle(mask) == pytest.approx((1.0, -1.0), abs=0.05)


def test_figure_without_keypoints_has_no_markers(offscreen):
    assert not marks(offscreen, alone(grid_figure())).any()
    assert not marks(offscreen, alone(marked(CENTER)), show="binding").any()
    scene = alone(marked(CENTER))
    scene.actors[0].visible = False
    assert not marks(offscreen, scene).any()
    assert not marks(offscreen, alone(marked())).any()


def test_markers_are_drawn_over_a_skeleton_without_a_skin(offscreen):
    scene = alone(marked(CORNER))
    picture = front_view(offscreen, scene, show="skeleton", keypoints=True)
    found = drawn(picture).copy()
    found[20:60, 20:60] = False  # the joints themselves
    assert middle(found) == pytest.approx((1.5, 1.5), abs=0.05)


def test_marker_size_depends_on_the_figure_not_on_the_image(offscreen):
    small, large = alone(marked(CENTER)), alone(marked(CENTER))
    large.actors[0].placement[:3, :3] *= 4.0
    # Cubes of 1.2 % of the figure's diagonal of 3 sqrt 2, seen from the front, have sides of 1.02
    # pixels.
    assert 1 <= marks(offscreen, small).sum() <= 4
    assert 16 <= marks(offscreen, large).sum() <= 25


def test_markers_of_removed_actors_are_freed(offscreen):
    scene = alone(marked(CENTER))
    front_view(offscreen, scene, keypoints=True)
    assert len(offscreen.renderer.buffers.keypoints) == 1
    front_view(offscreen, alone(grid_figure()), keypoints=True)
    assert len(offscreen.renderer.buffers.keypoints) == 0
