"""Images of actors whose placement is singular because it flattens or scales to zero."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rendering.front_view import alone, drawn, front_view, grid_figure

from viewer.rendering.offscreen import Offscreen
from viewer.rendering.view import normal_matrix

SHEAR = np.array([[2.0, 1.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, -0.5]])


def test_normals_remain_perpendicular_to_the_surface():
    along, across = np.array([1.0, 2.0, 3.0]), np.array([-2.0, 1.0, 0.5])
    normal = normal_matrix(SHEAR) @ np.cross(along, across)
    assert_allclose([normal @ (SHEAR @ along), normal @ (SHEAR @ across)], 0.0, atol=1e-12)
    assert_allclose(normal_matrix(SHEAR) @ SHEAR.T, np.eye(3), atol=1e-12)


def test_normals_of_a_flattened_surface_are_perpendicular_to_the_plane():
    flat = np.diag([2.0, 0.0, 3.0])
    # Only the plane y = 0 remains; slanted surfaces are projected onto it.
    normals = np.array([[0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, -1.0, 2.0]]) @ normal_matrix(flat).T
    assert_allclose(normals[:, [0, 2]], 0.0)
    assert (np.sign(normals[:, 1]) == [1.0, 1.0, -1.0]).all()


@pytest.fixture(scope="module")
def offscreen():
    with Offscreen() as result:
        yield result


@pytest.mark.parametrize("placed", [True, False])
def test_actor_scaled_to_zero_is_invisible(offscreen, placed):
    scene = alone(grid_figure())
    if placed:
        scene.actors[0].placement = np.diag([0.0, 0.0, 0.0, 1.0])
    else:
        scene.actors[0].pose.figure_scale = 0.0
    assert not drawn(front_view(offscreen, scene)).any()


def test_actor_flattened_along_the_view_direction_looks_the_same(offscreen):
    scene = alone(grid_figure())
    before = front_view(offscreen, scene)
    scene.actors[0].placement = np.diag([1.0, 1.0, 0.0, 1.0])
    np.testing.assert_array_equal(front_view(offscreen, scene), before)


def test_normals_of_almost_flat_meshes_fit_into_single_precision() -> None:
    """Their inverse has entries of 1e60; only the direction of a normal matters."""
    found = normal_matrix(np.diag([1.0, 1.0, 1e-60])).astype(np.float32)
    assert_allclose(found @ [1.0, 1.0, 1.0], [0.0, 0.0, 1.0], atol=1e-30)
