"""Paths of joints and captured points: positions, times, and gaps."""

import numpy as np
import pytest
from rig.hand_made import skeleton

from viewer.errors import RigError
from viewer.rig.captures.points import PointClip, PointLayout
from viewer.rig.figure import Figure
from viewer.rig.motion.clip import Channel, Clip
from viewer.rig.motion.motion_paths import motion_path, path_times, segments
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing
from viewer.rig.scene import figure_pose

STILL = [0.0, 0.0, 0.0, 1.0]
QUARTER = [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]  # about z


def two_joints() -> Figure:
    """Return two joints; joint 1 is at x = 2 from joint 0, which rotates about z."""
    return Figure("f", skeleton=skeleton([-1, 0], [(0, "z", 0.0)], offsets=[[0, 0, 0], [2, 0, 0]]))


def capture(rows=(0, 1), **parts) -> SampledClip:
    turns = np.array([[STILL, STILL], [QUARTER, STILL]])
    return SampledClip("c", Timing(10.0, rows), turns, **parts)


def test_joint_path_follows_the_rotation_of_its_parent():
    path = motion_path(two_joints(), capture(), [1, 0])
    assert path.times.tolist() == [0.0, 0.1]
    assert path.present.all()
    assert np.allclose(path.points, [[[2, 0, 0], [0, 0, 0]], [[0, 2, 0], [0, 0, 0]]], atol=1e-12)


def test_path_includes_placement_and_interpolates_between_frames():
    clip = capture(figure_translations=[[0, 0, 0], [0, 0, 3.0]], figure_scales=[1.0, 2.0])
    path = motion_path(two_joints(), clip, [1], times=[0.05, 0.1])
    half = np.sqrt(0.5)
    assert np.allclose(path.points[:, 0], [[3 * half, 3 * half, 1.5], [0, 4, 3]], atol=1e-12)


def test_base_pose_supplies_values_that_the_clip_lacks():
    figure = two_joints()
    base = figure_pose(figure)
    base.figure_translation[:] = 5.0, 0.0, 0.0
    path = motion_path(figure, capture(), [1], base=base)
    assert np.allclose(path.points[:, 0], [[7, 0, 0], [5, 2, 0]], atol=1e-12)


def test_gaps_split_the_path():
    path = motion_path(two_joints(), capture(rows=(0, 1, -1, 0, 1, 0)), [0, 1])
    assert path.present[:, 0].tolist() == [True, True, False, True, True, True]
    points, times, which = segments(path)
    assert which.tolist() == [0, 0, 0, 1, 1, 1]
    assert np.allclose(times, [[0.0, 0.1], [0.3, 0.4], [0.4, 0.5]] * 2)
    assert np.allclose(points[3], [[2, 0, 0], [0, 2, 0]], atol=1e-12)
    assert np.allclose(points[5], [[0, 2, 0], [2, 0, 0]], atol=1e-12)


def test_keyed_paths_are_sampled_at_60_hz():
    figure = two_joints()
    channel = Channel(0, np.array([1.0, 2.0]), np.array([0.0, np.pi]), (("linear", "linear"),) * 2)
    clip = Clip("k", (channel,), 1.0, 2.0)
    times = path_times(clip)
    assert len(times) == 61 and times[0] == 1.0 and times[-1] == 2.0
    path = motion_path(figure, clip, [1])
    angle = np.pi * (path.times - 1.0)
    wanted = 2.0 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    assert np.allclose(path.points[:, 0], wanted, atol=1e-12)


@pytest.mark.parametrize(("length", "count"), [(0.0, 1), (0.01, 2), (1e6, 20_000)])
def test_very_short_and_very_long_paths_have_few_points(length, count):
    assert len(path_times(Clip("k", (), 0.0, length))) == count


def test_capture_paths_have_a_point_per_frame():
    timing = Timing(25.0, [0, -1, 0], start=2.0)
    clip = SampledClip("c", timing, np.tile(STILL, (1, 2, 1)))
    assert path_times(clip) == pytest.approx([2.0, 2.04, 2.08])


def test_long_captures_have_the_same_path_in_chunks():
    count = 9000  # more frames than one batch
    angles = np.linspace(0.0, 20.0, count)
    turns = np.tile(STILL, (count, 2, 1))
    turns[:, 0, 2], turns[:, 0, 3] = np.sin(angles / 2), np.cos(angles / 2)
    clip = SampledClip("c", Timing(60.0, np.arange(count)), turns)
    path = motion_path(two_joints(), clip, [1])
    wanted = 2.0 * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    assert np.allclose(path.points[:, 0], wanted, atol=1e-12)


def points_clip() -> tuple[Figure, PointClip]:
    points = np.zeros((4, 2, 4))
    points[:, 0, 0] = np.arange(4)
    points[:, 1, 1] = np.arange(4)
    points[:, :, 3] = [[1.0, 0.5], [1.0, 0.05], [0.0, 0.5], [1.0, 0.5]]
    layout = PointLayout("two", ("a", "b"), np.zeros((0, 2)), [0, 0])
    return Figure("p", points=layout), PointClip("p", Timing(1.0, [0, 1, 2, 3, -1, 3]), points)


def test_captured_points_have_paths_where_detected():
    figure, clip = points_clip()
    path = motion_path(figure, clip, [1, 0], min_confidence=0.1)
    assert path.present[:, 0].tolist() == [True, False, True, True, False, True]
    assert path.present[:, 1].tolist() == [True, True, False, True, False, True]
    points, _, which = segments(path)
    assert which.tolist() == [0, 1]
    assert points.tolist() == [[[0, 2, 0], [0, 3, 0]], [[0, 0, 0], [1, 0, 0]]]
    # Undetected points are absent for any minimum confidence.
    assert motion_path(figure, clip, [0]).present[2, 0] == np.False_


def test_clip_without_frames_has_no_path():
    figure, _ = points_clip()
    clip = PointClip("p", Timing(1.0, [-1, -1]), np.zeros((0, 2, 4)))
    path = motion_path(figure, clip, [0])
    assert not path.present.any()
    assert [len(part) for part in segments(path)] == [0, 0, 0]


def test_motion_of_another_skeleton_is_refused():
    clip = SampledClip("c", Timing(1.0, [0]), np.tile(STILL, (1, 5, 1)))
    with pytest.raises(RigError) as caught:
        motion_path(two_joints(), clip, [0])
    assert str(caught.value) == "clip c has 5 joints, but figure f has 2"
