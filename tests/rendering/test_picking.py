"""Picking at known positions: actor, joint, triangle, keypoint and scene position."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import arm, bent, groups_of, skeleton, square
from rendering.front_view import PIXELS, grid_figure

from viewer.rendering import lineup
from viewer.rendering.camera import Camera
from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.options import DisplayOptions
from viewer.rigs.annotations import Keypoints, ReducedMesh
from viewer.rigs.captures.points import PointLayout
from viewer.rigs.figure import Figure
from viewer.rigs.scene import Actor, Scene, scene_box


def parallel() -> Camera:
    return Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)


def click(offscreen, scene: Scene, x, y, camera=None, size=(PIXELS, PIXELS), **options):
    """Pick at (x, y) in the orthographic front view: -2 to 2 across the image."""
    shown = DisplayOptions(**options)
    column, row = size[0] * (0.5 + x / 4), size[1] * (0.5 - y / 4)
    with offscreen.context:
        return offscreen.renderer.pick(
            scene, camera or parallel(), shown, size, column, row, scene_box(scene)
        )


def test_triangle_of_the_mesh_is_found(offscreen):
    """The cells are 0.75 wide from -1.5 on, with two triangles each, row by row from below."""
    scene = Scene([Actor(grid_figure())])
    for triangle in range(32):
        cell, upper = divmod(triangle, 2)
        row, column = divmod(cell, 4)
        # The first triangle of a cell is below its diagonal, the second above it.
        inside = (0.25, 0.6) if upper else (0.6, 0.25)
        x, y = (-1.5 + 0.75 * (at + part) for at, part in zip((column, row), inside, strict=True))
        found = click(offscreen, scene, x, y)
        assert (found.actor, found.joint, found.triangle, found.keypoint) == (0, -1, triangle, -1)
        assert found.point == pytest.approx([x, y, 0.0], abs=4.0 / PIXELS)


def test_background_picks_no_object(offscreen):
    scene = Scene([Actor(grid_figure())])
    assert click(offscreen, scene, 1.8, 1.8) is None
    assert click(offscreen, Scene([]), 0.0, 0.0) is None
    scene.actors[0].is_present = False
    assert click(offscreen, scene, 0.0, 0.0) is None


def test_pick_tolerance_is_three_pixels(offscreen):
    scene = Scene([Actor(grid_figure())])
    # The edge is at 1.5, the right border of pixel 69 of 80.
    assert click(offscreen, scene, 4 * 72.5 / PIXELS - 2, 0.0) is not None
    assert click(offscreen, scene, 4 * 73.5 / PIXELS - 2, 0.0) is None


def test_nearer_actor_hides_the_farther_one(offscreen):
    far, near = Actor(grid_figure()), Actor(grid_figure())
    near.placement[:3, 3] = 1.0, 0.0, 0.5
    scene = Scene([far, near])
    assert click(offscreen, scene, 0.0, 0.0).actor == 1
    assert click(offscreen, scene, -1.0, 0.0).actor == 0
    assert click(offscreen, scene, 0.0, 0.0).point[2] == pytest.approx(0.5, abs=1e-5)
    near.visible = False
    assert click(offscreen, scene, 0.0, 0.0).actor == 0


def test_perspective_depth_is_exact(offscreen):
    """A square at z = -1 is seen from (0, 0, 2) at 90 degrees; the pixel is (60.5, 40.5) of 80."""
    scene = Scene([Actor(Figure("wall", square(z=-1.0, half=5.0)))])
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0)
    with offscreen.context:
        found = offscreen.renderer.pick(
            scene, camera, DisplayOptions(), (80, 80), 60.2, 40.9, scene_box(scene)
        )
    # The pixel centre is 20.5 / 40 of half the width, which is 3 at a distance of 3.
    assert found.point == pytest.approx([3 * 20.5 / 40, -3 * 0.5 / 40, -1.0], abs=1e-5)


def test_images_of_any_aspect_ratio_are_picked_correctly(offscreen):
    scene = Scene([Actor(grid_figure())])
    with offscreen.context:
        for size in ((160, 80), (80, 160), (1920, 1080)):
            found = offscreen.renderer.pick(
                scene,
                parallel(),
                DisplayOptions(),
                size,
                size[0] / 2,
                size[1] / 4,
                scene_box(scene),
            )
            # The position is a quarter of the height above the centre, 1 of 2 units.
            pixel = 4.0 / size[1]
            assert found.point == pytest.approx([0.0, 1.0, 0.0], abs=pixel)


def test_posed_meshes_are_picked_at_their_drawn_position(offscreen):
    scene = Scene([bent(arm(3), (1, "z", np.pi / 2))])
    scene.actors[0].placement[0, 3] = -1.0
    # The first segment extends from -1 to 0, the others upwards from there.
    assert click(offscreen, scene, 0.0, 1.0).point[1] == pytest.approx(1.0, abs=0.05)
    assert click(offscreen, scene, 1.0, 0.0) is None


def test_picking_does_not_skin_actors_again(offscreen, monkeypatch):
    scene = Scene([bent(arm(3), (1, "z", 0.5))])
    offscreen.render(scene, (80, 80), parallel(), DisplayOptions(), scene_box(scene))
    before = offscreen.renderer.buffers.posed_mesh(scene.actors[0]).n_updates
    monkeypatch.setattr(PosedMesh, "_skin", None)
    assert click(offscreen, scene, 0.5, 0.0) is not None
    assert offscreen.renderer.buffers.posed_mesh(scene.actors[0]).n_updates == before


def test_boxes_of_joints_are_also_found_over_the_skin(offscreen):
    """The boxes of the arm extend from 0.1 to 0.9 of each unit, and 0.12 up and down."""
    scene = Scene([Actor(arm(2))])
    for show in ("skeleton", "both"):
        for joint in (0, 1):
            found = click(offscreen, scene, joint + 0.5, 0.0, show=show)
            assert (found.actor, found.joint, found.triangle) == (0, joint, -1)
            assert found.point == pytest.approx([joint + 0.5, 0.0, 0.12], abs=0.06)
    assert click(offscreen, scene, 0.5, 0.22, show="both").joint == -1
    assert click(offscreen, scene, 0.5, 0.0).joint == -1


def test_skeleton_without_a_mesh_is_found(offscreen):
    boxes = np.tile([[-0.2] * 3, [0.2] * 3], (2, 1, 1))
    figure = Figure("bones", None, skeleton([-1, 0], [[-1.0, 0, 0], [2.0, 0, 0]], boxes))
    scene = Scene([Actor(figure)])
    assert click(offscreen, scene, -1.0, 0.1).joint == 0
    assert click(offscreen, scene, 1.0, 0.1).joint == 1


def test_markers_of_keypoints_are_found_through_the_surface(offscreen):
    corner, center = 24, 12  # vertices at (1.5, 1.5) and (0, 0)
    marks = Keypoints(
        ("a", "b"), [-1, -1], [[center] * 3, [corner] * 3], np.tile([1.0, 0.0, 0.0], (2, 1))
    )
    cover = Actor(grid_figure())
    cover.placement[2, 3] = 1.0
    scene = Scene([cover, Actor(grid_figure(keypoints=marks))])
    found = click(offscreen, scene, 0.0, 0.0, keypoints=True)
    assert (found.actor, found.keypoint, found.triangle) == (1, 0, -1)
    assert click(offscreen, scene, 1.5, 1.5, keypoints=True).keypoint == 1
    assert click(offscreen, scene, 0.0, 0.0).actor == 0


def test_captured_points_and_the_nearer_ends_of_limbs_are_found(offscreen):
    layout = PointLayout("three", ("a", "b", "c"), [[0, 1], [1, 2]], [-1, 0, 1])
    actor = Actor(Figure("points", points=layout))
    actor.points = np.array([[-1.0, 0, 0, 1], [1.0, 0, 0, 0.5], [1.0, 1.5, 0, 0.0]])
    scene = Scene([Actor(grid_figure()), actor])
    actor.placement[2, 3] = 1.0
    for x, keypoint in ((-1.0, 0), (1.0, 1), (-0.4, 0), (0.4, 1)):
        found = click(offscreen, scene, x, 0.0, size=(400, 400))
        assert (found.actor, found.joint, found.triangle, found.keypoint) == (1, -1, -1, keypoint)
    assert click(offscreen, scene, 1.0, 1.0).actor == 0  # c is undetected, so its limb is not drawn


def test_keypoint_within_two_pixels_takes_precedence_over_the_surface_behind_it(offscreen):
    layout = PointLayout("two", ("a", "b"), np.zeros((0, 2)), [0, 0])
    actor = Actor(Figure("points", points=layout))
    actor.points = np.array([[-1.0, 0, 1.0, 1], [1.0, 0, 1.0, 1]])
    scene = Scene([Actor(grid_figure()), actor])
    # Radii are 0.012 of the distance of 2, or 2.4 pixels of 0.01, so the last row is 1.5 above.
    for pixels, who in ((0.0, 1), (3.5, 1), (4.5, 0)):
        assert click(offscreen, scene, 1.0, 0.01 * pixels, size=(400, 400)).actor == who


@pytest.mark.parametrize("count", [3, 12])
def test_instances_are_distinguished(offscreen, monkeypatch, count):
    monkeypatch.setattr(lineup, "FEWEST", 4)
    figure = arm(2)
    actors = []
    for number in range(count):
        actor = bent(figure, (1, "z", 0.1 * number))
        actor.placement[:3, :3] *= 0.1
        actor.placement[:3, 3] = number % 4 - 1.5, number // 4 - 1.0, 0.0
        actors.append(actor)
    other = Actor(replace(figure, name="other"))
    other.placement[:3, 3] = -1.0, 1.6, 0.0
    scene = Scene([other, *actors])
    assert len(groups_of(scene.actors, DisplayOptions())) == (count > 4)
    for number, actor in enumerate(actors):
        x, y = actor.placement[:2, 3]
        found = click(offscreen, scene, x + 0.05, y, size=(400, 400))
        assert (found.actor, found.joint, found.keypoint) == (number + 1, -1, -1)
        corners = figure.mesh.positions[figure.mesh.triangles[found.triangle]]
        # A pixel is 0.1 units of the arm.
        assert corners[:, 0].min() - 0.1 <= 0.5 <= corners[:, 0].max() + 0.1
    assert click(offscreen, scene, -0.5, 1.6).actor == 0


def test_picking_returns_reduced_mesh_triangles(offscreen):
    coarse = ReducedMesh([0, 4, 20, 24], [[0, 1, 3], [0, 3, 2]])
    scene = Scene([Actor(grid_figure(reduced=coarse))])
    assert click(offscreen, scene, 0.5, -0.5, reduced=True).triangle == 0
    assert click(offscreen, scene, -0.5, 0.5, reduced=True).triangle == 1


def test_culled_triangles_are_not_found(offscreen):
    scene = Scene([Actor(Figure("back", square(clockwise=True)))])
    assert click(offscreen, scene, 0.0, 0.0).triangle >= 0
    assert click(offscreen, scene, 0.0, 0.0, cull=True) is None


def test_picking_does_not_change_the_next_image(offscreen):
    scene = Scene([bent(arm(3), (1, "z", 0.5))])
    options, box = DisplayOptions(show="both"), scene_box(scene)
    before = offscreen.render(scene, (80, 80), parallel(), options, box)
    click(offscreen, scene, 0.5, 0.0, show="both", cull=True)
    after = offscreen.render(scene, (80, 80), parallel(), options, box)
    assert np.array_equal(before, after)
