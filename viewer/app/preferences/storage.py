"""Stored preferences; unknown and invalid entries get their default values."""

from __future__ import annotations

import json
from collections.abc import Callable, Container
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import platformdirs

from viewer.app.preferences.state import FONT_SIZES, SAMPLES, SCALES, THEMES, UPS, Preferences
from viewer.media.kept_files import as_json, load_kept, save_kept, to_stderr
from viewer.phrases import printable
from viewer.rendering.options import QUALITIES

__all__ = ["load_preferences", "preferences_file", "save_preferences"]


Value = TypeVar("Value", str, float, int, bool)


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
    return found


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
