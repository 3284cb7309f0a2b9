"""The ground grid and the shadows on it, which flat meshes on the ground hide."""

from dataclasses import replace

import numpy as np
from rendering.drawn_figures import scene_of
from rendering.plain_pictures import draw, plain

from viewer.rendering.camera import Camera
from viewer.rig.mesh import Mesh


def test_flat_mesh_on_the_ground_hides_the_grid(offscreen) -> None:
    """Its triangles and those of the grid have the same depth, up to rounding."""
    corners = np.array([[-1.7, 0, -1.3], [1.6, 0, -1.4], [1.9, 0, 1.2], [-1.8, 0, 1.5]])
    mesh = Mesh(
        positions=100.0 * corners,
        normals=np.tile([0.0, 1.0, 0.0], (4, 1)),
        triangles=np.array([[0, 2, 1], [0, 3, 2]], dtype=np.int32),
    )
    scene = scene_of(mesh)
    options = plain(background="#ff0000")
    for azimuth in (10.0, 40.0, 130.0, 250.0):
        # The camera is so close that the mesh fills the picture.
        camera = Camera(azimuth=azimuth, inclination=40.0, distance=120.0)
        empty = draw(offscreen, scene, replace(options, grid=False), camera, size=(160, 120))
        found = draw(offscreen, scene, replace(options, grid=True), camera, size=(160, 120))
        np.testing.assert_array_equal(found, empty)
        assert (empty[..., 1] > 0).all(), "the background is visible"
