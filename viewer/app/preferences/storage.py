"""Stored preferences; unknown and invalid entries get their default values."""

from __future__ import annotations

import json
from collections.abc import Container
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import platformdirs

from viewer.app.preferences.state import FONT_SIZES, SAMPLES, SCALES, THEMES, UPS, Preferences
from viewer.errors import OutputError
from viewer.formats import save_bytes
from viewer.phrases import printable
from viewer.rendering.options import QUALITIES

__all__ = ["load_preferences", "preferences_file", "save_preferences"]


Value = TypeVar("Value", str, float, int, bool)


def preferences_file() -> Path:
    """Return the file that contains the preferences."""
    return Path(platformdirs.user_config_dir("viewer", appauthor=False)) / "preferences.json"


def load_preferences() -> Preferences:
    """Return the stored preferences; the defaults if there are none or they are unreadable."""
    try:
        found = json.loads(preferences_file().read_text("utf-8"))
    except (OSError, ValueError, RecursionError):
        return Preferences()
    usual = Preferences()
    if not isinstance(found, dict):
        return usual
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
    path = preferences_file()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        save_bytes(path, json.dumps(asdict(preferences), indent=1).encode())
    except OSError as problem:
        return f"the preferences could not be saved: {printable(path, 300)}: {problem.strerror}"
    except OutputError as problem:
        return f"the preferences could not be saved: {problem}"
    return ""
