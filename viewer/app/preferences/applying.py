"""Application of the preferences to the running window: theme, scale, font and keys.

The theme may follow the desktop, if it can be queried: macOS, Windows, and desktops with gsettings.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence
from typing import Literal

from imgui_bundle import imgui

from viewer.app.core.actions import Shortcut
from viewer.app.core.state import AppState
from viewer.app.core.theme import Theme, change_scale, set_theme
from viewer.app.core.widgets import KeyNames
from viewer.app.files.files import Files
from viewer.app.preferences.key_map import label_of
from viewer.app.preferences.preferences import Appearance, Preferences, save_preferences

_PATIENCE = 1.0  # time limit in seconds: some desktops do not respond
_GSETTINGS = ("gsettings", "get", "org.gnome.desktop.interface", "color-scheme")
_DEFAULTS = ("defaults", "read", "-g", "AppleInterfaceStyle")
_PERSONALIZE = r"Software\Microsoft\Windows\CurrentVersion\Themes\Personalize"


def start_with(state: AppState, preferences: Preferences) -> None:
    """Apply stored preferences to a new window."""
    state.put(preferences)
    state.in_degrees, state.of(Files).up = preferences.in_degrees, preferences.up


def change(state: AppState, preferences: Preferences) -> None:
    """Replace the preferences, apply their changes to the view, and store them."""
    before = state.of(Preferences)
    if preferences == before:
        return
    state.put(preferences)
    state.of(Files).up = preferences.up
    if preferences.in_degrees != before.in_degrees:
        state.in_degrees = preferences.in_degrees
    if preferences.quality != before.quality:
        state.options.quality = preferences.quality
    if preferences.samples != before.samples:
        state.options.samples = preferences.samples
    problem = save_preferences(preferences)
    if problem:
        state.say_status(problem)


def chosen_scale(preferences: Preferences, appearance: Appearance) -> float:
    """Return the scale of the interface: the given, the preferred, or the monitor's scale."""
    return appearance.given_scale or preferences.scale or appearance.screen_scale


def chosen_theme(preferences: Preferences, appearance: Appearance) -> Theme:
    """Return the theme of the interface: the preferred one, or the system's."""
    if preferences.theme == "system":
        return appearance.system_theme or "dark"
    return preferences.theme


def follow_preferences(state: AppState, shortcuts: Sequence[Shortcut]) -> None:
    """Apply the preferences that differ from the applied ones; called in every frame."""
    preferences, applied = state.of(Preferences), state.of(Appearance)
    theme = chosen_theme(preferences, applied)
    if theme != applied.theme:
        set_theme(theme)
        applied.theme = theme
    scale = chosen_scale(preferences, applied)
    if scale != applied.scale:
        change_scale(applied.scale, scale)
        applied.scale = scale
    if preferences.font_size != applied.font_size:
        # If the size were set now, it would be overwritten at the end of the frame.
        imgui.get_style()._next_frame_font_size_base = preferences.font_size
        applied.font_size = preferences.font_size
    if preferences.keys != applied.keys:
        applied.keys = dict(preferences.keys)
        names = {key.label: label_of(key, preferences.keys) for key in shortcuts}
        state.of(KeyNames).changed = {usual: name for usual, name in names.items() if name != usual}


def system_theme() -> Literal[""] | Theme:
    """Return the system's theme; empty if it cannot be determined."""
    if sys.platform == "win32":
        import winreg

        try:
            with winreg.OpenKey(winreg.HKEY_CURRENT_USER, _PERSONALIZE) as key:  # type: ignore[attr-defined,unused-ignore]
                value, _ = winreg.QueryValueEx(key, "AppsUseLightTheme")  # type: ignore[attr-defined,unused-ignore]
        except OSError:
            return ""
        return "light" if value else "dark"
    if sys.platform == "darwin":
        # The key exists only while the dark theme is chosen.
        return "dark" if "Dark" in _answer(_DEFAULTS) else "light"
    scheme = _answer(_GSETTINGS)
    if not scheme:
        return ""
    return "dark" if "dark" in scheme else "light"


def _answer(command: tuple[str, ...]) -> str:
    """Return a command's output; empty if the command is missing, fails or takes too long."""
    if shutil.which(command[0]) is None:
        return ""
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=_PATIENCE, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout if done.returncode == 0 else ""
