"""Evaluation of many curves at many times, compared with a simple implementation of the format."""

import itertools
import math

import numpy as np
import pytest

from viewer.rig.motion.clip import EXTRAPOLATIONS, Channel, Clip, evaluate, evaluate_all

RULES = ("flat", "linear", "smooth", 1.75)
TANGENT_PAIRS = tuple(itertools.product(RULES, repeat=2))
MODE_PAIRS = tuple(itertools.product(EXTRAPOLATIONS, repeat=2))


class PlainCurve:
    """Evaluate one curve at one time, as a Bezier curve by de Casteljau's construction."""

    def __init__(self, channel: Channel) -> None:
        self.times, self.values = channel.times.tolist(), channel.values.tolist()
        self.modes = channel.extrapolation
        self.incoming = [self.slope(i, pair[0], -1) for i, pair in enumerate(channel.tangents)]
        self.outgoing = [self.slope(i, pair[1], 1) for i, pair in enumerate(channel.tangents)]

    def slope(self, key, rule, side):
        last = len(self.times) - 1
        if last == 0 or rule == "flat":
            return 0.0
        if not isinstance(rule, str):
            return rule
        if key == 0:
            return self.rise(0, 1)
        if key == last:
            return self.rise(last - 1, last)
        if rule == "smooth":
            return self.rise(key - 1, key + 1)
        return self.rise(key - 1, key) if side < 0 else self.rise(key, key + 1)

    def rise(self, i, j):
        run = self.times[j] - self.times[i]
        return (self.values[j] - self.values[i]) / run if run else 0.0

    def __call__(self, time):
        if not self.times:
            return 0.0
        first, last = self.times[0], self.times[-1]
        if first == last:
            return self.values[-1]
        if time < first:
            return self.outside(time, self.modes[0], 0, self.incoming[0])
        if time > last:
            return self.outside(time, self.modes[1], -1, self.outgoing[-1])
        return self.inside(time)

    def outside(self, time, mode, end, slope):
        first, last = self.times[0], self.times[-1]
        period = last - first
        turn = math.floor((time - first) / period)
        back = min(max(time - turn * period, first), last)
        if mode == "constant":
            return self.values[end]
        if mode == "linear":
            return self.values[end] + slope * (time - self.times[end])
        if mode == "cycle":
            return self.inside(back)
        if mode == "cycle_offset":
            return self.inside(back) + turn * (self.values[-1] - self.values[0])
        return self.inside(back if turn % 2 == 0 else first + last - back)

    def inside(self, time):
        if time >= self.times[-1]:
            return self.values[-1]
        key = max(i for i, at in enumerate(self.times) if at <= time)
        h = self.times[key + 1] - self.times[key]
        u = (time - self.times[key]) / h
        p0, p1 = self.values[key], self.values[key + 1]
        points = [
            p0,
            p0 + h * self.outgoing[key] / 3,
            p1 - h * self.incoming[key + 1] / 3,
            p1,
        ]
        while len(points) > 1:
            points = [a + u * (b - a) for a, b in itertools.pairwise(points)]
        return points[0]


def random_channel(rng, target, count, tangents=None, modes=None):
    times = rng.uniform(-8, 8) + np.cumsum(rng.uniform(0.05, 3.0, count))
    if tangents is None:
        tangents = [TANGENT_PAIRS[i] for i in rng.integers(len(TANGENT_PAIRS), size=count)]
    if modes is None:
        modes = MODE_PAIRS[rng.integers(len(MODE_PAIRS))]
    return Channel(target, times, rng.normal(size=count), tuple(tangents), modes)


def assert_is_the_plain_curve(channels, times):
    targets, values = evaluate_all(Clip("random", tuple(channels), 0.0, 1.0), times)
    assert targets.tolist() == [channel.target for channel in channels]
    wanted = np.array([[PlainCurve(channel)(time) for channel in channels] for time in times])
    wanted = wanted.reshape(len(times), len(channels))
    # Times an hour away have rounding errors of 1e-13 s; slopes are below 100 per second.
    np.testing.assert_allclose(values, wanted, atol=1e-10, rtol=1e-11)
    for column, channel in enumerate(channels):
        np.testing.assert_array_equal(evaluate(channel, times), values[:, column])


@pytest.mark.parametrize("modes", MODE_PAIRS, ids="-".join)
def test_every_pair_of_tangents_and_extrapolations_agrees(modes) -> None:
    rng = np.random.default_rng(11)
    channels = [
        random_channel(rng, 3 * number, 4, [pair, TANGENT_PAIRS[-number], pair, pair], modes)
        for number, pair in enumerate(TANGENT_PAIRS)
    ]
    assert_is_the_plain_curve(channels, rng.uniform(-60, 60, 97))


@pytest.mark.parametrize("seed", range(8))
def test_random_clips_with_few_and_many_keys_agree(seed) -> None:
    rng = np.random.default_rng(seed)
    counts = [0, 1, 2, 3, 30, *rng.integers(0, 9, 12).tolist()]
    channels = [random_channel(rng, row, count) for row, count in enumerate(counts)]
    # Between the keys, before all of them, and up to an hour away; unsorted.
    assert_is_the_plain_curve(channels, rng.uniform(-20, 40, 60))
    assert_is_the_plain_curve(channels, rng.uniform(-3700, 3700, 60))


def test_batch_of_times_has_the_same_values_as_single_times() -> None:
    """Long lists of times are searched channel by channel, short lists for all channels at once."""
    rng = np.random.default_rng(5)
    clip = Clip("two ways", tuple(random_channel(rng, row, 7) for row in range(5)), 0.0, 1.0)
    times = rng.uniform(-30, 30, 5000)
    _, together = evaluate_all(clip, times)
    one_by_one = np.concatenate([evaluate_all(clip, np.array([time]))[1] for time in times[:50]])
    np.testing.assert_array_equal(together[:50], one_by_one)
    wanted = [[PlainCurve(channel)(time) for channel in clip.channels] for time in times[::97]]
    np.testing.assert_allclose(together[::97], wanted, atol=1e-10)


@pytest.mark.parametrize("mode", EXTRAPOLATIONS)
@pytest.mark.parametrize("rule", ["flat", "linear", "smooth", -3.5], ids=str)
def test_keys_are_reproduced_exactly(mode, rule) -> None:
    times = np.array([-0.7, 0.1, 0.3, 1.9, 2.2])
    values = np.array([0.1, -0.3, 7.7, 1e-9, 0.7])
    curve = Channel(0, times, values, ((rule, rule),) * 5, (mode, mode))
    np.testing.assert_array_equal(evaluate(curve, times), values)


def test_ends_repeat_after_whole_periods() -> None:
    """The times are first + k T; the period T is a power of two, so that they are exact."""
    turns = np.arange(-5, 6)
    times, values = np.array([0.5, 1.0, 2.5]), np.array([3.0, -1.0, 4.0])

    def at(mode):
        curve = Channel(0, times, values, (("smooth", "smooth"),) * 3, (mode, mode))
        return evaluate(curve, 0.5 + 2.0 * turns)

    # For k = 0 and 1, the times are those of the first and last key.
    cycle = at("cycle")
    assert np.isin(cycle, (3.0, 4.0)).all() and cycle[5] == 3.0 and cycle[6] == 4.0
    np.testing.assert_array_equal(at("cycle_offset"), 3.0 + turns)
    np.testing.assert_array_equal(at("bounce"), np.where(turns % 2 == 0, 3.0, 4.0))


@pytest.mark.parametrize("start", [3600.0, -36000.0, 1e6])
def test_hours_of_playback_do_not_drift(start) -> None:
    """A period of 0.1 s, which is not exact in floating point, is repeated many thousand times."""
    times = np.array([0.0, 0.04, 0.1])
    curve = Channel(0, times, np.array([0.0, 1.0, 0.0]), (("smooth", 0.0),) * 3, ("cycle", "cycle"))
    periods = round(start / 0.1)
    for phase in (0.01, 0.03, 0.07):
        far = evaluate(curve, np.array(periods * 0.1 + phase))
        # Half a unit in the last place of the time, times the steepest slope of 40 per second.
        assert far == pytest.approx(float(evaluate(curve, np.array(phase))), abs=40 * 2e-10)


def test_times_an_hour_away_exceed_float32_precision() -> None:
    """After an hour, a frame of 1/1000 s changes the value, which it would not in float32."""
    curve = Channel(
        0, np.array([0.0, 1.0]), np.array([0.0, 1.0]), (("linear",) * 2,) * 2, ("cycle",) * 2
    )
    values = evaluate(curve, 3600.0 + np.array([0.25, 0.251, 0.252]))
    np.testing.assert_allclose(values, [0.25, 0.251, 0.252], atol=1e-12)


def test_outermost_of_coincident_keys_are_the_ends() -> None:
    times, values = np.array([1.0, 1.0, 2.0, 2.0]), np.array([5.0, 6.0, 7.0, 8.0])
    curve = Channel(0, times, values, ((2.0, 3.0),) * 4, ("constant", "linear"))
    np.testing.assert_array_equal(
        evaluate(curve, np.array([0.0, 1.0, 2.0, 3.0])), [5.0, 6.0, 8.0, 11.0]
    )


@pytest.mark.parametrize("mode", EXTRAPOLATIONS)
@pytest.mark.parametrize("gap", [1e-300, 5e-324, 1e-12])
def test_keys_closer_than_a_nanosecond_are_at_one_time(mode, gap) -> None:
    curve = Channel(
        0, np.array([0.0, gap]), np.array([1.0, 3e38]), (("linear", "smooth"),) * 2, (mode, mode)
    )
    np.testing.assert_array_equal(evaluate(curve, np.array([-1e30, 0.0, 1e38])), 3e38)


def test_largest_numbers_in_files_have_finite_results() -> None:
    big = 3.4e38
    for mode in EXTRAPOLATIONS:
        curve = Channel(
            0,
            np.array([-big, 0.0, 1e-8]),
            np.array([-big, big, -big]),
            (("linear", big), (-big, "smooth"), (big, big)),
            (mode, mode),
        )
        assert np.isfinite(evaluate(curve, np.array([-big, -1.0, 0.5e-8, 1.0, big]))).all()


def test_empty_clips_and_non_finite_times_are_supported() -> None:
    targets, values = evaluate_all(Clip("none", (), 0.0, 1.0), np.array([0.0, 1.0]))
    assert targets.shape == (0,) and values.shape == (2, 0)
    one = Channel(4, np.array([0.0, 1.0]), np.array([1.0, 2.0]), (("flat", "flat"),) * 2)
    targets, values = evaluate_all(Clip("one", (one,), 0.0, 1.0), np.zeros(0))
    assert targets.tolist() == [4] and values.shape == (0, 1)
    assert evaluate(one, np.zeros((2, 3))).shape == (2, 3)
    assert evaluate(one, np.array(0.5)) == 1.5
