"""Typing into fields: focus, Tab, Escape, calculations, and invalid input."""

import math

import pytest
from imgui_bundle import imgui

from viewer.app.core.text_fields import read_number
from viewer.app.files.files import Files


def _typed(hand):
    """Return the text of the active field and its selected part."""
    editing = imgui.internal.get_input_text_state(imgui.internal.get_active_id())
    if editing is None:
        return None
    ends = sorted((editing.get_selection_start(), editing.get_selection_end()))
    return editing.get_text(), editing.get_text()[slice(*ends)]


def test_tab_moves_to_the_next_field_and_selects_its_content(hand):
    hand.click("Filter")
    hand.key("tab")
    hand.step(2)
    text, selected = _typed(hand)
    assert text == selected != ""
    hand.type("2")
    hand.key("tab")
    hand.step(2)
    assert hand.dof("root.tx") == 2.0 and _typed(hand)[1] == "0.0000"
    hand.key("tab", "shift")
    hand.step(2)
    assert _typed(hand) == ("2.0000", "2.0000")
    assert hand.state.panels_visible and hand.undo_steps == 1


@pytest.mark.parametrize(
    ("label", "text", "value"),
    [
        ("root.tx", "3/2", 1.5),
        ("root.tx", "-(1.5 + 1) * 2", -5.0),
        ("root.tx", "1,5", 1.5),
        ("arm.x", "90/2", math.pi / 4),
        ("arm.x", "pi/6 rad", math.pi / 6),
        ("arm.x", "-30 \N{DEGREE SIGN}", -math.pi / 6),
    ],
)
def test_calculation_with_a_unit_is_evaluated(hand, label, text, value):
    hand.enter_value(label, text)
    assert hand.dof(label) == pytest.approx(value, rel=1e-12)
    assert hand.undo_steps == 1


@pytest.mark.parametrize("text", ["abc", "1.5 m", "1/0", "90//2", "2**3", "__import__('os')"])
def test_invalid_input_is_quoted_and_keeps_the_value(hand, text):
    before = hand.dofs()
    hand.enter_value("root.tx", text)
    assert (hand.dofs() == before).all() and hand.says(f'found "{text}"')


def test_units_are_converted_to_that_of_the_field():
    assert read_number("250 ms", "s") == 0.25
    assert read_number("1.5 m", "cm") == 150.0
    assert read_number("50 %", "%") == 50.0


def test_escape_restores_only_the_value(hand):
    hand.state.selected_joint, before = 1, hand.dofs()
    hand.click(hand.place("arm.x", 0.3), held="ctrl")
    hand.type("12")
    hand.key("escape")
    hand.step(2)
    assert (hand.dofs() == before).all() and hand.state.selected_joint == 1
    hand.key("escape")
    assert hand.state.selected_joint == -1


def test_escape_in_a_dialog_restores_the_path_first(hand):
    hand.key("o", "ctrl")
    hand.step(4)
    folder = str(hand.state.of(Files).dialog.folder)
    assert _typed(hand) == (folder, folder)
    hand.type("nowhere")
    hand.key("escape")
    hand.step(2)
    assert hand.state.of(Files).dialog is not None and not hand.state.of(Files).dialog.problem
    hand.key("escape")
    assert hand.state.of(Files).dialog is None


def test_keys_typed_into_a_field_change_neither_time_nor_camera(curves):
    hand = curves
    camera = (hand.state.camera.azimuth, hand.state.camera.distance)
    hand.show_panel("Timeline")
    hand.click("Frame")
    for key in ("right_arrow", "home", "end", "left_arrow", "space"):
        hand.key(key)
    assert hand.state.clock.time == 0.0 and not hand.state.clock.playing
    assert (hand.state.camera.azimuth, hand.state.camera.distance) == camera
    hand.key("a", "ctrl")
    hand.type("3")
    hand.key("enter")
    hand.step(2)
    assert hand.state.clock.frame == 3


def test_name_for_a_new_file_is_selected_without_its_suffix(hand, rig):
    hand.menu("menu File", "Export…")
    hand.step(2)
    assert _typed(hand) == ("tiny.obj", "tiny")
    hand.type("other")
    hand.key("enter")
    hand.finish_job()
    assert hand.state.of(Files).dialog is None and (rig[0].parent / "other.obj").is_file()
    # A suffix typed in front of the unselected suffix is not duplicated.
    hand.menu("menu File", "Export…")
    hand.step(2)
    hand.type("third.obj")
    hand.key("enter")
    hand.finish_job()
    assert (rig[0].parent / "third.obj").is_file()
    # An existing file is not replaced by Enter.
    hand.menu("menu File", "Export…")
    hand.step(2)
    hand.type("other")
    hand.key("enter")
    hand.step(3)
    assert "other.obj exists" in hand.state.of(Files).dialog.problem


def test_files_are_chosen_and_opened_with_the_keyboard(hand, rig):
    (rig[0].parent / "inner").mkdir()
    hand.key("o", "ctrl")
    hand.step(4)
    for key in ("down_arrow", "enter", "backspace", "down_arrow", "down_arrow"):
        hand.key(key)
        hand.step(2)
    dialog = hand.state.of(Files).dialog
    assert (dialog.folder, dialog.chosen) == (rig[0].parent, {rig[0]})
    hand.key("enter")
    hand.wait_for_loader()
    assert hand.state.actor.figure.mesh is None
