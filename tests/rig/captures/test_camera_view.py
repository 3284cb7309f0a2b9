"""Moving cameras: their placement at frames, between frames and across gaps."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.rig.captures.camera_view import CameraMotion, CameraView, view_at
from viewer.rig.geometry.rotation import axis_rotations
from viewer.rig.motion.timing import Timing

ROTATIONS = axis_rotations(1, np.array([0.0, np.pi / 2]))
CENTERS = np.array([[0.0, 1.0, 0.0], [2.0, 1.0, 0.0]])


def moving(rows: list[int]) -> CameraView:
    translations = -np.einsum("nab,nb->na", ROTATIONS, CENTERS)
    motion = CameraMotion(Timing(10.0, rows), ROTATIONS, translations)
    return CameraView("video", np.eye(3), ROTATIONS[0], translations[0], motion=motion)


def test_a_fixed_camera_is_the_same_at_all_times() -> None:
    view = CameraView("1", np.eye(3), np.eye(3), np.zeros(3))
    assert view_at(view, 5.0) is view


@pytest.mark.parametrize(("seconds", "row"), [(0.0, 0), (0.1, 1), (-3.0, 0), (9.0, 1)])
def test_a_moving_camera_stands_where_its_frame_says(seconds: float, row: int) -> None:
    view = view_at(moving([0, 1]), seconds)
    assert_allclose(view.rotation, ROTATIONS[row], atol=1e-12)
    assert_allclose(-view.rotation.T @ view.translation, CENTERS[row], atol=1e-12)


@pytest.mark.parametrize(("rows", "seconds"), [([0, 1], 0.05), ([0, -1, 1], 0.1)])
def test_halfway_between_frames_it_is_rotated_by_half_and_its_centre_is_the_mean(
    rows: list[int], seconds: float
) -> None:
    view = view_at(moving(rows), seconds)
    assert_allclose(view.rotation, axis_rotations(1, np.array(np.pi / 4)), atol=1e-12)
    assert_allclose(-view.rotation.T @ view.translation, [1.0, 1.0, 0.0], atol=1e-12)
    assert view.motion is None
