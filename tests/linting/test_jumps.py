"""Jumps of the root that are slower than the limit of all joints, and joints that keep turning."""

from dataclasses import replace

import numpy as np
import pytest
from linting.planted import limited_in_degrees
from linting.sound import column

from viewer.linting import LintOptions, lint_scene
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor, Scene

RATE = 60  # at which clips of curves are checked; their frames are counted at 30 per second


def jumps_of(places: np.ndarray, options: LintOptions | None = None) -> list[list[int]]:
    """Return the frames of each reported jump of a column that moves through these places."""
    figure = column()
    times = np.arange(len(places)) / RATE
    linear = (("linear", "linear"),)
    channels = [
        Channel(target, times, places if target == 0 else 0.0 * times, linear * len(times))
        for target in range(figure.skeleton.n_dofs)
    ]
    clip = Clip("a", tuple(channels), 0.0, float(times[-1]))
    found = lint_scene(Scene([Actor(figure, clip=clip)]), options)
    return [finding.frames.tolist() for finding in found if finding.code == "C003"]


# The skeleton is 2 units high: the limits are 30 for all joints, and 10 units per second for jumps.
# Of a body that rests before and after, they are 0.08 units within a frame, which is 4.8 a second.
@pytest.mark.parametrize(
    ("speed", "frames"), [(4.0, []), (6.0, [[10]]), (20.0, [[10]]), (-20.0, [[10]])]
)
def test_a_root_that_stands_before_and_after_a_fast_step_jumps(speed, frames):
    assert jumps_of(np.where(np.arange(40) < 20, 0.0, speed / RATE)) == frames


def test_a_root_that_keeps_moving_fast_does_not_jump():
    assert jumps_of(20.0 / RATE * np.arange(40)) == []


def test_a_root_that_begins_to_move_does_not_jump():
    assert jumps_of(np.maximum(np.arange(40) - 20, 0) * 6.0 / RATE) == []


def test_repeated_frames_are_no_jumps():
    assert jumps_of(20.0 / RATE * (np.arange(40) // 2)) == []


@pytest.mark.parametrize("held", [12, 20])
def test_poses_that_are_held_throughout_are_blocked_on_purpose(held):
    assert jumps_of(6.0 / RATE * (np.arange(100) // held)) == []


def test_a_root_that_is_displaced_twice_jumps_twice():
    assert jumps_of(6.0 / RATE * (np.arange(100) // 40)) == [[20, 40]]


def test_a_given_limit_replaces_that_of_jumps():
    places = np.where(np.arange(40) < 20, 0.0, 20.0 / RATE)
    assert jumps_of(places, LintOptions(max_speed=25.0)) == []
    assert jumps_of(places, LintOptions(max_speed=15.0)) == [[10]]


@pytest.mark.parametrize(("turns", "codes"), [(0.3, ["S014"]), (5.0, [])])
def test_wide_limits_are_those_of_a_wheel_if_the_motion_turns_it(turns, codes):
    """Limits from -10 to 140 about z; the joint turns within 10 s."""
    linear = (("linear", "linear"),) * 2
    turning = Channel(8, np.array([0.0, 10.0]), np.array([0.0, 2.0 * np.pi * turns]), linear)
    clip = Clip("a", (turning,), 0.0, 10.0)
    found = lint_scene(Scene([Actor(limited_in_degrees(), clip=clip)]))
    assert [one.code for one in found if one.code == "S014"] == codes


@pytest.mark.parametrize(
    ("limits", "codes"),
    [
        ([(-100.0, 100.0)], []),
        ([(-62.83, 62.83)], []),
        ([(-90.0, 90.0)], ["S014"]),
        ([(-100.0, 100.0), (-10.0, 140.0)], ["S014"]),
    ],
)
def test_limits_of_whole_turns_or_100_radians_are_endless(limits, codes):
    """The joint has these limits about x and y, and no motion."""
    figure = column()
    bounds = figure.skeleton.dof_limits.copy()
    bounds[6 : 6 + len(limits)] = limits
    wide = replace(figure, skeleton=replace(figure.skeleton, dof_limits=bounds))
    found = lint_scene(Scene([Actor(wide)]))
    wide_ones = [one for one in found if one.code == "S014"]
    assert [one.code for one in wide_ones] == codes
    # The one that is named is the last, not the endless one before it.
    said = f"{limits[-1][0]:g} to {limits[-1][1]:g})"
    assert all(said in str(one.diagnostic) for one in wide_ones)


@pytest.mark.parametrize(("turned", "codes"), [(0.0, ["C003"]), (30.0, [])])
def test_body_that_takes_another_held_pose_is_blocked(turned, codes):
    """The root steps by 0.2 and 0.4 units after 1 and 2 s of 3 s; the joint above it may turn."""
    figure = column()
    count = 90
    places = np.zeros((count, 2, 3))
    places[:, 0, 0] = 0.2 * (np.arange(count) // 30)
    half = np.radians(0.5 * turned) * (np.arange(count) // 30 % 2)
    rotations = np.zeros((count, 2, 4))
    rotations[..., 3] = 1.0
    rotations[:, 1] = np.stack([np.sin(half), 0 * half, 0 * half, np.cos(half)], axis=1)
    clip = SampledClip("a", Timing(30.0, np.arange(count)), rotations, places)
    found = lint_scene(Scene([Actor(figure, clip=clip)]))
    assert [one.code for one in found if one.code == "C003"] == codes
