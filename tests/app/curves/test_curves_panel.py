"""The Curves panel: keys, tangents and modes edited by mouse and keyboard; read-only curves."""

import math
from dataclasses import replace

import numpy as np
import pytest
from app.curves.plotted import ARM_X, _arm, _at, _center, _clip, _pick, _scale, _type_into
from numpy.testing import assert_allclose, assert_array_equal

from viewer.app.curves.data import curves_of
from viewer.app.curves.editing import Curves
from viewer.app.curves.plot import unit_text, value_limits
from viewer.rigs.motion.clip import evaluate


def _chosen(hand):
    return sorted(hand.state.of(Curves).keys)


# Shown curves


def test_rounding_of_a_constant_curve_is_not_magnified():
    noise = np.random.default_rng(2).normal(scale=1e-6, size=200)
    for values, least in ((30.0 + noise, 0.1), (1e5 + 5e3 * noise, 1e-3), (noise, 1e-3)):
        bottom, top = value_limits(values, least)
        assert np.ptp(values) < 0.05 * (top - bottom) and bottom < values.min() < top
    # A small motion is shown in a range of at least 0.1, half of which is 0.05.
    bottom, top = value_limits(np.array([2.0, 2.05]), 0.1)
    assert 0.05 / (top - bottom) == pytest.approx(0.5)


def test_units_of_the_axes_follow_the_curves(curves):
    figure = curves.state.actor.figure
    for unit, shown in (("", "units"), ("cm", "cm")):
        curves.state.actor.figure = replace(figure, unit=unit)
        curves.click("curves of root")
        assert curves.state.of(Curves).rows == (0, 1, 2, 3, 4, 5)
        lengths, angles = (curves.state.of(Curves).rows[k:][:3] for k in (0, 3))
        found = curves_of(curves.state.actor)
        assert all(found[row].is_length for row in lengths)
        assert not any(found[row].is_length for row in angles)
        assert unit_text(curves.state, found) == f"{shown}, degrees"


def test_curves_follow_the_selected_joint_and_the_list(curves):
    assert curves.state.of(Curves).rows == (ARM_X,)
    curves.state.selected_joint = 0
    curves.step(2)
    assert curves.state.of(Curves).rows == (0, 1, 2, 3, 4, 5)
    curves.click("curve root.tx")
    assert curves.state.of(Curves).rows == (0,)
    curves.click("curve root.y", held="ctrl")
    assert curves.state.of(Curves).rows == (0, 4)
    curves.click("curve root.tx", held="ctrl")
    assert curves.state.of(Curves).rows == (4,)
    curves.click("curves of root")
    assert curves.state.of(Curves).rows == (0, 1, 2, 3, 4, 5)
    assert curves.undo_steps == 0


def test_filter_lists_only_matching_names(curves):
    curves.click("Curve filter")
    curves.type("m.z")
    curves.step(2)
    listed = {label for label in curves.state.item_rects if label.startswith("curve ")}
    assert listed == {"curve arm.z"}
    curves.click("curves of arm")
    assert curves.state.of(Curves).rows == (ARM_X + 2,)
    curves.click("Curve filter")
    curves.key("a", "ctrl")
    curves.type("nothing")
    curves.step(2)
    assert not [label for label in curves.state.item_rects if label.startswith("curve ")]


def test_all_keys_of_the_shown_curves_are_drawn_at_their_positions(curves):
    shown = [label for label in curves.state.item_rects if label.startswith("key ")]
    assert sorted(shown) == ["key arm.x 0", "key arm.x 1", "key arm.x 2"]
    x, y = _center(curves, "key arm.x 2")
    assert (x, y) == pytest.approx(_at(curves, 2.0, math.degrees(-0.2)), abs=1.0)
    x0, y0, x1, y1 = curves.state.item_rects["plot"]
    assert x0 < x < x1 and y0 < y < y1


def test_wheel_zooms_and_drag_pans_and_fit_shows_everything(curves):
    before = _scale(curves)[0]
    x, y = _center(curves, "key arm.x 1")
    for _ in range(6):
        curves.wheel(2, (x, y + 15))
    curves.step(2)
    assert "key arm.x 0" not in curves.state.item_rects
    assert "key arm.x 1" in curves.state.item_rects
    x, y = _center(curves, "key arm.x 1")
    curves.pull((x + 20, y + 15), (x + 60, y + 15))
    moved = _center(curves, "key arm.x 1")[0] - x
    assert moved == pytest.approx(40, abs=8) and curves.undo_steps == 0
    curves.click("Fit")
    curves.step(2)
    assert _scale(curves)[0] == pytest.approx(before, rel=1e-3)


# Keys edited by mouse


def test_dragged_key_follows_the_mouse_as_one_undo_step(curves):
    old, (across, up) = _clip(curves), _scale(curves)
    x, y = _center(curves, "key arm.x 1")
    curves.pull((x, y), (x + 60, y - 24))
    assert _arm(curves).times[1] == pytest.approx(1.0 + 60 / across, abs=2 / across)
    wanted = 0.6 + math.radians(-24 / up)
    assert _arm(curves).values[1] == pytest.approx(wanted, abs=math.radians(2 / abs(up)))
    assert_array_equal(_arm(curves).times[[0, 2]], [0, 2])
    assert _chosen(curves) == [(ARM_X, 1)] and curves.undo_steps == 1
    curves.key("z", "ctrl")
    assert _clip(curves) is old
    curves.key("z", "ctrl shift")
    assert _arm(curves).times[1] > 1.0


def test_dragged_key_poses_the_figure_immediately(curves):
    curves.state.clock.seek(1.0)
    curves.step(2)
    assert curves.dof("arm.x") == pytest.approx(0.6)
    x, y = _center(curves, "key arm.x 1")
    curves.pull((x, y), (x, y + 30))
    curves.step()
    # The mouse may have moved the key in time by part of a pixel.
    assert curves.dof("arm.x") == pytest.approx(float(_arm(curves).values[1]), abs=0.01)
    assert curves.dof("arm.x") < 0.55


def test_dragged_key_stops_at_its_neighbours(curves):
    x, y = _center(curves, "key arm.x 1")
    end = _at(curves, 2.3, math.degrees(0.6))
    curves.pull((x, y), (end[0], y))
    assert 1.9 < _arm(curves).times[1] < 2.0
    assert _arm(curves).times[2] == 2.0


def test_shift_extends_the_selection_and_keys_move_together(curves):
    curves.click(_center(curves, "key arm.x 0"))
    curves.click(_center(curves, "key arm.x 1"), held="shift")
    assert _chosen(curves) == [(ARM_X, 0), (ARM_X, 1)]
    x, y = _center(curves, "key arm.x 1")
    curves.pull((x, y), (x - 50, y))
    times = _arm(curves).times
    assert times[0] < -0.05 and times[1] - times[0] == pytest.approx(1.0, abs=1e-9)
    assert times[2] == 2.0


def test_click_on_empty_space_clears_the_selection(curves):
    curves.click(_center(curves, "key arm.x 1"))
    assert _chosen(curves) == [(ARM_X, 1)]
    curves.click(_at(curves, 1.5, -15.0))
    assert _chosen(curves) == [] and curves.undo_steps == 0


def test_double_click_adds_a_key_on_the_curve(curves):
    old = _arm(curves)
    curves.double_click(_at(curves, 0.5, 12.0))
    assert len(_arm(curves).times) == 4 and _chosen(curves) == [(ARM_X, 1)]
    assert _arm(curves).times[1] == pytest.approx(0.5, abs=0.02)
    times = np.linspace(-3, 5, 81)
    assert_allclose(evaluate(_arm(curves), times), evaluate(old, times), atol=1e-12)
    assert curves.undo_steps == 1
    curves.key("z", "ctrl")
    assert _arm(curves) is old


def test_insert_adds_a_key_to_the_nearest_curve(curves):
    curves.click("curve arm.z", held="ctrl")
    curves.step(2)
    # arm.z is constantly -0.1, far below the wave at 1 s.
    curves.move(_at(curves, 1.2, math.degrees(-0.08)))
    curves.key("insert")
    curves.step()
    arm_z = _clip(curves).channels[ARM_X + 2]
    assert len(_arm(curves).times) == 3
    assert arm_z.times == pytest.approx([0, 1.2], abs=0.02) and arm_z.values[1] == -0.1


def test_add_key_adds_one_to_each_shown_curve_at_the_current_time(curves):
    curves.click("curves of arm")
    curves.state.clock.seek(0.5)
    curves.click("Add key")
    for row in (ARM_X, ARM_X + 1, ARM_X + 2):
        assert 0.5 in _clip(curves).channels[row].times
    assert _chosen(curves) == [(ARM_X, 1), (ARM_X + 1, 1), (ARM_X + 2, 1)]
    assert curves.undo_steps == 1


def test_shortcuts_work_while_the_mouse_is_over_a_key_or_line(curves):
    curves.click(_center(curves, "key arm.x 1"))
    assert _chosen(curves) == [(ARM_X, 1)]
    curves.key("delete")  # the mouse is still there
    curves.step(2)
    assert_array_equal(_arm(curves).times, [0.0, 2.0])
    curves.state.clock.seek(1.3)
    curves.step(2)
    curves.move(_at(curves, 1.3, 5.0))  # on the line of the current time
    curves.key("insert")
    curves.step(2)
    assert _arm(curves).times == pytest.approx([0.0, 1.3, 2.0], abs=0.02)


def test_insert_on_a_key_selects_it_without_adding_another(curves):
    curves.move(_center(curves, "key arm.x 1"))
    curves.key("insert")
    curves.step(2)
    assert_array_equal(_arm(curves).times, [0.0, 1.0, 2.0])
    assert _chosen(curves) == [(ARM_X, 1)]
    assert curves.says("There is already a key at 1 s") and curves.undo_steps == 0


def test_delete_has_no_effect_while_a_key_is_dragged(curves):
    curves.move(_center(curves, "key arm.x 1"))
    curves.press()
    curves.key("delete")
    curves.let_go()
    curves.step(2)
    assert len(_arm(curves).times) == 3


def test_delete_removes_the_selected_keys(curves):
    curves.click(_center(curves, "key arm.x 1"))
    curves.move(_at(curves, 1.5, 10.0))
    curves.key("delete")
    curves.step()
    assert _arm(curves).times.tolist() == [0, 2] and _chosen(curves) == []
    curves.key("z", "ctrl")
    assert len(_arm(curves).times) == 3
    curves.click(_center(curves, "key arm.x 2"))
    curves.click("Delete")
    assert _arm(curves).times.tolist() == [0, 1]


def test_last_key_can_be_deleted_and_added_again(curves):
    curves.click("curve arm.y")
    curves.step(2)
    curves.click(_center(curves, "key arm.y 0"))
    curves.click("Delete")
    assert len(_clip(curves).channels[ARM_X + 1].times) == 0
    curves.step(2)
    curves.click("Add key")
    assert len(_clip(curves).channels[ARM_X + 1].times) == 1
    curves.assert_sane()


def _knob(hand, side):
    x, y = _center(hand, f"tangent {side}")
    key = _center(hand, "key arm.x 1")
    return x, y, key


@pytest.mark.parametrize("side", [0, 1])
def test_dragged_tangent_sets_the_slope(curves, side):
    curves.click(_center(curves, "key arm.x 1"))
    curves.step(2)
    across, up = _scale(curves)
    x, y, key = _knob(curves, side)
    # The smooth slope from 0.2 to -0.2 in two seconds.
    slope = math.radians(((y - key[1]) / up) / ((x - key[0]) / across))
    assert slope == pytest.approx(-0.2, abs=0.01)
    goal = key[0] + (1, -1)[side == 0] * 50, key[1] + 20
    curves.pull((x, y), goal)
    wanted = math.radians((20 / up) / (goal[0] - key[0]) * across)
    pair = _arm(curves).tangents[1]
    assert pair[side] == pytest.approx(wanted, rel=0.08) and pair[1 - side] == "smooth"
    assert curves.undo_steps == 1
    curves.key("z", "ctrl")
    assert _arm(curves).tangents[1] == ("smooth", "smooth")


def test_shift_rotates_both_tangents(curves):
    curves.click(_center(curves, "key arm.x 1"))
    curves.step(2)
    x, y, key = _knob(curves, 1)
    curves.pull((x, y), (key[0] + 50, key[1] + 20), held="shift")
    incoming, outgoing = _arm(curves).tangents[1]
    assert incoming == outgoing and isinstance(incoming, float)


def test_tangent_dragged_past_its_key_stays_finite(curves):
    curves.click(_center(curves, "key arm.x 1"))
    curves.step(2)
    x, y, key = _knob(curves, 1)
    curves.pull((x, y), (key[0] - 80, key[1] + 30))
    outgoing = _arm(curves).tangents[1][1]
    assert math.isfinite(outgoing) and abs(outgoing) > 10
    curves.assert_sane()


def test_tangent_rules_are_chosen_from_lists(curves):
    curves.click(_center(curves, "key arm.x 1"))
    curves.step(2)
    _pick(curves, "In", 0)
    assert _arm(curves).tangents[1] == ("flat", "smooth")
    _pick(curves, "Out", 1)
    assert _arm(curves).tangents[1] == ("flat", "linear")
    # The rule "number" keeps the slope of the previous rule: -0.8 per second.
    _pick(curves, "Out", 3)
    assert _arm(curves).tangents[1] == ("flat", pytest.approx(-0.8))
    assert curves.undo_steps == 3


def test_values_are_typed_in_the_shown_unit(curves):
    curves.click(_center(curves, "key arm.x 1"))
    curves.step(2)
    _type_into(curves, "Time", "0.75")
    _type_into(curves, "Value", "45")
    assert _arm(curves).times[1] == 0.75
    assert _arm(curves).values[1] == pytest.approx(math.pi / 4, rel=1e-12)
    _pick(curves, "In", 3)
    _type_into(curves, "In slope", "90")
    assert _arm(curves).tangents[1][0] == pytest.approx(math.pi / 2, rel=1e-12)
    curves.click("radians")
    curves.step(2)
    _type_into(curves, "Value", "0.25")
    assert _arm(curves).values[1] == 0.25


def test_invalid_typed_values_have_no_effect(curves):
    curves.click(_center(curves, "key arm.x 1"))
    curves.step(2)
    for text in ("nan", "inf", "-1e300", "1e999", "", "abc"):
        for label in ("Time", "Value"):
            _type_into(curves, label, text)
        assert np.isfinite(_arm(curves).values).all(), text
        assert np.abs(_arm(curves).values).max() <= 0.6, text
        assert np.abs(_arm(curves).times).max() <= 2.0, text
        curves.assert_sane()


# Extrapolation, range and time


def test_extrapolation_is_chosen_for_each_end(curves):
    _pick(curves, "Before", 4)
    assert _arm(curves).extrapolation == ("bounce", "cycle")
    _pick(curves, "After", 1)
    assert _arm(curves).extrapolation == ("bounce", "linear")
    others = [channel.extrapolation for channel in _clip(curves).channels[1:ARM_X]]
    assert set(others) == {("constant", "constant")} and curves.undo_steps == 2


def test_range_lines_are_dragged(curves):
    x, y = _center(curves, "range end")
    curves.pull((x, y), (_at(curves, 1.5, 0)[0], y))
    assert _clip(curves).end == pytest.approx(1.5, abs=0.02) and _clip(curves).start == 0.0
    assert curves.undo_steps == 1
    curves.state.clock.seek(1.0)
    curves.step(2)
    x, y = _center(curves, "range start")
    y += 25  # a key covers the middle of the line
    curves.pull((x, y), (_at(curves, 0.25, 0)[0], y))
    assert _clip(curves).start == pytest.approx(0.25, abs=0.02)
    # The line stops at the other end of the range.
    x, y = _center(curves, "range start")
    curves.pull((x, y), (_at(curves, 1.9, 0)[0], y))
    assert _clip(curves).start == _clip(curves).end


def test_time_line_moves_the_clock(curves):
    curves.state.clock.seek(0.5)
    curves.step(2)
    x, y = _center(curves, "time line")
    curves.pull((x, y), (_at(curves, 1.25, 0)[0], y))
    curves.step()
    time = curves.state.clock.time
    assert time == pytest.approx(1.25, abs=0.02)
    assert curves.dof("arm.x") == pytest.approx(float(evaluate(_arm(curves), np.array(time))))
    assert curves.undo_steps == 0


def test_offset_of_the_actor_moves_its_time_line(curves):
    curves.state.actor.offset = 1.0
    curves.step()
    curves.state.clock.seek(1.5)
    curves.step(2)
    assert _center(curves, "time line")[0] == pytest.approx(_at(curves, 0.5, 0)[0], abs=1.5)
    curves.click("Add key")
    assert 0.5 in _arm(curves).times
