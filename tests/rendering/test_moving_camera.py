"""Moving calibrated cameras: matrices over time, frusta, and release from the calibrated view."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rendering.moving import FILMED, RATE, SIZE, moving_camera, pixel

from viewer.rendering.camera import camera_from_view, eye, follow_view
from viewer.rendering.camera_views import drawn_cameras, with_cameras
from viewer.rendering.options import DisplayOptions
from viewer.rendering.recorder import Recording, _Cameras
from viewer.rig.captures.cameras import view_at
from viewer.rig.scene import Scene

POINT = np.array([0.3, 0.7, -0.4])
BOX = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])


def drawn_pixel(camera) -> np.ndarray:
    """Return the pixel of the point by the camera's matrices; pixel centres are integers."""
    matrix = camera.projection_matrix(SIZE[0] / SIZE[1], BOX) @ camera.view_matrix()
    clip = matrix @ np.append(POINT, 1.0)
    x, y = clip[:2] / clip[3]
    return np.array([(x + 1.0) / 2.0 * SIZE[0], (1.0 - y) / 2.0 * SIZE[1]]) - 0.5


@pytest.mark.parametrize("frame", range(FILMED))
def test_point_is_drawn_at_its_pixel_in_every_frame(frame):
    view = moving_camera()
    camera = camera_from_view(view, SIZE, "y", seen=view_at(view, frame / RATE))
    assert_allclose(drawn_pixel(camera), pixel(view, frame, POINT), atol=1e-9)
    assert camera.fixed is view


def test_time_moves_the_camera_and_released_camera_keeps_the_position():
    view = moving_camera()
    camera = camera_from_view(view, SIZE, "y")
    follow_view(camera, SIZE, Scene([], time=0.4), BOX)
    assert_allclose(drawn_pixel(camera), pixel(view, 4, POINT), atol=1e-9)
    camera.fixed = None
    assert_allclose(eye(camera), [0.8, 0.5, 5.0], atol=1e-9)
    # The camera has rotated by 12 degrees to the left, about +y.
    backward = camera.rotation()[2]
    assert_allclose(backward, [np.sin(np.radians(12)), 0, np.cos(np.radians(12))], atol=1e-9)


def test_released_camera_keeps_its_position():
    camera = camera_from_view(moving_camera(), SIZE, "y")
    camera.fixed = None
    before = camera.view_matrix()
    follow_view(camera, SIZE, Scene([], time=0.4), BOX)
    assert_allclose(camera.view_matrix(), before, atol=0)


def test_frusta_are_at_the_camera_position_of_the_scene_time():
    view, options = moving_camera(), DisplayOptions(cameras=True)
    scene = Scene([], views=(view,), time=0.3)
    (drawn,) = drawn_cameras(scene, None, options)
    assert_allclose(-drawn.rotation.T @ drawn.translation, [0.6, 0.5, 5.0], atol=1e-12)
    assert drawn_cameras(scene, view, options) == []
    framed = with_cameras(scene, options, np.zeros((1, 3)))
    assert framed[:, 0].max() >= 0.8  # the last frame of the camera


def test_recorded_frames_follow_the_time():
    view = moving_camera()
    scene = Scene([], views=(view,))
    camera = camera_from_view(view, SIZE, "y")
    recording = Recording(scene, np.array([0.0, 0.2]), camera, SIZE)
    scene.time = 0.2
    seen = _Cameras(recording).at(1, scene)
    assert_allclose(drawn_pixel(seen), pixel(view, 2, POINT), atol=1e-9)
