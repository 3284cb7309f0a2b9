"""The user's preferences, and the state of the window that shows them."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import Field, asdict, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from viewer.data_classes import dataclass, setting
from viewer.media.state_files import as_json, config_file, load_kept, save_kept, to_stderr
from viewer.phrases import printable
from viewer.rendering.options import QUALITIES, Quality

if TYPE_CHECKING:
    from viewer.app.core.theme import Theme
    from viewer.rigs.geometry.vectors import StatedUp

CAPTURED = "captured"
"""Value of ``Appearance.captured`` in the frame in which the key was pressed."""
THEMES: dict[Theme | Literal["system"], str] = {
    "dark": "Dark",
    "light": "Light",
    "system": "Follow the system",
}
"""Themes with their labels."""
SCALES = (0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0)
"""Scales of the interface that can be chosen."""
SAMPLES = (1, 2, 4, 8, 16)
"""Samples per pixel that can be chosen."""
UPS: dict[StatedUp, str] = {
    "": "detect from the bodies",
    "y": "y",
    "z": "z",
    "-y": "-y",
    "-z": "-z",
}
"""Up axes of captures, BVH, OBJ and PLY files, with their labels."""


@dataclass(slots=True)
class Preferences:
    """The user's preferences; the defaults are those of a new installation."""

    theme: Theme | Literal["system"] = setting("dark", choices=THEMES)
    scale: float = setting(0.0, choices=(0.0, *SCALES))
    """Scale of the interface; 0 for that of the monitor."""
    font_size: float = setting(15.0, limits=(9.0, 36.0), unit="%.0f")
    """Points at scale 1."""
    in_degrees: bool = setting(True)
    """Whether angles are shown in degrees instead of radians."""
    quality: Quality = setting("final", choices=QUALITIES)
    """Quality of the view."""
    samples: int = setting(4, choices=SAMPLES)
    """Samples per pixel."""
    up: StatedUp = setting("", choices=UPS)
    """Up axis of captures, BVH, OBJ and PLY files."""
    keys: dict[str, str] = field(default_factory=dict)
    """Keys that differ from the default: maps names of actions to names of keys."""


@dataclass(slots=True)
class Appearance:
    """State of the window "Preferences", and the choices already applied."""

    is_open: bool = False
    """Whether the window is open."""
    captured: str = ""
    """Name of the action whose key is pressed next, or ``CAPTURED``; empty if none."""
    screen_scale: float = 1.0
    """Scale of the interface that suits the monitor."""
    given_scale: float | None = None
    """Scale given on the command line, which takes precedence."""
    system_theme: Literal[""] | Theme = ""
    """Theme of the system; empty if unknown."""
    theme: Theme = "dark"
    """Theme that is applied."""
    scale: float = 1.0
    font_size: float = 15.0
    """Scale and font size that are applied."""
    keys: dict[str, str] | None = None
    """Changed keys that are applied."""


_RENAMED = {
    "want screenshot": "want_screenshot",
    "want open dialog": "ask_for_files",
    "want quit": "request_quit",
}


def preferences_file() -> Path:
    """Return the file that contains the preferences."""
    return config_file("preferences.json")


def load_preferences(say: Callable[[str], object] = to_stderr) -> Preferences:
    """Return the stored preferences; the defaults if there are none or they are unreadable."""
    none: dict[str, object] = {}
    found = load_kept(preferences_file(), _entries, none, say)
    preferences = Preferences(keys=_texts(found.get("keys")))
    for each in fields(Preferences):
        value = found.get(each.name)
        if each.metadata and _fits(each, value):
            if isinstance(each.default, float) and isinstance(value, int):
                value = float(value)
            setattr(preferences, each.name, value)
    known = asdict(preferences)
    wrong = [name for name in found if name in known and found[name] != known[name]]
    if wrong:
        shown = ", ".join(printable(name, 60) for name in wrong)
        say(f"{printable(preferences_file(), 300)}: invalid values are replaced: {shown}")
    return preferences


def _entries(data: bytes) -> dict[str, object]:
    found = as_json(data)
    if not isinstance(found, dict):
        raise ValueError("expected an object")
    keys = found.get("keys")
    if isinstance(keys, dict):
        found["keys"] = {_present_name(name): key for name, key in keys.items()}
    return found


def _present_name(stored: str) -> str:
    """Return the name of an action; up to version 0.2, its module stood before it.

    >>> _present_name("view.camera_actions.look front"), _present_name("window_actions.want quit")
    ('look front', 'request_quit')
    """
    function, space, arguments = stored.partition(" ")
    name = function.rpartition(".")[2] + space + arguments
    return _RENAMED.get(name, name)


def _fits(each: Field[object], value: object) -> bool:
    """Return whether a stored value has the type of a field, and is one that the field allows."""
    # Any integer is a number for JSON, even one that is too large for a float.
    if type(value) not in ((int, float) if type(each.default) is float else (type(each.default),)):
        return False
    if "limits" in each.metadata:
        low, high = each.metadata["limits"]
        return isinstance(value, int | float) and low <= value <= high
    return value in each.metadata.get("choices", (True, False))


def _texts(value: object) -> dict[str, str]:
    if not isinstance(value, dict):
        return {}
    return {key: text for key, text in value.items() if isinstance(text, str)}


def save_preferences(preferences: Preferences) -> str:
    """Store the preferences; return an error message, empty if they were stored."""
    why = save_kept(preferences_file(), json.dumps(asdict(preferences), indent=1).encode())
    return f"the preferences could not be saved: {why}" if why else ""
