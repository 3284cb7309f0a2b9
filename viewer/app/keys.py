"""Keyboard input: pressed keys run the actions in the table of keys; Esc and the window's keys."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field

from imgui_bundle import imgui

from viewer.app.closing import Closing, keep_open, question_of
from viewer.app.core.actions import Shortcut
from viewer.app.core.state import AppState
from viewer.app.files.files import Files
from viewer.app.linting.lint_panel import Linting
from viewer.app.manual import Manual
from viewer.app.palette import Palette
from viewer.app.posing.toolbar import cancel_drag
from viewer.app.preferences.key_map import chords_of
from viewer.app.preferences.preferences import CAPTURED, Appearance, Preferences
from viewer.app.preferences.preferences_window import close_preferences
from viewer.app.recording.recording import RecordingState
from viewer.app.rigging.joint_editing.drags import cancel_joint_drag
from viewer.app.rigging.joint_editing.state import stop_editing
from viewer.app.rigging.tools import drop_rig_tool
from viewer.app.weights.weights_panel import Weights, unpin
from viewer.data_classes import dataclass

_REPEATED = (imgui.Key.left_arrow, imgui.Key.right_arrow)  # these repeat while held
_NAVIGATION = {  # these navigate an open menu or list, and choose from it
    imgui.Key.left_arrow,
    imgui.Key.right_arrow,
    imgui.Key.up_arrow,
    imgui.Key.down_arrow,
    imgui.Key.space,
    imgui.Key.enter,
}
_ALWAYS = ("Esc", "Ctrl+Q")  # these work even while a message or dialog is open
_Bound = tuple[imgui.Key, bool, Shortcut]
"""A key without modifiers, whether it repeats while held, and its action."""


@dataclass(slots=True)
class Keyboard:
    """State of the keyboard."""

    is_listed: bool = False
    """Whether the list of keys is shown."""
    modifiers: int = 0
    """Modifiers in the previous frame, as ImGui's bits."""
    has_menu: bool = False
    """Whether a menu or list was open when keys were last handled. ImGui may have closed it
    since."""
    chosen: dict[str, str] = field(default_factory=dict)
    """The user's keys for which the table below was made, as in ``Preferences.keys``."""
    bound: dict[int, list[_Bound]] = field(default_factory=dict)
    """Keys in the order of the table of keys, by the modifiers that are held with them."""

    def of(
        self, shortcuts: Sequence[Shortcut], chosen: Mapping[str, str], held: int
    ) -> list[_Bound]:
        """Return the keys that run an action while these modifiers are held."""
        if not self.bound or self.chosen != chosen:
            self.chosen, self.bound = dict(chosen), _bound(shortcuts, chosen)
        return self.bound.get(held, [])


def handle_keys(state: AppState, shortcuts: Sequence[Shortcut]) -> None:
    """Run the actions of keys pressed in this frame; letters typed into a text box are ignored."""
    keyboard = state.of(Keyboard)
    had_menu, keyboard.has_menu = keyboard.has_menu, _has_menu()
    # The arrow keys move through an open menu or list; without one, they step through frames, and
    # ImGui must not move the focus with them.
    io, flag = imgui.get_io(), imgui.ConfigFlags_.nav_enable_keyboard
    io.config_flags = io.config_flags | flag if keyboard.has_menu else io.config_flags & ~flag
    # Ctrl may be released in the frame in which the letter is pressed. Modifiers held in the
    # previous frame still count, or Ctrl+S would be interpreted as S.
    now = imgui.get_io().key_mods
    held, keyboard.modifiers = now | keyboard.modifiers, now
    if imgui.get_io().want_text_input:
        return
    # Otherwise ImGui would move the focus with Tab even while nothing is typed.
    imgui.internal.set_key_owner(imgui.Key.tab, imgui.get_id("viewer"))
    if state.of(Palette).is_open:
        # Letters may be typed before the text box of the palette has the focus.
        return
    if imgui.is_key_pressed(imgui.Key.escape, False) and (_close_menus() or had_menu):
        return
    appearance = state.of(Appearance)
    if appearance.captured:
        # The key belongs to the list of keys and must not run an action.
        appearance.captured = "" if appearance.captured == CAPTURED else appearance.captured
        return
    is_covered = bool(state.error) or state.of(Files).dialog is not None
    is_covered |= question_of(state) is not None
    chosen = state.of(Preferences).keys
    for key, repeats, shortcut in keyboard.of(shortcuts, chosen, int(held)):
        if is_covered and shortcut.label not in _ALWAYS:
            continue
        if (had_menu or keyboard.has_menu) and key in _NAVIGATION:
            continue
        if imgui.is_key_pressed(key, repeats):
            shortcut.run(state)
            break


def _bound(shortcuts: Sequence[Shortcut], chosen: Mapping[str, str]) -> dict[int, list[_Bound]]:
    """Return the keys by their modifiers; splitting chords in every frame would be slow."""
    mask = int(imgui.Key.mod_mask_)
    bound: dict[int, list[_Bound]] = {}
    for shortcut in shortcuts:
        for chord in map(int, chords_of(shortcut, chosen)):
            key = imgui.Key(chord & ~mask)
            bound.setdefault(chord & mask, []).append((key, key in _REPEATED, shortcut))
    return bound


def _has_menu() -> bool:
    """Return whether a menu or list is open. Messages handle keys themselves."""
    any_popup = imgui.PopupFlags_.any_popup_id | imgui.PopupFlags_.any_popup_level
    has_modal = imgui.internal.get_top_most_popup_modal() is not None
    return not has_modal and imgui.is_popup_open("", any_popup)


def _close_menus() -> bool:
    """Close an open menu or list; return whether there was one."""
    if not _has_menu():
        return False
    imgui.internal.close_popup_to_level(0, True)
    return True


def cancel(state: AppState) -> None:
    """Close the topmost message, dialog or key list; otherwise clear the selection."""
    files = state.of(Files)
    recording = state.of(RecordingState)
    keyboard = state.of(Keyboard)
    linting = state.of(Linting)
    manual = state.of(Manual)
    if cancel_drag(state) or cancel_joint_drag(state):
        return
    if state.error:
        state.error = ""
    elif files.dialog is not None:
        files.dialog = None
    elif question_of(state) is not None:
        keep_open(state)
    elif state.messages.is_open:
        state.messages.is_open = False
    elif state.of(Appearance).is_open:
        close_preferences(state)
    elif manual.topic:
        manual.topic = ""
    elif files.loader is not None:
        files.loader.cancel()
        files.loader = None
        state.say_status("Opening cancelled")
    elif state.job is not None and not state.job.is_cancelled:
        state.job.cancel()
        state.of(Closing).withdraw()
        state.say_status("Cancelled")
    elif recording.settings is not None:
        recording.settings = None
    elif files.stream is not None:
        files.stream.cancel()
        files.stream = None
        state.say_status("Reading cancelled; the frames read so far are kept")
    elif keyboard.is_listed:
        keyboard.is_listed = False
    elif drop_rig_tool(state):
        state.say_status("Template tool off")
    elif stop_editing(state):
        state.say_status("Edit skeleton is off")
    elif linting.chosen >= 0:
        linting.chosen = -1
    elif state.of(Weights).pinned is not None:
        unpin(state)
        state.say_status("Vertex unpinned")
    else:
        state.deselect()


def toggle_panels(state: AppState) -> None:
    """Show or hide menus and panels."""
    state.panels_visible = not state.panels_visible


def toggle_keys(state: AppState) -> None:
    """Show or hide the list of keys."""
    keyboard = state.of(Keyboard)
    keyboard.is_listed = not keyboard.is_listed


def toggle_messages(state: AppState) -> None:
    """Open or close the window "Messages"."""
    state.messages.is_open = not state.messages.is_open


def want_screenshot(state: AppState) -> None:
    """Save a picture of the scene after the frame."""
    state.wants_screenshot = True
