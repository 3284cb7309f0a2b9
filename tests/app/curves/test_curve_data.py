"""Curves of a motion as plotted: names, numbering, and exact values on frames."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rig.hand_made import skeleton

from viewer.app.curves.data import channel_of, curves_of, keyed_values, sampled_points
from viewer.rig.captures.points import PointClip, PointLayout
from viewer.rig.figure import Figure
from viewer.rig.motion.clip import Channel, Clip
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing
from viewer.rig.scene import Actor


def rig():
    rows = [(0, "tx", 0.0), (0, "x", 0.0), (1, "z", 0.0)]
    return Figure("arm", skeleton=skeleton([-1, 0], rows, ["root", ""]))


def turning(angles, rows=None, rate=10.0, **more):
    turns = np.zeros((len(angles), 2, 4))
    turns[:, :, 3] = 1.0
    turns[:, 1, 1] = np.sin(np.asarray(angles) / 2)
    turns[:, 1, 3] = np.cos(np.asarray(angles) / 2)
    rows = np.arange(len(angles)) if rows is None else np.array(rows)
    return SampledClip("turn", Timing(rate, rows, start=5.0), turns, **more)


def test_keyed_clip_has_a_curve_per_dof():
    curves = curves_of(Actor(rig(), clip=Clip("c", (), 0.0, 1.0)))
    assert [(c.label, c.number, c.axis, c.is_angle) for c in curves] == [
        ("root.tx", 0, 0, False),
        ("root.x", 0, 0, True),
        ("#1.z", 1, 2, True),
    ]


def test_sampled_animation_has_curves_for_position_and_three_angles_per_joint():
    labels = [c.label for c in curves_of(Actor(rig(), clip=turning([0.0])))]
    joints = [f"{name}.{axis}" for name in ("root", "#1") for axis in "xyz"]
    assert labels == ["figure.x", "figure.y", "figure.z", *joints]


def test_captured_points_have_coordinate_curves_and_static_figures_have_none():
    layout = PointLayout("one", ("nose",), np.zeros((0, 2)), np.zeros(1))
    clip = PointClip("p", Timing(10.0, np.arange(1)), np.ones((1, 1, 4)))
    labels = [c.label for c in curves_of(Actor(Figure("p", points=layout), clip=clip))]
    assert labels == ["nose.x", "nose.y", "nose.z"]
    assert curves_of(Actor(Figure("p", points=layout))) == ()


def test_channels_are_found_by_their_target():
    second = Channel(2, np.zeros(1), np.full(1, 7.0), (("flat", "flat"),))
    clip = Clip("c", (second,), 0.0, 1.0)
    assert channel_of(clip, 2) is second and channel_of(clip, 0) is None
    times = np.array([0.0, 3.0])
    assert keyed_values(clip, (0, 2, 1), times).tolist() == [[0, 7, 0], [0, 7, 0]]
    assert keyed_values(clip, (2,), times).tolist() == [[7], [7]]


def test_curves_pass_through_frames_and_angles_are_unwrapped():
    angles = np.linspace(0, 1.4, 15)
    clip = turning(angles)
    times, values = sampled_points(clip, 3 + 3 * 1 + 1, 0.0, 99.0)
    assert_allclose(times, 5.0 + np.arange(15) / 10, atol=1e-12)
    assert_allclose(values, angles, atol=1e-12)
    assert_array_equal(sampled_points(clip, 7, 0, 99)[1], values)
    # Full rotations about z, which is not the middle axis, do not wrap around.
    turns = np.zeros((40, 1, 4))
    turns[:, 0, 2], turns[:, 0, 3] = np.sin(np.arange(40) / 4), np.cos(np.arange(40) / 4)
    long = SampledClip("z", Timing(10.0, np.arange(40)), turns)
    assert_allclose(sampled_points(long, 5, 0, 9)[1], np.arange(40) / 2, atol=1e-9)


def test_missing_frames_leave_gaps_in_curves():
    _, values = sampled_points(turning([0.1, 0.2, 0.3], rows=[0, -1, -1, 1, 2]), 7, 0, 9)
    assert_array_equal(np.isnan(values), [False, True, True, False, False])
    assert_allclose(values[[0, 3, 4]], [0.1, 0.2, 0.3], atol=1e-12)


def test_position_combines_figure_and_root():
    inner = np.zeros((2, 2, 3))
    inner[:, 0] = [[1, 2, 3], [4, 5, 6]]
    clip = turning([0, 0], figure_translations=np.array([[10.0, 0, 0], [20, 0, 0]]),
                   translations=inner)  # fmt: skip
    assert [sampled_points(clip, row, 0, 9)[1].tolist() for row in range(3)] == [
        [11, 24],
        [2, 5],
        [3, 6],
    ]
    assert sampled_points(turning([0, 0]), 1, 0, 9)[1].tolist() == [0, 0]


def test_undetected_points_leave_gaps():
    points = np.ones((3, 2, 4))
    points[:, 1, 2] = 4, 5, 6
    points[1, 1, 3] = 0.0
    clip = PointClip("p", Timing(10.0, np.array([0, -1, 1, 2])), points)
    _, values = sampled_points(clip, 5, 0, 9)
    assert_array_equal(values, [4, np.nan, np.nan, 6])


@pytest.mark.parametrize(("low", "high"), [(5.0, 1005.0), (5.0, 6.0), (500.0, 510.0), (990, 2e3)])
def test_long_motions_are_decimated_only_as_needed(low, high):
    count, rate = 10_000, 10.0
    angles = np.sin(np.arange(count) / 50)
    clip = turning(angles, rate=rate)
    times, values = sampled_points(clip, 7, low, high)
    assert len(times) <= 2000
    frames = np.round((times - 5.0) * rate).astype(int)
    assert_allclose(values, angles[frames], atol=1e-12)
    # The visible range is covered from end to end.
    assert times[0] <= low and (times[-1] >= high or frames[-1] >= count - 1 - np.diff(frames)[0])
    # If there are few frames, each is plotted.
    if (high - low) * rate < 900:
        assert (np.diff(frames) == 1).all()


def test_adjacent_views_share_their_samples():
    clip = turning(np.zeros(10_000))
    first = sampled_points(clip, 7, 100.0, 110.0)
    assert sampled_points(clip, 7, 100.5, 110.5) is first
