"""The user's preferences, and the state of the window that shows them."""

from __future__ import annotations

import json
from collections.abc import Callable, Container
from dataclasses import asdict, field
from pathlib import Path
from typing import Any, TypeVar

import platformdirs

from viewer.data_classes import dataclass
from viewer.media.state_files import as_json, load_kept, save_kept, to_stderr
from viewer.phrases import printable
from viewer.rendering.options import QUALITIES

CAPTURED = "captured"
"""Value of ``Appearance.captured`` in the frame in which the key was pressed."""
THEMES = {"dark": "Dark", "light": "Light", "system": "Follow the system"}
"""Themes with their labels."""
SCALES = (0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0)
"""Scales of the interface that can be chosen."""
FONT_SIZES = (9.0, 36.0)
"""Minimum and maximum font size, points at scale 1."""
SAMPLES = (1, 2, 4, 8, 16)
"""Samples per pixel that can be chosen."""
UPS = {"": "detect from the bodies", "y": "y", "z": "z", "-y": "-y", "-z": "-z"}
"""Up axes of captures and BVH files, with their labels."""


@dataclass(slots=True)
class Preferences:
    """The user's preferences; the defaults are those of a new installation."""

    theme: str = "dark"
    """A key of ``THEMES``."""
    scale: float = 0.0
    """Scale of the interface; 0 for that of the monitor."""
    font_size: float = 15.0
    """Points at scale 1."""
    in_degrees: bool = True
    """Whether angles are shown in degrees instead of radians."""
    quality: str = "final"
    """Quality of the view, a key of ``viewer.rendering.options.QUALITIES``."""
    samples: int = 4
    """Samples per pixel."""
    up: str = ""
    """A key of ``UPS``."""
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
    system_theme: str = ""
    """Theme of the system, ``"dark"`` or ``"light"``; empty if unknown."""
    theme: str = "dark"
    """Theme that is applied."""
    scale: float = 1.0
    font_size: float = 15.0
    """Scale and font size that are applied."""
    keys: dict[str, str] | None = None
    """Changed keys that are applied."""


Value = TypeVar("Value", str, float, int, bool)
_RENAMED = {
    "want screenshot": "want_screenshot",
    "want open dialog": "ask_for_files",
    "want quit": "request_quit",
}


def preferences_file() -> Path:
    """Return the file that contains the preferences."""
    return Path(platformdirs.user_config_dir("viewer", appauthor=False)) / "preferences.json"


def load_preferences(say: Callable[[str], object] = to_stderr) -> Preferences:
    """Return the stored preferences; the defaults if there are none or they are unreadable."""
    none: dict[str, Any] = {}
    found = load_kept(preferences_file(), _entries, none, say)
    preferences = _valid(found)
    known = asdict(preferences)
    wrong = [name for name in found if name in known and found[name] != known[name]]
    if wrong:
        shown = ", ".join(printable(name, 60) for name in wrong)
        say(f"{printable(preferences_file(), 300)}: invalid values are replaced: {shown}")
    return preferences


def _entries(data: bytes) -> dict[str, Any]:
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


def _valid(found: dict[str, Any]) -> Preferences:
    """Return the valid entries among stored ones, and the defaults of all others."""
    usual = Preferences()
    return Preferences(
        theme=_one_of(found.get("theme"), THEMES, usual.theme),
        scale=_one_of(found.get("scale"), (0.0, *SCALES), usual.scale),
        font_size=_between(found.get("font_size"), FONT_SIZES, usual.font_size),
        in_degrees=_one_of(found.get("in_degrees"), (True, False), usual.in_degrees),
        quality=_one_of(found.get("quality"), QUALITIES, usual.quality),
        samples=_one_of(found.get("samples"), SAMPLES, usual.samples),
        up=_one_of(found.get("up"), UPS, usual.up),
        keys=_texts(found.get("keys")),
    )


def _one_of(value: Any, known: Container[Value], usual: Value) -> Value:
    """Return a stored value if it has the right type and is a known value."""
    fits = type(value) is type(usual) or (type(value) is int and type(usual) is float)
    return type(usual)(value) if fits and value in known else usual


def _between(value: Any, limits: tuple[float, float], usual: float) -> float:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and limits[0] <= value <= limits[1] else usual


def _texts(value: object) -> dict[str, str]:
    if not isinstance(value, dict):
        return {}
    return {key: text for key, text in value.items() if isinstance(text, str)}


def save_preferences(preferences: Preferences) -> str:
    """Store the preferences; return an error message, empty if they were stored."""
    why = save_kept(preferences_file(), json.dumps(asdict(preferences), indent=1).encode())
    return f"the preferences could not be saved: {why}" if why else ""
