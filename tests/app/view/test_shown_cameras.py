"""Show cameras and Image brightness of the Camera panel."""

import numpy as np
import pytest
from formats.filmed_capture import write_filmed
from numpy.testing import assert_allclose
from rendering.moving import moving_camera

from viewer.app.view.camera_panel import look_through
from viewer.rendering.camera import eye


@pytest.fixture
def filmed(drive, tmp_path):
    """A driver on the Camera panel of a capture with one camera and images of grey 100 / 255."""
    driver = drive(write_filmed(tmp_path / "take"), size=(1000, 900), pixels_per_point=1.0)
    driver.state.options.grid = False
    driver.state.options.background = "white"
    driver.show_panel("Camera")
    return driver


def picture(driver) -> np.ndarray:
    driver.step(3)
    return np.array(driver.scene_picture())[..., :3].astype(int)


def test_show_cameras_draws_frusta_with_their_images(filmed):
    # The camera stands 5 m from the keypoints.
    filmed.state.camera.distance, filmed.state.camera.azimuth = 25.0, 40.0
    plain = picture(filmed)
    filmed.click("Show cameras")
    assert filmed.state.options.cameras
    shown = picture(filmed)
    changed = np.abs(shown - plain).max(axis=2) > 20
    image = (np.abs(shown - 100) <= 2).all(axis=2) & changed
    lines = changed & ~image
    assert image.sum() > 20 and lines.sum() > 20
    filmed.click("Show cameras")
    assert not filmed.state.options.cameras
    assert np.array_equal(picture(filmed), plain)


def test_image_brightness_dims_the_image_of_the_camera(filmed):
    assert "Image brightness" not in filmed.state.item_rects
    filmed.pick("Calibrated camera", 1)
    assert filmed.state.camera.fixed is filmed.state.scene.views[0]
    grey = []
    for value in ("", "1", "0.25", "0"):
        if value:
            filmed.enter_value("Image brightness", value)
        # The border of the image contains no points.
        shown = picture(filmed)
        grey.append(np.median(shown[:, shown.shape[1] // 2 - 60]))
    # 100 of 255 in the file, dimmed to 60 % at first; without an image the background is white.
    assert grey == [60, 100, 25, 255]


def test_view_follows_a_moving_camera_during_playback(filmed):
    state = filmed.state
    view = moving_camera()
    state.scene.views = (view,)
    look_through(state, 0)
    state.clock.seek(1 / 30)
    filmed.step(2)
    # A third of the way from its first to its second frame.
    assert_allclose(eye(state.camera)[0], 0.2 / 3.0, atol=1e-9)
    assert state.camera.fixed is view
