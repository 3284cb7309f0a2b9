"""Data of the curves: keys of DOFs and of transforms, and the points that are drawn."""

from dataclasses import replace

import numpy as np
import pytest
from app.curves.plotted import ARM_X, _center, _pick, _type_into
from numpy.testing import assert_allclose, assert_array_equal
from rigs.animated import animated_leg
from rigs.hand_made import skeleton

from viewer.app.core.undo_actions import undo
from viewer.app.curves import plot
from viewer.app.curves.data import channel_of, curves_of, keyed_values, sampled_points
from viewer.app.curves.editing import (
    Curves,
    add_key_at,
    delete_chosen,
    interpolate,
    key_present_pose,
    place_key,
)
from viewer.app.posing.toolbar import no_keys
from viewer.loading import Contents, begin
from viewer.rigs.captures.points import PointClip, PointLayout
from viewer.rigs.figure import Figure
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor


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


def test_curves_are_sampled_again_only_if_the_motion_changes(curves, monkeypatch):
    sampled, original = [], plot.keyed_lines

    def noted(keyed, row, low, high):
        sampled.append(row)
        return original(keyed, row, low, high)

    monkeypatch.setattr(plot, "keyed_lines", noted)
    curves.step(3)
    assert sampled == []
    curves.state.actor.clip = replace(curves.state.actor.clip, end=1.5)
    curves.step(3)
    assert sampled == [ARM_X]


SIZE = (1180, 900)


@pytest.fixture
def hand(drive, tmp_path):
    scene = begin(Contents(figures=[(tmp_path / "hero.glb", animated_leg())]))[0]
    hand = drive(scene=scene, size=SIZE)
    hand.show_panel("Curves")
    return hand


def rows(hand, *labels) -> tuple[int, ...]:
    found = [curve.label for curve in curves_of(hand.state.actor)]
    return tuple(found.index(label) for label in labels)


def show(hand, *labels) -> None:
    hand.state.of(Curves).choose(rows(hand, *labels))
    hand.step(3)


def channels(hand):
    return hand.state.actor.clip.channels


def test_curves_are_named_by_joint_and_property(hand):
    labels = [curve.label for curve in curves_of(hand.state.actor)]
    assert labels == [
        "hip.tx", "hip.ty", "hip.tz", "hip.x", "hip.y", "hip.z", "knee.x", "knee.y", "knee.z",
        "knee.sx", "knee.sy", "knee.sz", "foot.x", "foot.y", "foot.z", "shapes.rise",
        "shapes.widen",
    ]  # fmt: skip


def test_joint_shows_its_angles_if_keyed_and_otherwise_its_keyed_property(hand):
    assert hand.state.of(Curves).rows == rows(hand, "hip.x", "hip.y", "hip.z")
    add_key_at(hand.state, rows(hand, "foot.x"), 1.0)
    delete_chosen(hand.state)
    hand.state.selected_joint = 1
    hand.step(2)
    assert hand.state.of(Curves).rows == rows(hand, "knee.x", "knee.y", "knee.z")
    hand.state.actor.clip = replace(
        hand.state.actor.clip, channels=tuple(one for one in channels(hand) if one.path == "scale")
    )
    hand.step(2)
    assert hand.state.of(Curves).rows == rows(hand, "knee.sx", "knee.sy", "knee.sz")


def test_dragged_key_moves_and_one_undo_restores_it(hand):
    show(hand, "hip.tx")
    start, (x2, _) = _center(hand, "key hip.tx 1"), _center(hand, "key hip.tx 2")
    steps = hand.undo_steps
    hand.pull(start, (start[0] + (x2 - start[0]) / 2, start[1] + 40))
    assert hand.undo_steps == steps + 1
    moved = channels(hand)[0]
    assert moved.times[1] == pytest.approx(1.5, abs=0.02) and moved.values[1, 0] < 0.99
    assert_array_equal(moved.values[1, 1:], [0.0, 0.0])
    undo(hand.state)
    hand.step(2)
    assert_array_equal(channels(hand)[0].times, [0.5, 1.0, 2.0])


def test_tangents_of_cubic_keys_can_be_dragged_but_those_of_rotations_are_not_shown(hand):
    show(hand, "hip.ty")
    hand.state.of(Curves).keys = frozenset({(*rows(hand, "hip.ty"), 1)})
    hand.step(2)
    x, y = _center(hand, "tangent 1")
    hand.pull((x, y), (x, y - 30))
    assert channels(hand)[0].tangents[1, 1, 1] > 2.0
    hand.state.item_rects.pop("tangent 1")
    show(hand, "hip.z")
    hand.state.of(Curves).keys = frozenset({(*rows(hand, "hip.z"), 1)})
    hand.step(2)
    assert "tangent 1" not in hand.state.item_rects


def test_typed_angles_are_degrees_about_rest(hand):
    show(hand, "hip.z")
    hand.state.of(Curves).keys = frozenset({(*rows(hand, "hip.z"), 1)})
    hand.step(2)
    _type_into(hand, "Value", "60")
    hand.state.clock.seek(1.5)
    hand.step(2)
    assert_allclose(hand.state.actor.pose.dofs[:3], [0.0, 0.0, np.pi / 3], atol=1e-12)


def test_interpolation_is_chosen_for_the_channel(hand):
    show(hand, "hip.z")
    _pick(hand, "Interpolation", 0)
    assert channels(hand)[1].interpolation == "step"
    hand.state.clock.seek(1.4)
    hand.step(2)
    assert_allclose(hand.state.actor.pose.dofs[:3], 0.0, atol=1e-12)
    interpolate(hand.state, "cubic")
    hand.step(2)
    assert channels(hand)[1].tangents is not None
    undo(hand.state)
    hand.step(2)
    assert channels(hand)[1].interpolation == "step"


def test_added_and_deleted_keys_are_undone(hand):
    (foot,) = rows(hand, "foot.y")
    hand.state.actor.pose.dofs[7] = 0.3
    add_key_at(hand.state, [foot], 1.0)
    hand.step(2)
    assert channels(hand)[-1].joint == 2 and hand.state.of(Curves).keys == {(foot, 0)}
    place_key(hand.state, (foot, 0), value=0.7)
    hand.step(2)
    assert hand.state.actor.pose.dofs[7] == pytest.approx(0.7)
    delete_chosen(hand.state)
    hand.step(2)
    assert len(channels(hand)) == 5 and not hand.state.of(Curves).keys


def test_delete_without_selected_keys_changes_nothing(hand):
    show(hand, "hip.tx")
    old, steps = hand.state.actor.clip, hand.undo_steps
    (x0, y0), (x1, _) = _center(hand, "key hip.tx 0"), _center(hand, "key hip.tx 1")
    hand.move(((x0 + x1) / 2, y0 - 30))
    hand.key("delete")
    hand.step(2)
    assert hand.state.actor.clip is old and hand.undo_steps == steps


def test_pose_is_keyed_from_the_panel(hand):
    assert no_keys(hand.state) == ""
    hand.state.clock.seek(1.0)
    hand.step(2)
    hand.state.actor.pose.dofs[6] = 0.25
    key_present_pose(hand.state, only_changed=True)
    assert hand.says("Pose keyed at 1.000 s: 1 new keys") or hand.says("1 new key")
    hand.state.clock.seek(0.6)
    hand.step(2)
    assert hand.state.actor.pose.dofs[6] == pytest.approx(0.25)
