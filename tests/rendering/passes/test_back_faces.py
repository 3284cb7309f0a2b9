"""Back faces, which are drawn only if they can be seen."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import scene_of, skeleton, sphere
from rendering.plain_pictures import draw, front, lights, plain

from viewer.rendering.camera import Camera
from viewer.rendering.gpu import mesh_buffers
from viewer.rig.figure import Figure
from viewer.rig.mesh import Mesh
from viewer.rig.scene import Actor, Scene
from viewer.rig.skin import skin_from_lists

LIT = plain(lights=lights(ambient=0.3, key=1.0, azimuth=30.0, inclination=40.0))


def closed(rings=24) -> Mesh:
    """Return a sphere of radius 1 with one vertex per position at the seam and the poles."""
    mesh = sphere(rings)
    return replace(mesh, positions=np.round(mesh.positions, 9))


def opened(to=(0.0, 0.0, 1.0)) -> Mesh:
    """Return the sphere without the eight triangles within 7.5 degrees of a direction."""
    mesh = closed()
    middles = mesh.positions[mesh.triangles].mean(axis=1)
    cosines = middles @ np.array(to) / np.linalg.norm(middles, axis=1)
    kept = mesh.triangles[cosines < np.cos(np.radians(7.5))]
    return replace(mesh, triangles=kept, triangle_materials=None, triangle_parts=None)


def regions(offscreen, scene: Scene, camera: Camera):
    """Return the regions in which back faces are drawn; None for the whole image."""
    with offscreen.context:
        mesh = offscreen.renderer.buffers.posed_mesh(scene.actors[0])
    view, projection = camera.view_matrix(), camera.projection_matrix(1.0, np.array([[-1], [1]]))
    return mesh.back_faces.regions(view, projection @ np.eye(4), (0, 0, 100, 100))


def drawn_both_ways(offscreen, monkeypatch, scene: Scene, camera: Camera):
    """Return the picture, the regions with back faces, and the picture with all back faces."""
    picture = draw(offscreen, scene, LIT, camera)
    where = regions(offscreen, scene, camera)
    monkeypatch.setattr(mesh_buffers, "shell_of", lambda *_: None)
    again = Scene([Actor(replace(scene.actors[0].figure))])
    whole = draw(offscreen, again, LIT, camera)
    assert regions(offscreen, again, camera) is None
    return picture, where, whole


def test_closed_surface_looks_the_same_without_back_faces(offscreen, monkeypatch) -> None:
    picture, where, whole = drawn_both_ways(offscreen, monkeypatch, scene_of(closed()), front())
    assert where == ()
    np.testing.assert_array_equal(picture, whole)


def test_opening_shows_the_inside(offscreen, monkeypatch) -> None:
    picture, where, whole = drawn_both_ways(offscreen, monkeypatch, scene_of(opened()), front())
    np.testing.assert_array_equal(picture, whole)
    # The border is 25 sin(7.5 degrees) = 3.3 pixels from the middle at 50, with a margin of two.
    assert where == ((44, 44, 12, 12),)


def test_opening_outside_the_image_draws_no_back_faces(offscreen) -> None:
    scene, camera = scene_of(opened((1.0, 0.0, 0.0))), front(target=np.array([-3.0, 0.0, 0.0]))
    draw(offscreen, scene, LIT, camera)
    assert regions(offscreen, scene, camera) == ()


def test_camera_inside_sees_the_back_faces(offscreen, monkeypatch) -> None:
    camera = front(orthographic=False, distance=0.1)
    picture, where, whole = drawn_both_ways(offscreen, monkeypatch, scene_of(closed()), camera)
    assert where is None
    assert (picture[..., 3] == 255).all()
    np.testing.assert_array_equal(picture, whole)


@pytest.mark.parametrize("scale, is_hidden", [(0.5, True), (-0.5, True), (0.0, False)])
def test_back_faces_are_hidden_unless_a_joint_flattens_them(offscreen, scale, is_hidden) -> None:
    mesh = closed(8)
    skin = skin_from_lists([[(0, 1.0)] for _ in mesh.positions], np.eye(4)[None])
    scene = Scene([Actor(Figure("ball", mesh, skeleton([-1], [[0.0, 0.0, 0.0]]), skin))])
    pose = scene.actors[0].require_pose()
    pose.scales[:] = 1.0, scale, 1.0
    draw(offscreen, scene, LIT)
    assert (regions(offscreen, scene, front()) == ()) is is_hidden


def test_negative_weights_have_no_bound_so_all_back_faces_are_drawn(offscreen) -> None:
    mesh = closed(8)
    binding = skin_from_lists([[(0, 1.5), (0, -0.5)] for _ in mesh.positions], np.eye(4)[None])
    scene = Scene([Actor(Figure("ball", mesh, skeleton([-1], [[0.0, 0.0, 0.0]]), binding))])
    draw(offscreen, scene, LIT)
    assert regions(offscreen, scene, front()) is None
