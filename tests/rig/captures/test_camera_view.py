"""Moving cameras: their placement at frames, between frames and across gaps."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.rig.captures.cameras import CameraMotion, CameraView, motion_times, placed_view, view_at
from viewer.rig.geometry.rotation import axis_rotations
from viewer.rig.motion.timing import Timing

ROTATIONS = axis_rotations(1, np.array([0.0, np.pi / 2]))
CENTERS = np.array([[0.0, 1.0, 0.0], [2.0, 1.0, 0.0]])


def moving(rows: list[int]) -> CameraView:
    translations = -np.einsum("nab,nb->na", ROTATIONS, CENTERS)
    motion = CameraMotion(Timing(10.0, rows), ROTATIONS, translations)
    return CameraView("video", np.eye(3), ROTATIONS[0], translations[0], motion=motion)


def test_fixed_camera_is_the_same_at_all_times() -> None:
    view = CameraView("1", np.eye(3), np.eye(3), np.zeros(3))
    assert view_at(view, 5.0) is view


@pytest.mark.parametrize(("seconds", "row"), [(0.0, 0), (0.1, 1), (-3.0, 0), (9.0, 1)])
def test_moving_camera_has_the_placement_of_its_frame(seconds: float, row: int) -> None:
    view = view_at(moving([0, 1]), seconds)
    assert_allclose(view.rotation, ROTATIONS[row], atol=1e-12)
    assert_allclose(-view.rotation.T @ view.translation, CENTERS[row], atol=1e-12)


@pytest.mark.parametrize(("rows", "seconds"), [([0, 1], 0.05), ([0, -1, 1], 0.1)])
def test_halfway_between_frames_rotation_and_centre_are_interpolated(
    rows: list[int], seconds: float
) -> None:
    view = view_at(moving(rows), seconds)
    assert_allclose(view.rotation, axis_rotations(1, np.array(np.pi / 4)), atol=1e-12)
    assert_allclose(-view.rotation.T @ view.translation, [1.0, 1.0, 0.0], atol=1e-12)
    assert view.motion is None


def test_camera_placed_with_its_scene_shows_the_same_pixels() -> None:
    placement = np.eye(4)
    placement[:3, :3] = axis_rotations(0, np.array(np.pi)) @ axis_rotations(2, np.array(0.3))
    placement[:3, 3] = 4.0, -1.0, 2.5
    point = np.array([0.4, 0.2, 7.0])
    before = moving([0, -1, 1])
    after = placed_view(before, placement)
    for seconds in (0.0, 0.1, 0.17):
        old, new = view_at(before, seconds), view_at(after, seconds)
        moved = placement[:3, :3] @ point + placement[:3, 3]
        seen = new.rotation @ moved + new.translation
        assert_allclose(seen, old.rotation @ point + old.translation, atol=1e-12)
    assert_allclose(after.rotation, view_at(after, 0.0).rotation)


def test_camera_scaled_with_its_scene_shows_the_same_pixels() -> None:
    placement = np.diag([0.01, 0.01, 0.01, 1.0])
    placement[:3, :3] = placement[:3, :3] @ axis_rotations(1, np.array(0.4))
    placement[:3, 3] = 4.0, -1.0, 2.5
    point, before = np.array([40.0, 20.0, 700.0]), moving([0, -1, 1])
    after = placed_view(before, placement)
    for seconds in (0.0, 0.1, 0.17):
        old, new = view_at(before, seconds), view_at(after, seconds)
        seen = new.rotation @ (placement[:3, :3] @ point + placement[:3, 3]) + new.translation
        # Only the depths of all points change, by the same factor.
        assert_allclose(seen, 0.01 * (old.rotation @ point + old.translation), atol=1e-12)
        assert_allclose(new.rotation @ new.rotation.T, np.eye(3), atol=1e-12)


def test_clipping_planes_are_scaled_with_the_scene() -> None:
    view = CameraView("1", np.eye(3), np.eye(3), np.zeros(3), near=5.0, far=2000.0)
    after = placed_view(view, np.diag([0.01, 0.01, 0.01, 1.0]))
    assert (after.near, after.far) == pytest.approx((0.05, 20.0))
    endless = placed_view(replace(view, near=None, far=None), np.eye(4))
    assert (endless.near, endless.far) == (None, None)


def test_motion_times_skip_gaps_and_include_both_ends() -> None:
    assert_allclose(motion_times(moving([-1, 0, -1, 1]), 5), [0.1, 0.3])
    rotations = np.tile(np.eye(3), (11, 1, 1))
    motion = CameraMotion(Timing(10.0, np.arange(11)), rotations, np.zeros((11, 3)))
    view = CameraView("video", np.eye(3), np.eye(3), np.zeros(3), motion=motion)
    assert_allclose(motion_times(view, 3), [0.0, 0.5, 1.0])
    assert_allclose(motion_times(CameraView("1", np.eye(3), np.eye(3), np.zeros(3)), 3), [0.0])
