"""Keyed transforms in the Curves panel: keys edited by mouse, fields and buttons, and undo."""

from dataclasses import replace

import numpy as np
import pytest
from app.curves.plotted import _center, _pick, _type_into
from numpy.testing import assert_allclose, assert_array_equal
from rig.animated import animated_leg

from viewer.app.core.undo_actions import undo
from viewer.app.curves.data import curves_of
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
