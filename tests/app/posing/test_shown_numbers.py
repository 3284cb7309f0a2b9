"""Numbers shown in the window: angles in the panel's unit, and no negative zero."""

import math

import numpy as np
import pytest
from app.curves.plotted import SIZE, _center, clip_text
from imgui_bundle import imgui

from viewer.app.posing.move_tool import shift_text


@pytest.fixture
def tooltips(monkeypatch):
    """Tooltip texts in the order in which they were shown."""
    said = []
    show = imgui.set_tooltip
    monkeypatch.setattr(imgui, "set_tooltip", lambda text: (said.append(text), show(text))[1])
    return said


@pytest.fixture
def sliders(monkeypatch):
    """Slider texts by label."""
    shown = {}
    draw = imgui.slider_float

    def record(label, value, low, high, text="%.3f", flags=0):
        shown[label] = text % value
        return draw(label, value, low, high, text, flags)

    monkeypatch.setattr(imgui, "slider_float", record)
    return shown


@pytest.mark.parametrize(
    ("unit", "dof", "said"),
    [
        ("degrees", "root.x", "-57.3\N{DEGREE SIGN} to 57.3\N{DEGREE SIGN}"),
        ("radians", "root.x", "-1.000 rad to 1.000 rad"),
        ("degrees", "root.z", "locked at 17.2\N{DEGREE SIGN}"),
        ("radians", "root.z", "locked at 0.300 rad"),
        ("degrees", "root.y", "28.6\N{DEGREE SIGN} to 114.6\N{DEGREE SIGN}"),
        ("degrees", "arm.x", "unlimited"),
    ],
)
def test_tooltip_shows_limits_in_the_unit_of_the_panel(hand, tooltips, unit, dof, said):
    hand.click(unit)
    hand.move(dof)
    hand.step(1)
    assert tooltips[-1].startswith(f"{dof}\n{said}")


@pytest.mark.parametrize(("unit", "factor"), [("degrees", math.degrees(1.0)), ("radians", 1.0)])
def test_copied_value_equals_the_shown_value(hand, unit, factor):
    hand.click(unit)
    hand.state.actor.pose.dofs[hand.dof_index("arm.x")] = 0.75
    hand.step(2)
    hand.click("arm.x", button=1)
    hand.click("Copy value")
    assert float(imgui.get_clipboard_text()) == pytest.approx(0.75 * factor)


@pytest.mark.parametrize("value", [-0.0, -1e-5])
def test_sliders_show_no_negative_zero(hand, sliders, value):
    row = hand.dof_index("arm.x")
    hand.state.actor.pose.dofs[row] = value
    hand.step(2)
    assert sliders[f"##dof{row}"] == "0.0\N{DEGREE SIGN}"
    assert hand.state.actor.pose.dofs[row] == value  # only the shown value is rounded
    hand.click("radians")
    assert sliders[f"##dof{row}"] == "0.0000 rad"


def test_timeline_and_status_show_no_negative_zero(drive, rig, tmp_path, texts):
    (tmp_path / "wave.anim").write_text(clip_text())
    hand = drive(*rig, tmp_path / "wave.anim", size=SIZE, samples=1)
    hand.state.clock.mode = "run on"
    hand.state.clock.seek(-1e-4)
    texts.clear()
    hand.step(2)
    assert any(text.endswith("0.000 s") for text in texts)
    assert not any("-0.000" in text for text in texts)
    hand.key("i")
    assert hand.says("0.000 s") and not hand.says("-0.000")


def test_joint_translation_shows_no_negative_zero():
    assert shift_text("root", np.array([-0.0, 0.25, -1.0])) == "root   +0 +0.25 -1"


def test_raw_pose_values_have_no_negative_zero(box, texts):
    box.click("Rotation vectors")
    box.state.actor.pose.dofs[:] = -1e-9
    texts.clear()
    box.step(2)
    shown = {text for text in texts if text.startswith("file:")}
    assert shown == {"file: 0.0000  0.0000  0.0000"}


def test_curve_view_is_fitted_again_when_the_unit_changes(curves):
    heights = [_center(curves, f"key arm.x {key}")[1] for key in (0, 1, 2)]
    curves.click("radians")
    curves.step(3)
    again = [_center(curves, f"key arm.x {key}")[1] for key in (0, 1, 2)]
    assert again == pytest.approx(heights, abs=1.5)
