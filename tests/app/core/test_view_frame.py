"""Projection between scene and window, compared with hand-calculated pinhole projections."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.app.core.view_frame import ViewFrame
from viewer.rendering.camera import Camera

BOX = np.array([[-1.0] * 3, [1.0] * 3])
RECT = (100.0, 50.0, 400.0, 200.0)


def frame(**settings) -> ViewFrame:
    """Return the view frame of a camera at (0, 0, 5) looking along -z."""
    camera = Camera(distance=5.0, azimuth=0.0, inclination=0.0, fov=90.0, **settings)
    return ViewFrame(camera.projection_matrix(2.0, BOX) @ camera.view_matrix(), RECT)


def test_points_project_as_through_a_pinhole() -> None:
    # With a 90 degree field of view, the height of the upper edge above the axis equals
    # its distance.
    assert_allclose(frame().project(np.zeros(3)), [300, 150], atol=1e-9)
    assert_allclose(frame().project(np.array([0.0, 5.0, 0.0])), [300, 50], atol=1e-9)
    assert_allclose(frame().project(np.array([1.0, 0.0, 3.0])), [300 + 100 / 2, 150], atol=1e-9)


def test_points_behind_the_eye_are_not_visible() -> None:
    seen = frame().project(np.array([[0.0, 0, 0], [0, 0, 6], [0, 0, 5]]))
    assert np.isfinite(seen[0]).all() and np.isnan(seen[1:]).all()
    assert frame().place(np.array([0.0, 0, 6])) is None


@pytest.mark.parametrize("parallel", [False, True])
def test_window_positions_unproject_to_points_at_a_depth(parallel) -> None:
    view, point = frame(orthographic=parallel), np.array([0.5, -0.3, 1.0])
    found = view.at_depth_of(np.array([0.0, 0.0, 1.0]), view.place(point))
    assert_allclose(found, point, atol=1e-9)


def test_world_size_of_a_pixel_grows_with_depth() -> None:
    # At the target, 200 window units are 2 * 5 units of the scene.
    assert frame().unit_length(np.zeros(3)) == pytest.approx(10 / 200)
    assert frame().unit_length(np.array([0.0, 0.0, 3.0])) == pytest.approx(4 / 200)
    assert frame(orthographic=True).unit_length(np.array([0.0, 0, 3])) == pytest.approx(10 / 200)


def test_rays_run_from_the_eye_through_the_pixel() -> None:
    origin, direction = frame().ray((350.0, 150.0))
    assert_allclose(direction, np.array([0.5, 0, -1]) / np.hypot(0.5, 1), atol=1e-9)
    assert_allclose(np.cross(origin - [0, 0, 5], direction), 0, atol=1e-9)
    _, parallel = frame(orthographic=True).ray((350.0, 150.0))
    assert_allclose(parallel, [0, 0, -1], atol=1e-9)
