"""Editing of keys: moved and unmoved keys, and the unchanged old channel."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rigs import hand_made

from viewer.errors import RigError
from viewer.rigs.motion.clip import Channel, Clip, evaluate, evaluate_all, slopes
from viewer.rigs.motion.clip_edit import (
    add_key,
    clip_from_frames,
    clip_from_pose,
    delete_keys,
    empty_clip,
    key_pose,
    move_keys,
    set_extrapolation,
    set_key,
    set_range,
    set_tangent,
    slope_at,
    with_channel,
)
from viewer.rigs.pose import rest_pose

ROWS = [(0, kind, 0.0) for kind in ("tx", "ty", "tz", "x", "y")] + [(0, "z", 0.0, -1.0, 1.0)]


def channel(times=(0.0, 1.0, 3.0), values=(0.0, 2.0, -2.0), rule="smooth", modes=("cycle",) * 2):
    return Channel(4, np.array(times), np.array(values), ((rule, rule),) * len(times), modes)


def rig():
    return hand_made.skeleton([-1], ROWS)


def same_but(new, old, **changed):
    """Assert that a channel differs from another in the given parts only."""
    assert new.target == old.target
    for name in ("times", "values"):
        wanted = changed.get(name, getattr(old, name))
        assert_array_equal(getattr(new, name), wanted, err_msg=name)
    for name in ("tangents", "extrapolation"):
        assert getattr(new, name) == changed.get(name, getattr(old, name))


# Adding


@pytest.mark.parametrize("rule", ["flat", "linear", "smooth", 0.5])
@pytest.mark.parametrize("time", [0.25, 1.75, 2.999])
@pytest.mark.parametrize("modes", [("linear", "linear"), ("cycle_offset", "bounce")])
def test_key_added_on_the_curve_does_not_change_it(rule, time, modes):
    curve = channel((0.0, 1.0, 3.0, 3.5), (0.0, 2.0, -2.0, 1.0), rule, modes)
    longer, index = add_key(curve, time)
    assert len(longer.times) == 5 and longer.times[index] == time
    times = np.linspace(-9, 12, 421)
    assert_allclose(evaluate(longer, times), evaluate(curve, times), atol=1e-12)
    assert len(curve.times) == 4


def test_key_added_on_the_curve_has_its_slope():
    # 3 u^2 - 2 u^3 over 2 s from 0 to 4: the middle is 2, and its slope is 4 * 1.5 / 2 per second.
    curve = channel((0.0, 2.0), (0.0, 4.0), "flat")
    longer, index = add_key(curve, 1.0)
    assert index == 1 and longer.values.tolist() == [0, 2, 4]
    assert longer.tangents == (("flat", "flat"), (3.0, 3.0), ("flat", "flat"))


def test_key_added_with_a_value_is_smooth_and_keeps_other_tangent_rules():
    longer, index = add_key(channel(), 2.0, 7.0)
    assert index == 2
    same_but(
        longer,
        channel(),
        times=[0, 1, 2, 3],
        values=[0, 2, 7, -2],
        tangents=(("smooth", "smooth"),) * 4,
    )


@pytest.mark.parametrize(("time", "index", "value"), [(-1.0, 0, -2.0), (3.5, 3, -4.0)])
def test_key_added_outside_is_on_the_extrapolation(time, index, value):
    # Linear extrapolation with the slopes at the ends: -2 and -4 per second.
    longer, found = add_key(channel((0, 1, 2), (0, 2, -2), "linear", ("linear",) * 2), time)
    assert found == index
    if time < 0:
        assert longer.values[0] == value
    else:
        assert longer.values[3] == -2.0 - 4.0 * 1.5


def test_key_added_at_an_existing_time_replaces_the_value():
    changed, index = add_key(channel(), 1.0, 9.0)
    assert index == 1
    same_but(changed, channel(), values=[0, 9, -2])
    same, index = add_key(channel(), 1.0 + 1e-12)
    assert index == 1
    same_but(same, channel())


def test_first_key_of_an_empty_channel_is_added():
    empty = Channel(2, np.zeros(0), np.zeros(0), ())
    first, index = add_key(empty, 1.5)
    assert (index, first.times.tolist(), first.values.tolist()) == (0, [1.5], [0.0])


def test_slope_is_evaluated_between_and_outside_of_the_keys():
    curve = channel((0.0, 2.0), (0.0, 4.0), "flat")
    # d/dt of 4 (3 u^2 - 2 u^3), u = t / 2, is 12 (u - u^2).
    for time in (0.0, 0.5, 1.0, 2.0):
        assert slope_at(curve, time) == pytest.approx(12 * (time / 2) * (1 - time / 2), abs=1e-12)
    assert slope_at(curve, -0.1) == slope_at(curve, 2.1) == 0.0
    assert slope_at(channel((1.0, 1.0), (0.0, 4.0)), 1.0) == 0.0


# Moving


def test_moved_keys_keep_order_and_index():
    same_but(move_keys(channel(), [1], 0.5, 1.0), channel(), times=[0, 1.5, 3], values=[0, 3, -2])
    same_but(
        move_keys(channel(), [0, 1], -2.0, 0.5),
        channel(),
        times=[-2, -1, 3],
        values=[0.5, 2.5, -2],
    )


@pytest.mark.parametrize(
    ("keys", "dt", "times"),
    [
        ([1], 5.0, [0, 3, 3]),
        ([1], -5.0, [0, 0, 3]),
        ([0, 1], 5.0, [2, 3, 3]),
        ([1, 2], -5.0, [0, 0, 2]),
        ([0, 2], 5.0, [1, 1, 4]),
        ([0, 1, 2], 5.0, [5, 6, 8]),
        ([], 5.0, [0, 1, 3]),
        ([2], 5.0, [0, 1, 8]),
    ],
)
def test_moved_keys_stop_at_unselected_keys(keys, dt, times):
    assert move_keys(channel(), keys, dt, 0.0).times.tolist() == times


def test_moved_keys_keep_a_minimum_gap_if_possible():
    assert move_keys(channel(), [1], 5.0, 0.0, gap=0.25).times.tolist() == [0, 2.75, 3]
    close = channel((0.0, 1.0, 1.1))
    assert move_keys(close, [1], 5.0, 0.0, gap=0.25).times.tolist() == [0, 1, 1.1]


def test_rounding_does_not_reorder_or_move_neighbours():
    rng = np.random.default_rng(2)
    for _ in range(200):
        times = np.sort(rng.uniform(-1e3, 1e3, 3))
        for dt in (1e6, -1e6):
            moved = move_keys(channel(times), [1], dt, 0.0).times
            assert (moved[[0, 2]] == times[[0, 2]]).all() and (np.diff(moved) >= 0).all()


def test_set_key_stores_time_and_value_exactly():
    same_but(set_key(channel(), 1, 0.1, 0.7), channel(), times=[0, 0.1, 3], values=[0, 0.7, -2])
    same_but(set_key(channel(), 2, value=4.5), channel(), values=[0, 2, 4.5])
    assert set_key(channel(), 1, 9.0).times.tolist() == [0, 3, 3]


def test_deleted_keys_lose_their_tangents():
    curve = set_tangent(channel(), 1, 0, 5.0)
    same_but(delete_keys(curve, [0, 2]), curve, times=[1], values=[2], tangents=((5.0, "smooth"),))
    assert len(delete_keys(curve, range(3)).times) == 0
    assert len(curve.times) == 3


# Tangents, extrapolation and range


def test_tangents_change_on_one_side():
    changed = set_tangent(set_tangent(channel(), 1, 0, "flat"), 1, 1, -3.0)
    assert changed.tangents == (("smooth", "smooth"), ("flat", -3.0), ("smooth", "smooth"))
    assert slopes(changed)[1].tolist() == [0.0, -3.0]
    for wrong in ("steep", float("inf")):
        with pytest.raises(RigError, match="tangent: expected flat, linear, smooth or a number"):
            set_tangent(channel(), 1, 0, wrong)


def test_extrapolation_changes_at_one_end():
    same_but(
        set_extrapolation(channel(), 0, "bounce"), channel(), extrapolation=("bounce", "cycle")
    )
    same_but(
        set_extrapolation(channel(), 1, "linear"), channel(), extrapolation=("cycle", "linear")
    )


def test_range_is_ordered_and_channels_are_unchanged():
    clip = Clip("c", (channel(),), 0.0, 1.0)
    changed = set_range(clip, 5.0, 2.0)
    assert (changed.start, changed.end) == (2.0, 5.0) and changed.channels is clip.channels


def test_replacing_one_channel_keeps_other_channel_objects():
    other = Channel(1, np.zeros(1), np.ones(1), (("flat", "flat"),))
    clip = Clip("c", (other, channel()), 0.0, 1.0)
    changed = with_channel(clip, 4, lambda old: delete_keys(old, [0]))
    assert changed.channels[0] is other and len(changed.channels[1].times) == 2
    assert len(clip.channels[1].times) == 3
    more = with_channel(clip, 2, lambda old: add_key(old, 0.5, 1.5)[0])
    assert [one.target for one in more.channels] == [1, 2, 4]
    assert more.channels[1].values.tolist() == [1.5]


# Keys of whole poses


def test_clip_of_a_pose_is_constant():
    pose = rest_pose(rig())
    pose.dofs[:] = [1, 2, 3, 0.1, 0.2, 0.3]
    clip = clip_from_pose(rig(), pose, "new", 2.0, 5.0)
    assert (clip.name, clip.start, clip.end) == ("new", 2.0, 5.0)
    targets, values = evaluate_all(clip, np.array([-100.0, 2.0, 3.0, 1e6]))
    assert targets.tolist() == [0, 1, 2, 3, 4, 5]
    assert_array_equal(values, np.tile(pose.dofs, (4, 1)))
    assert [one.times.tolist() for one in clip.channels] == [[2.0]] * 6


def test_empty_clip_has_a_channel_for_every_dof_and_no_key():
    clip = empty_clip(rig(), "none")
    assert [(one.target, len(one.times)) for one in clip.channels] == [(dof, 0) for dof in range(6)]


def test_keyed_pose_is_reproduced_exactly_and_extends_the_range():
    pose = rest_pose(rig())
    clip = clip_from_pose(rig(), pose, "new", 0.0, 1.0)
    pose.dofs[:] = [1, 0, 0, 0.25, 0, -0.5]
    longer = key_pose(clip, rig(), pose, 2.5)
    assert (longer.start, longer.end) == (0.0, 2.5)
    assert_array_equal(evaluate_all(longer, np.array([2.5]))[1][0], pose.dofs)
    assert_array_equal(evaluate_all(longer, np.array([0.0]))[1][0], np.zeros(6))
    assert [len(one.times) for one in longer.channels] == [2] * 6


def test_only_changed_dofs_get_keys_if_requested():
    pose = rest_pose(rig())
    clip = clip_from_pose(rig(), pose, "new")
    pose.dofs[3] = 0.25
    changed = key_pose(clip, rig(), pose, 0.5, only_changed=True)
    assert [len(one.times) for one in changed.channels] == [1, 1, 1, 2, 1, 1]


def test_clamping_is_not_a_change():
    """A curve beyond the limits is clamped, so the pose at the limit is unchanged."""
    beyond = Channel(5, np.zeros(1), np.full(1, 4.0), (("flat", "flat"),))
    clip = Clip("beyond", (beyond,), 0.0, 1.0)
    pose = rest_pose(rig())
    pose.dofs[5] = 1.0  # the limit of the z rotation
    changed = key_pose(clip, rig(), pose, 0.5, only_changed=True)
    assert [one.target for one in changed.channels] == [5] and len(changed.channels[0].times) == 1


def test_keying_again_at_the_same_time_replaces_keys():
    pose = rest_pose(rig())
    clip = clip_from_pose(rig(), pose, "new")
    pose.dofs[:] = 0.5
    changed = key_pose(clip, rig(), pose, 0.0)
    assert [one.values.tolist() for one in changed.channels] == [[0.5]] * 6


# Frames


def test_frames_are_converted_to_keys_and_constant_dofs_to_one_key():
    times = np.array([0.5, 0.75, 1.0])
    dofs = np.array([[1.0, 7.0], [2.0, 7.0], [4.0, 7.0]])
    clip = clip_from_frames("walk", dofs, times)
    assert (clip.name, clip.start, clip.end) == ("walk", 0.5, 1.0)
    assert clip.channels[0].times.tolist() == [0.5, 0.75, 1.0]
    assert clip.channels[1].times.tolist() == [0.5] and clip.channels[1].values.tolist() == [7.0]
    assert_array_equal(evaluate_all(clip, times)[1], dofs)
    # Frames are interpolated linearly, or smoothly with the slope from 1 to 4 in 0.5 s.
    middle = np.array([0.625])
    assert evaluate(clip.channels[0], middle) == 1.5
    smooth = clip_from_frames("walk", dofs, times, "smooth")
    assert slopes(smooth.channels[0])[1].tolist() == [6.0, 6.0]
    assert evaluate(smooth.channels[0], middle) == pytest.approx(1.5 + 0.25 * (4 - 6) / 8)
