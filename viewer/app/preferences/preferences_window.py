"""The window "Preferences": appearance, view, files and keys."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from imgui_bundle import imgui

from viewer.app.core.actions import Shortcut
from viewer.app.core.fields import begin_field
from viewer.app.core.state import AppState
from viewer.app.core.theme import WARNING, ink, text_color
from viewer.app.core.widgets import (
    begin_window,
    button,
    choice,
    disabled,
    draw_setting,
    explain,
    note_item,
    same_line_if_room,
)
from viewer.app.files.files import Files
from viewer.app.files.model_menu import ask_for_model_folder
from viewer.app.preferences.applying import change, system_theme
from viewer.app.preferences.key_map import FIXED, chord_name, conflicts, label_of, pressed
from viewer.app.preferences.preferences import (
    CAPTURED,
    SAMPLES,
    SCALES,
    Appearance,
    Preferences,
)
from viewer.models import load_model_folder
from viewer.phrases import printable

_TITLE = "Preferences"
_SIZE = (36.0, 42.0)  # initial size of the window, in font sizes
_LISTED = 20.0  # height of the list of keys, in rows


def open_preferences(state: AppState) -> None:
    """Open the window."""
    state.of(Appearance).is_open = True
    state.of(Files).model_folder = load_model_folder()


def draw_preferences(state: AppState, shortcuts: Sequence[Shortcut]) -> None:
    """Draw the window if it is open."""
    appearance = state.of(Appearance)
    if not appearance.is_open:
        return
    shown, stays = begin_window(_TITLE, _SIZE)
    if shown:
        preferences = replace(state.of(Preferences))
        imgui.separator_text("Appearance")
        _draw_appearance(state, preferences)
        imgui.separator_text("View")
        units = {"degrees": "degrees", "radians": "radians"}
        unit = "degrees" if preferences.in_degrees else "radians"
        preferences.in_degrees = choice(state, "Angles", unit, units) == "degrees"
        text = "quality of the view when the program starts; the Display panel changes it"
        draw_setting(state, "Quality##preferred", preferences, "quality", text)
        samples = {str(count): f"{count} per pixel" for count in SAMPLES}
        chosen = choice(state, "Samples##preferred", str(preferences.samples), samples)
        explain("anti-aliasing; the driver may provide fewer")
        preferences.samples = int(chosen)
        imgui.separator_text("Files")
        text = "up axis of captures, BVH, OBJ and PLY files that are opened from now on"
        draw_setting(state, "Up axis", preferences, "up", text)
        folder = state.of(Files).model_folder
        begin_field("Model folder")
        if button(state, "Choose…##model folder"):
            ask_for_model_folder(state)
        explain("folder of body models, which the File menu lists")
        imgui.same_line()
        imgui.text_disabled("none" if folder is None else printable(folder, 60))
        imgui.separator_text("Keys")
        _draw_keys(state, preferences, shortcuts)
        why = "" if preferences != Preferences() else "all preferences have their default values"
        if button(state, "Reset all###reset preferences", why):
            preferences = Preferences()
        change(state, preferences)
    imgui.end()
    if not stays:
        close_preferences(state)


def close_preferences(state: AppState) -> None:
    """Close the window, and stop waiting for a key."""
    appearance = state.of(Appearance)
    appearance.is_open, appearance.captured = False, ""


def _draw_appearance(state: AppState, preferences: Preferences) -> None:
    appearance = state.of(Appearance)
    before = preferences.theme
    draw_setting(state, "Theme", preferences, "theme")
    if preferences.theme == "system" != before:
        appearance.system_theme = system_theme()
    if preferences.theme == "system" and not appearance.system_theme:
        imgui.text_disabled("the theme of this system is unknown: dark is used")
    _draw_scale(state, preferences)
    size = preferences.font_size
    draw_setting(state, "Font size", preferences, "font_size")
    if preferences.font_size != size:
        preferences.font_size = float(round(preferences.font_size))


def _draw_scale(state: AppState, preferences: Preferences) -> None:
    given = state.of(Appearance).given_scale
    if given:
        with disabled(state, "the scale was given on the command line"):
            choice(state, "Interface scale", "", {"": f"{100.0 * given:.0f} %"})
        return
    scales = {"0": f"automatic ({100.0 * state.of(Appearance).screen_scale:.0f} %)"}
    scales |= {f"{scale:g}": f"{100.0 * scale:.0f} %" for scale in SCALES}
    preferences.scale = float(choice(state, "Interface scale", f"{preferences.scale:g}", scales))
    explain("automatic follows the scale of the monitor")


def _draw_keys(state: AppState, preferences: Preferences, shortcuts: Sequence[Shortcut]) -> None:
    """Draw the list of keys; a click on a key waits for its replacement."""
    height = _LISTED * imgui.get_text_line_height_with_spacing()
    found = conflicts(shortcuts, preferences.keys)
    # Leaves room for the button below and a line about conflicts.
    below = (1 + bool(found)) * imgui.get_frame_height_with_spacing()
    room = imgui.get_content_region_avail().y - below
    if imgui.begin_child("##key map", (0.0, max(min(height, room), 0.2 * height))):
        for shortcut in shortcuts:
            _draw_key(state, preferences, shortcut, found.get(shortcut.name, ""))
    imgui.end_child()
    if found:
        text = f"{len(found)} actions share a key: only the first one in the list runs"
        imgui.text_colored(ink(WARNING), text)


def _draw_key(state: AppState, preferences: Preferences, shortcut: Shortcut, conflict: str) -> None:
    appearance, name = state.of(Appearance), shortcut.name
    waits = appearance.captured == name
    label = "press a key…" if waits else label_of(shortcut, preferences.keys)
    width = 10.0 * imgui.get_font_size()
    why = "this key cannot be changed" if shortcut.label in FIXED else ""
    with disabled(state, why):
        with text_color(WARNING if conflict else None):
            pressed_button = imgui.button(f"{label}###key {name}", (width, 0.0))
        note_item(state, f"key {name}")
        explain(f"also: {conflict}" if conflict else "click, then press another key", why)
    if pressed_button and not why:
        appearance.captured = "" if waits else name
    elif waits:
        _capture(state, preferences, shortcut)
    if name in preferences.keys:
        same_line_if_room("Reset")
        if button(state, f"Reset###reset key {name}"):
            preferences.keys = _without(preferences.keys, name)
    imgui.same_line()
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(shortcut.text)


def _capture(state: AppState, preferences: Preferences, shortcut: Shortcut) -> None:
    """Use the key that is pressed for an action."""
    chord = pressed()
    if imgui.is_key_pressed(imgui.Key.escape, False):
        state.of(Appearance).captured = CAPTURED
    if not chord:
        return
    state.of(Appearance).captured = CAPTURED
    preferences.keys = _without(preferences.keys, shortcut.name)
    if chord not in shortcut.chords:
        preferences.keys |= {shortcut.name: chord_name(chord)}


def _without(keys: dict[str, str], name: str) -> dict[str, str]:
    return {key: text for key, text in keys.items() if key != name}
