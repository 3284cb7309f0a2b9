"""Curves of keys: tangent rules, extrapolation, and the check values of the real file of a walk."""

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from formats.mhr.mhr_files import N_EXPRESSIONS, N_IDENTITY, NAMES, forward, write
from numpy.testing import assert_allclose
from rigs import hand_made

import viewer
from viewer.diagnostics import Phrase
from viewer.errors import RigError
from viewer.formats import Source, read
from viewer.rigs.motion.body_motion import ParameterMotion, parameter_clip
from viewer.rigs.motion.clip import (
    EXTRAPOLATIONS,
    TANGENT_RULES,
    Channel,
    Clip,
    evaluate,
    evaluate_all,
    is_course_rig,
    misfit,
    slopes,
)
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor, pose_actors
from viewer.rigs.skeleton import DOF_KINDS
from viewer.rigs.skinning import deform

SHARED = Path(__file__).resolve().parents[3].parent / "shared" / "data" / "cse169"


def channel(keys: list[tuple[float, float, object, object]], before="constant", after="constant"):
    times, values, *_ = zip(*keys, strict=True)
    tangents = tuple((key[2], key[3]) for key in keys)
    return Channel(0, np.array(times), np.array(values), tangents, (before, after))


# Three keys; the two spans have slopes 2 and -1, and the slope from first to last key is 1.
KEYS = [(1.0, 0.0), (2.0, 2.0), (4.0, 0.0)]


@pytest.mark.parametrize(
    ("rule", "expected"),
    [
        ("flat", [[0, 0], [0, 0], [0, 0]]),
        ("linear", [[2, 2], [2, -1], [-1, -1]]),
        ("smooth", [[2, 2], [0, 0], [-1, -1]]),
    ],
)
def test_slopes_follow_the_tangent_rule(rule, expected):
    curve = channel([(t, v, rule, rule) for t, v in KEYS])
    np.testing.assert_allclose(slopes(curve), expected, atol=1e-15)


def test_slopes_accept_a_value_on_each_side():
    curve = channel([(0, 0, 13.7, -0.22), (1, 5, "flat", "linear")])
    np.testing.assert_allclose(slopes(curve), [[13.7, -0.22], [0, 5]])


def test_evaluate_equals_the_hermite_basis_inside_the_keys():
    """The expected values use the textbook basis h00, h10, h01, h11, unlike the code."""
    rng = np.random.default_rng(3)
    times = np.cumsum(rng.uniform(0.1, 2.0, 6))
    values = rng.normal(size=6)
    tangents = rng.normal(size=(6, 2))
    curve = channel([(t, v, a, b) for t, v, (a, b) in zip(times, values, tangents, strict=True)])
    for key in range(5):
        for u in np.linspace(0.0, 0.999, 17):
            h = times[key + 1] - times[key]
            wanted = (
                (1 + 2 * u) * (1 - u) ** 2 * values[key]
                + u * (1 - u) ** 2 * h * tangents[key, 1]
                + u**2 * (3 - 2 * u) * values[key + 1]
                + u**2 * (u - 1) * h * tangents[key + 1, 0]
            )
            found = evaluate(curve, np.array(times[key] + u * h))
            assert found == pytest.approx(wanted, abs=1e-12)


# The keys are on a straight line from (1, 10) to (3, 14); every mode is computed by hand.
@pytest.mark.parametrize(
    ("mode", "time", "expected"),
    [
        ("constant", 0.0, 10.0),
        ("constant", 9.0, 14.0),
        ("linear", 0.0, 8.0),
        ("linear", 4.5, 17.0),
        ("cycle", 3.5, 11.0),
        ("cycle", 0.5, 13.0),
        ("cycle", -1.5, 13.0),
        ("cycle_offset", 3.5, 15.0),
        ("cycle_offset", 0.5, 9.0),
        ("cycle_offset", -1.5, 5.0),
        ("bounce", 3.5, 13.0),
        ("bounce", 0.5, 11.0),
        ("bounce", 5.5, 11.0),
        ("bounce", -1.5, 13.0),
    ],
)
def test_extrapolation_matches_hand_calculation(mode, time, expected):
    curve = channel([(1, 10, "linear", "linear"), (3, 14, "linear", "linear")], mode, mode)
    assert evaluate(curve, np.array(time)) == pytest.approx(expected, abs=1e-12)


def test_linear_extrapolation_uses_the_outer_slopes():
    curve = channel([(0, 0, 3.0, 7.0), (1, 0, 7.0, -2.0)], "linear", "linear")
    np.testing.assert_allclose(evaluate(curve, np.array([-1.0, 3.0])), [-3.0, -4.0])


@pytest.mark.parametrize(("before", "after"), [*itertools.product(EXTRAPOLATIONS, repeat=2)])
def test_extrapolation_before_and_after_is_independent(before, after):
    keys = [(0, 1, "smooth", "smooth"), (1, 3, "smooth", "smooth"), (3, 2, "smooth", "smooth")]
    times = np.linspace(-7, 9, 161)
    both = evaluate(channel(keys, before, after), times)
    left = evaluate(channel(keys, before, before), times)
    right = evaluate(channel(keys, after, after), times)
    np.testing.assert_array_equal(both[times < 0], left[times < 0])
    np.testing.assert_array_equal(both[times > 3], right[times > 3])


@pytest.mark.parametrize("mode", EXTRAPOLATIONS)
@pytest.mark.parametrize("keys", [[(2.0, 5.0)], [(2.0, 4.0), (2.0, 5.0)]])
def test_keys_at_a_single_time_are_constant(mode, keys):
    curve = channel([(t, v, "smooth", "linear") for t, v in keys], mode, mode)
    np.testing.assert_array_equal(evaluate(curve, np.array([-9.0, 2.0, 9.0])), 5.0)


def test_channel_without_keys_is_zero():
    empty = Channel(0, np.zeros(0), np.zeros(0), ())
    np.testing.assert_array_equal(evaluate(empty, np.array([-1.0, 0.0, 5.0])), 0.0)


def test_keys_at_equal_times_are_a_jump_without_dividing_by_zero():
    keys = [(0, 0), (1, 1), (1, 5), (2, 6)]
    for rule in TANGENT_RULES:
        values = evaluate(channel([(t, v, rule, rule) for t, v in keys]), np.array([1.0, 1.5]))
        assert values[0] == 5.0 and np.isfinite(values).all()


def test_decreasing_times_are_refused():
    with pytest.raises(RigError, match="non-decreasing"):
        channel([(1, 0, "flat", "flat"), (0, 0, "flat", "flat")])


@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        ([], "joint j0 has no DOFs"),
        # A body of 24 ball joints has 72 DOFs, like the wasp with 23 joints and a root.
        ([(joint, kind) for joint in (0, 1) for kind in "xyz"], "joint j0 has DOFs x, y, z"),
        ([(0, kind) for kind in DOF_KINDS], "joint j1 has no DOFs"),
        (
            [(0, kind) for kind in DOF_KINDS] + [(1, "z")],
            "joint j1 has DOFs z",
        ),
        (
            [(0, kind) for kind in DOF_KINDS] + [(1, kind) for kind in "zyx"],
            "joint j1 has DOFs z, y, x",
        ),
        (
            [(1, kind) for kind in "xyz"] + [(0, kind) for kind in DOF_KINDS],
            "its DOFs are not in the order of its joints",
        ),
    ],
)
def test_misfit_names_incompatible_joints(rows, reason):
    skeleton = hand_made.skeleton([-1, 0], [(*row, 0.0) for row in rows])
    found = misfit(Clip("walk", (), 0.0, 1.0), skeleton)
    assert found == Phrase(
        "is not a .skel-style rig, in which clips translate the root along x, y, z and "
        "rotate each joint about x, y, z: {reason}",
        reason=reason,
    )


def test_misfit_is_empty_if_a_clip_fits():
    skeleton = hand_made.skeleton([-1], [(0, kind, 0.0) for kind in DOF_KINDS])
    still = [Channel(dof, [0.0], [0.0], (("flat", "flat"),)) for dof in range(6)]
    assert misfit(Clip("still", tuple(still), 0.0, 1.0), skeleton) is None
    short = Clip("short", tuple(still[:5]), 0.0, 1.0)
    assert misfit(short, skeleton) == "needs 6 (3 + 3 x 1 joints)"


def test_skel_rigs_list_translation_then_rotations_joint_by_joint():
    rows = [(0, kind, 0.0) for kind in ("tx", "ty", "tz", "x", "y", "z")]
    rows += [(1, kind, 0.0) for kind in "xyz"]
    assert is_course_rig(hand_made.skeleton([-1, 0], rows))
    swapped = [*rows[:4], rows[5], rows[4], *rows[6:]]
    assert not is_course_rig(hand_made.skeleton([-1, 0], swapped))


@pytest.mark.parametrize(
    ("tangents", "modes", "message"),
    [
        ((("steep", "flat"),), ("cycle",) * 2, "flat, linear, smooth or a number, found steep"),
        (((0.0, float("nan")),), ("cycle",) * 2, "flat, linear, smooth or a number, found nan"),
        ((("flat", "flat"),), ("cycle", "jump"), r"two of constant, .*, found \('cycle', 'jump'\)"),
        ((("flat", "flat"),), ("cycle",), "expected two of constant"),
    ],
)
def test_channel_refuses_unknown_rules(tangents, modes, message):
    with pytest.raises(RigError, match=message):
        Channel(0, np.zeros(1), np.zeros(1), tangents, modes)


@pytest.mark.parametrize(("start", "end"), [(2.0, 1.0), (float("nan"), 1.0), (0.0, float("inf"))])
def test_clip_refuses_an_invalid_range(start, end):
    with pytest.raises(RigError, match=r"expected a (range|finite number), found"):
        Clip("odd", (), start, end)


@pytest.mark.skipif(not SHARED.exists(), reason="needs the shared data")
def test_real_walk_has_the_published_values():
    """The values are in section 10 of the format's specification."""
    scene = viewer.load(*(SHARED / f"wasp{end}" for end in (".skel", ".skin", "_walk.anim")))
    clip = scene.actors[0].clip
    assert clip is not None
    root = np.stack([evaluate(c, np.array([-0.5, 0.5, 5.3])) for c in clip.channels[:3]], axis=1)
    expected = [[0, 0.95, 0.675], [0, 0.95, 0.225], [0, 0.95, -1.935]]
    np.testing.assert_allclose(root, expected, atol=5e-7)
    np.testing.assert_allclose(
        evaluate(clip.channels[6], np.array([-0.5, 0.0, 1.25])),
        [0.025210, -0.025210, 0.044603],
        atol=5e-7,  # six decimals are given
    )
    np.testing.assert_allclose(
        evaluate(clip.channels[39], np.array([-0.5, 0.5, 5.3])),
        [0.004606, 0.000991, -0.000426],
        atol=5e-7,
    )
    sums = sum(evaluate(c, np.array([0.0, 1.25])) for c in clip.channels)
    np.testing.assert_allclose(sums, [0.810141, 0.364446], atol=5e-6)
    pose = scene.actors[0].pose
    assert pose is not None and pose.dofs[1] == pytest.approx(0.95)


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
def test_every_pair_of_tangents_and_extrapolations_agrees(modes):
    rng = np.random.default_rng(11)
    channels = [
        random_channel(rng, 3 * number, 4, [pair, TANGENT_PAIRS[-number], pair, pair], modes)
        for number, pair in enumerate(TANGENT_PAIRS)
    ]
    assert_is_the_plain_curve(channels, rng.uniform(-60, 60, 97))


@pytest.mark.parametrize("seed", range(8))
def test_random_clips_with_few_and_many_keys_agree(seed):
    rng = np.random.default_rng(seed)
    counts = [0, 1, 2, 3, 30, *rng.integers(0, 9, 12).tolist()]
    channels = [random_channel(rng, row, count) for row, count in enumerate(counts)]
    # Between the keys, before all of them, and up to an hour away; unsorted.
    assert_is_the_plain_curve(channels, rng.uniform(-20, 40, 60))
    assert_is_the_plain_curve(channels, rng.uniform(-3700, 3700, 60))


def test_batch_of_times_has_the_same_values_as_single_times():
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
def test_keys_are_reproduced_exactly(mode, rule):
    times = np.array([-0.7, 0.1, 0.3, 1.9, 2.2])
    values = np.array([0.1, -0.3, 7.7, 1e-9, 0.7])
    curve = Channel(0, times, values, ((rule, rule),) * 5, (mode, mode))
    np.testing.assert_array_equal(evaluate(curve, times), values)


def test_ends_repeat_after_whole_periods():
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
def test_hours_of_playback_do_not_drift(start):
    """A period of 0.1 s, which is not exact in floating point, is repeated many thousand times."""
    times = np.array([0.0, 0.04, 0.1])
    curve = Channel(0, times, np.array([0.0, 1.0, 0.0]), (("smooth", 0.0),) * 3, ("cycle", "cycle"))
    periods = round(start / 0.1)
    for phase in (0.01, 0.03, 0.07):
        far = evaluate(curve, np.array(periods * 0.1 + phase))
        # Half a unit in the last place of the time, times the steepest slope of 40 per second.
        assert far == pytest.approx(float(evaluate(curve, np.array(phase))), abs=40 * 2e-10)


def test_times_an_hour_away_exceed_float32_precision():
    """After an hour, a frame of 1/1000 s changes the value, which it would not in float32."""
    curve = Channel(
        0, np.array([0.0, 1.0]), np.array([0.0, 1.0]), (("linear",) * 2,) * 2, ("cycle",) * 2
    )
    values = evaluate(curve, 3600.0 + np.array([0.25, 0.251, 0.252]))
    np.testing.assert_allclose(values, [0.25, 0.251, 0.252], atol=1e-12)


def test_outermost_of_coincident_keys_are_the_ends():
    times, values = np.array([1.0, 1.0, 2.0, 2.0]), np.array([5.0, 6.0, 7.0, 8.0])
    curve = Channel(0, times, values, ((2.0, 3.0),) * 4, ("constant", "linear"))
    np.testing.assert_array_equal(
        evaluate(curve, np.array([0.0, 1.0, 2.0, 3.0])), [5.0, 6.0, 8.0, 11.0]
    )


@pytest.mark.parametrize("mode", EXTRAPOLATIONS)
@pytest.mark.parametrize("gap", [1e-300, 5e-324, 1e-12])
def test_keys_closer_than_a_nanosecond_are_at_one_time(mode, gap):
    curve = Channel(
        0, np.array([0.0, gap]), np.array([1.0, 3e38]), (("linear", "smooth"),) * 2, (mode, mode)
    )
    np.testing.assert_array_equal(evaluate(curve, np.array([-1e30, 0.0, 1e38])), 3e38)


def test_largest_numbers_in_files_have_finite_results():
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


def test_empty_clips_and_non_finite_times_are_supported():
    targets, values = evaluate_all(Clip("none", (), 0.0, 1.0), np.array([0.0, 1.0]))
    assert targets.shape == (0,) and values.shape == (2, 0)
    one = Channel(4, np.array([0.0, 1.0]), np.array([1.0, 2.0]), (("flat", "flat"),) * 2)
    targets, values = evaluate_all(Clip("one", (one,), 0.0, 1.0), np.zeros(0))
    assert targets.tolist() == [4] and values.shape == (0, 1)
    assert evaluate(one, np.zeros((2, 3))).shape == (2, 3)
    assert evaluate(one, np.array(0.5)) == 1.5


@pytest.fixture(scope="module")
def figure(tmp_path_factory):
    return read(Source.open(write(tmp_path_factory.mktemp("mhr"))))


def test_frames_have_the_vertices_of_the_published_equations_in_metres(figure):
    generator = np.random.default_rng(9)
    parameters = 0.7 * generator.normal(size=(3, len(NAMES)))
    identity = generator.normal(size=(3, N_IDENTITY))
    expression = generator.normal(size=(3, N_EXPRESSIONS))
    places = generator.normal(size=(3, 3))
    timing = Timing(10.0, np.arange(3, dtype=np.int32))
    motion = ParameterMotion("sam", timing, parameters, identity, expression, places)
    clip = parameter_clip(motion, figure)
    actor = Actor(figure, clip=clip)
    for row in range(3):
        pose_actors([actor], 0.1 * row)
        wanted = forward(identity[row], parameters[row], expression[row])[0]
        # The vertices include correctives, so the pose must have exactly the rotations of the
        # joints.
        assert_allclose(deform(figure, actor.pose)[0], 0.01 * wanted + places[row], atol=1e-9)


def test_motion_without_frames_is_refused(figure):
    timing = Timing(10.0, np.zeros(0, dtype=np.int32))
    empty = np.zeros((0, 3))
    with pytest.raises(RigError, match="at least one frame"):
        parameter_clip(ParameterMotion("sam", timing, empty, empty, empty, empty), figure)
