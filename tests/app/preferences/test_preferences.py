"""Preferences: applied while the window runs, stored, validated when read, and reset."""

import json
from dataclasses import asdict, replace

import pytest
from imgui_bundle import imgui

from viewer.app.core.widgets import key_name
from viewer.app.features import KEYS
from viewer.app.files.model_menu import set_model_folder
from viewer.app.preferences import preferences_window
from viewer.app.preferences.key_map import chord_name, conflicts, parse_chord
from viewer.app.preferences.preferences import (
    Appearance,
    Preferences,
    load_preferences,
    preferences_file,
    save_preferences,
)
from viewer.phrases import printable

WIREFRAME = next(key.name for key in KEYS if key.label == "W")
STORED = {  # names of actions in the preferences of version 0.2, by the usual key
    "R": "posing.pose_actions.reset_pose",
    "S": "view.display_actions.toggle_skeleton",
    "K": "view.display_actions.toggle_binding",
    "W": "view.display_actions.toggle_option wireframe Wireframe",
    "N": "view.display_actions.toggle_option normals Vertex normals",
    "T": "view.display_actions.toggle_option texture Texture",
    "G": "view.display_actions.toggle_option grid Grid",
    "A": "rigging.results.switch_version",
    "B": "view.display_actions.toggle_option xray X-ray",
    "J": "view.display_actions.toggle_option joint_names Joint names",
    "Shift+J": "view.display_actions.toggle_option joint_axes Joint axes",
    "V": "weights.actions.toggle_weights",
    "F": "view.camera_actions.fit_view",
    ".": "view.camera_actions.fit_selection",
    "1": "view.camera_actions.look front",
    "3": "view.camera_actions.look left",
    "7": "view.camera_actions.look top",
    "Ctrl+1": "view.camera_actions.look back",
    "Ctrl+3": "view.camera_actions.look right",
    "Ctrl+7": "view.camera_actions.look bottom",
    "5": "view.camera_actions.toggle_projection",
    "Tab": "window_actions.toggle_panels",
    "H or ?": "window_actions.toggle_keys",
    "Ctrl+P": "palette.palette_window.toggle_palette",
    "Ctrl+M": "window_actions.toggle_messages",
    "F12": "window_actions.want screenshot",
    "Ctrl+O": "window_actions.want open dialog",
    "Ctrl+,": "preferences.preferences_window.open_preferences",
    "Ctrl+Z": "core.undo_actions.undo",
    "Ctrl+Shift+Z": "core.undo_actions.redo",
    "Q": "posing.tool_actions.choose_tool select",
    "E": "posing.tool_actions.choose_tool rotate",
    "D": "posing.tool_actions.choose_tool move",
    "X": "posing.tool_actions.next_orientation",
    "M": "posing.pose_actions.mirror",
    "Ctrl+C": "posing.pose_actions.copy_pose",
    "Ctrl+Shift+C": "posing.pose_actions.copy_numbers",
    "Ctrl+V": "posing.pose_actions.paste_pose",
    "Space": "playback.actions.play",
    "Left": "playback.actions.step -1",
    "Right": "playback.actions.step 1",
    "Shift+Left": "playback.actions.step -10",
    "Shift+Right": "playback.actions.step 10",
    "Home": "playback.actions.go_to_end False",
    "End": "playback.actions.go_to_end True",
    "[": "playback.animations.step_animation -1",
    "]": "playback.animations.step_animation 1",
    "I": "playback.actions.range_in",
    "O": "playback.actions.range_out",
    "Ctrl+Q": "window_actions.want quit",
}
CHANGED = Preferences("light", 1.5, 18.0, False, "draft", 8, "z", {WIREFRAME: "Shift+P"})


@pytest.fixture
def shown(drive, rig):
    """A test driver on an app with the preferences window open."""
    hand = drive(*rig, size=(1280, 1000), samples=1)
    hand.key("comma", "ctrl")
    hand.step(3)
    return hand


def height(hand):
    """Return the height of a menu's title, which scales with the font."""
    _, y0, _, y1 = hand.state.item_rects["menu File"]
    return y1 - y0


def luminance():
    return sum(list(imgui.get_style().color_(imgui.Col_.window_bg))[:3]) / 3.0


def test_names_stored_by_earlier_versions_are_known():
    """A user's keys are stored by these names: a name that changed would lose them."""
    chosen = {name: f"Ctrl+F{number}" for number, name in enumerate(STORED.values())}
    preferences_file().parent.mkdir(parents=True, exist_ok=True)
    said = []
    for stored in (
        chosen,
        {key.name: chosen[STORED[key.label]] for key in KEYS if key.label in STORED},
    ):
        preferences_file().write_text(json.dumps({"keys": stored}))
        keys = load_preferences(said.append).keys
        assert [keys.get(key.name) for key in KEYS] == [
            chosen.get(STORED.get(key.label)) for key in KEYS
        ]
    assert said == []


def test_stored_preferences_are_restored():
    assert load_preferences() == Preferences()
    assert save_preferences(CHANGED) == ""
    assert load_preferences() == CHANGED


@pytest.mark.parametrize(
    "wrong",
    [
        {"theme": "pink"},
        {"scale": 77},
        {"scale": True},
        {"font_size": "big"},
        {"font_size": 1e9},
        {"font_size": 10**400},
        {"scale": 10**400},
        {"in_degrees": 1},
        {"samples": 3},
        {"up": ["y"]},
        {"keys": ["W"]},
        {"quality": None},
    ],
)
def test_invalid_entry_is_replaced_by_its_default_only(wrong):
    save_preferences(CHANGED)
    preferences_file().write_text(json.dumps(asdict(CHANGED) | wrong))
    (name,) = wrong
    assert load_preferences() == replace(CHANGED, **{name: getattr(Preferences(), name)})


@pytest.mark.parametrize("text", ["", "null", "[]", "{", '"text"'])
def test_unreadable_file_is_replaced_by_the_defaults(text):
    save_preferences(CHANGED)
    preferences_file().write_text(text)
    assert load_preferences() == Preferences()


def test_theme_is_applied_immediately_and_stored(shown):
    assert luminance() < 0.3
    shown.pick("Theme", 1)
    assert luminance() > 0.8
    assert load_preferences().theme == "light"
    shown.click("Reset all###reset preferences")
    assert luminance() < 0.3
    assert load_preferences() == Preferences()


def test_scale_is_applied_immediately_unless_given_by_option(shown):
    before = height(shown)
    shown.pick("Interface scale", 2)  # 100 %, like the monitor
    shown.pick("Interface scale", 4)
    shown.step(2)
    assert height(shown) == pytest.approx(1.5 * before, rel=0.1)
    shown.state.of(Appearance).given_scale = 1.0
    shown.step(3)
    assert height(shown) == pytest.approx(before, rel=0.1)


def test_monitor_scale_is_followed(hand):
    before = height(hand)
    hand.state.of(Appearance).screen_scale = 2.0
    hand.step(3)
    assert height(hand) == pytest.approx(2.0 * before, rel=0.1)


def test_font_size_and_unit_are_applied(shown):
    before = imgui.get_font_size()
    shown.enter_value("Font size", "20")
    assert imgui.get_font_size() == pytest.approx(before * 20 / 15)
    shown.pick("Angles", 1)
    assert not shown.state.in_degrees


def test_shortcut_is_chosen_by_pressing_it(shown):
    shown.click(f"key {WIREFRAME}")
    shown.key("p", "shift")
    shown.step(2)
    assert load_preferences().keys == {WIREFRAME: "Shift+P"}
    assert not shown.state.options.wireframe
    shown.key("w")
    assert not shown.state.options.wireframe
    shown.key("p", "shift")
    assert shown.state.options.wireframe
    assert key_name(shown.state, "W") == "Shift+P"
    shown.click(f"Reset###reset key {WIREFRAME}")
    shown.key("w")
    assert not shown.state.options.wireframe


def test_buttons_show_the_chosen_shortcut(shown):
    reset = next(key.name for key in KEYS if key.label == "R")
    shown.state.put(Preferences(keys={reset: "Ctrl+R"}))
    shown.step(2)
    assert "Reset (Ctrl+R)" in shown.state.item_rects
    assert "Reset (R)" not in shown.state.item_rects


def test_shortcut_in_use_is_reported_and_does_not_act_while_chosen(shown):
    shown.click(f"key {WIREFRAME}")
    shown.key("n")
    shown.step(2)
    assert not shown.state.options.normals
    found = conflicts(KEYS, load_preferences().keys)
    assert set(found) == {WIREFRAME, next(key.name for key in KEYS if key.label == "N")}
    shown.key("n")  # the first action in the list runs
    assert shown.state.options.wireframe and not shown.state.options.normals


def test_escape_first_cancels_the_choice_of_a_shortcut_and_then_closes_the_window(shown):
    shown.click(f"key {WIREFRAME}")
    shown.key("escape")
    shown.step(2)
    assert not shown.state.of(Appearance).captured and shown.state.of(Appearance).is_open
    shown.key("escape")
    assert not shown.state.of(Appearance).is_open


def test_default_shortcuts_have_no_conflicts_and_their_names_round_trip():
    assert conflicts(KEYS, {}) == {}
    for key in KEYS:
        for chord in key.chords:
            name = chord_name(chord)
            assert not name or parse_chord(name) == chord, key.label
    assert parse_chord("Ctrl+Nothing") == parse_chord("Hyper+A") == parse_chord("") == 0


def test_chosen_model_folder_is_shown(shown, tmp_path, monkeypatch):
    said = []
    monkeypatch.setattr(imgui, "text_disabled", said.append)
    shown.step()
    assert "none" in said
    said.clear()
    set_model_folder(shown.state, [tmp_path])
    shown.step()
    assert printable(tmp_path.resolve(), 60) in said and "none" not in said


def test_scale_given_by_option_is_shown_without_changing_the_setting(shown, monkeypatch):
    asked = []
    monkeypatch.setattr(
        preferences_window, "choice", lambda *given: asked.append(given) or given[2]
    )
    for scale, expected in ((1.25, "125 %"), (2.0, "200 %")):
        shown.state.of(Appearance).given_scale = scale
        shown.step()
        assert (shown.state, "Interface scale", "", {"": expected}) in asked
    assert shown.state.of(Preferences).scale == 0.0
