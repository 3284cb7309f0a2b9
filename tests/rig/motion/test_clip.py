"""Curves of keys: tangent rules, extrapolation, and the check values of the real file of a walk."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from rig import hand_made

import viewer
from viewer.diagnostics import Phrase
from viewer.errors import RigError
from viewer.rig.motion.clip import (
    EXTRAPOLATIONS,
    TANGENT_RULES,
    Channel,
    Clip,
    evaluate,
    is_course_rig,
    misfit,
    slopes,
)
from viewer.rig.skeleton import DOF_KINDS

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
def test_slopes_follow_the_tangent_rule(rule: str, expected: list[list[float]]) -> None:
    curve = channel([(t, v, rule, rule) for t, v in KEYS])
    np.testing.assert_allclose(slopes(curve), expected, atol=1e-15)


def test_slopes_accept_a_value_on_each_side() -> None:
    curve = channel([(0, 0, 13.7, -0.22), (1, 5, "flat", "linear")])
    np.testing.assert_allclose(slopes(curve), [[13.7, -0.22], [0, 5]])


def test_evaluate_equals_the_hermite_basis_inside_the_keys() -> None:
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
def test_extrapolation_matches_hand_calculation(mode: str, time: float, expected: float) -> None:
    curve = channel([(1, 10, "linear", "linear"), (3, 14, "linear", "linear")], mode, mode)
    assert evaluate(curve, np.array(time)) == pytest.approx(expected, abs=1e-12)


def test_linear_extrapolation_uses_the_outer_slopes() -> None:
    curve = channel([(0, 0, 3.0, 7.0), (1, 0, 7.0, -2.0)], "linear", "linear")
    np.testing.assert_allclose(evaluate(curve, np.array([-1.0, 3.0])), [-3.0, -4.0])


@pytest.mark.parametrize(("before", "after"), [*itertools.product(EXTRAPOLATIONS, repeat=2)])
def test_extrapolation_before_and_after_is_independent(before: str, after: str) -> None:
    keys = [(0, 1, "smooth", "smooth"), (1, 3, "smooth", "smooth"), (3, 2, "smooth", "smooth")]
    times = np.linspace(-7, 9, 161)
    both = evaluate(channel(keys, before, after), times)
    left = evaluate(channel(keys, before, before), times)
    right = evaluate(channel(keys, after, after), times)
    np.testing.assert_array_equal(both[times < 0], left[times < 0])
    np.testing.assert_array_equal(both[times > 3], right[times > 3])


@pytest.mark.parametrize("mode", EXTRAPOLATIONS)
@pytest.mark.parametrize("keys", [[(2.0, 5.0)], [(2.0, 4.0), (2.0, 5.0)]])
def test_keys_at_a_single_time_are_constant(mode: str, keys: list[tuple[float, float]]) -> None:
    curve = channel([(t, v, "smooth", "linear") for t, v in keys], mode, mode)
    np.testing.assert_array_equal(evaluate(curve, np.array([-9.0, 2.0, 9.0])), 5.0)


def test_channel_without_keys_is_zero() -> None:
    empty = Channel(0, np.zeros(0), np.zeros(0), ())
    np.testing.assert_array_equal(evaluate(empty, np.array([-1.0, 0.0, 5.0])), 0.0)


def test_keys_at_equal_times_are_a_jump_without_dividing_by_zero() -> None:
    keys = [(0, 0), (1, 1), (1, 5), (2, 6)]
    for rule in TANGENT_RULES:
        values = evaluate(channel([(t, v, rule, rule) for t, v in keys]), np.array([1.0, 1.5]))
        assert values[0] == 5.0 and np.isfinite(values).all()


def test_decreasing_times_are_refused() -> None:
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
def test_misfit_names_incompatible_joints(rows, reason) -> None:
    skeleton = hand_made.skeleton([-1, 0], [(*row, 0.0) for row in rows])
    found = misfit(Clip("walk", (), 0.0, 1.0), skeleton)
    assert found == Phrase(
        "is not a .skel-style rig, in which clips translate the root along x, y, z and "
        "rotate each joint about x, y, z: {reason}",
        reason=reason,
    )


def test_misfit_is_empty_if_a_clip_fits() -> None:
    skeleton = hand_made.skeleton([-1], [(0, kind, 0.0) for kind in DOF_KINDS])
    still = [Channel(dof, [0.0], [0.0], (("flat", "flat"),)) for dof in range(6)]
    assert misfit(Clip("still", tuple(still), 0.0, 1.0), skeleton) is None
    short = Clip("short", tuple(still[:5]), 0.0, 1.0)
    assert misfit(short, skeleton) == "needs 6 (3 + 3 x 1 joints)"


def test_skel_rigs_list_translation_then_rotations_joint_by_joint() -> None:
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
def test_channel_refuses_unknown_rules(tangents, modes, message) -> None:
    with pytest.raises(RigError, match=message):
        Channel(0, np.zeros(1), np.zeros(1), tangents, modes)


@pytest.mark.parametrize(("start", "end"), [(2.0, 1.0), (float("nan"), 1.0), (0.0, float("inf"))])
def test_clip_refuses_an_invalid_range(start, end) -> None:
    with pytest.raises(RigError, match="clip odd: expected a range, found"):
        Clip("odd", (), start, end)


@pytest.mark.skipif(not SHARED.exists(), reason="needs the shared data")
def test_real_walk_has_the_published_values() -> None:
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
