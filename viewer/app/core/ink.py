"""Colours of text and lines on panels, legible on dark and light panels."""

from __future__ import annotations

from imgui_bundle import imgui

__all__ = ["ERROR", "WARNING", "Color", "accent", "faint", "ink"]

Color = tuple[float, float, float, float]

WARNING: Color = (1.0, 0.77, 0.30, 1.0)
ERROR: Color = (1.0, 0.50, 0.42, 1.0)
_DARKER = 0.58  # factor on the channels: gives a contrast of 4 or more on a light panel


def ink(color: Color) -> Color:
    """Return a colour chosen for dark panels, darker if the panels are light."""
    if not _is_light():
        return color
    red, green, blue, alpha = color
    return _DARKER * red, _DARKER * green, _DARKER * blue, alpha


def accent() -> Color:
    """Return the background of a button that is switched on."""
    return (0.95, 0.70, 0.42, 1.0) if _is_light() else (0.62, 0.36, 0.12, 1.0)


def faint(opacity: float) -> Color:
    """Return the colour of text with some opacity, for lines and areas."""
    text = imgui.get_style().color_(imgui.Col_.text)
    return text.x, text.y, text.z, opacity


def _is_light() -> bool:
    text = imgui.get_style().color_(imgui.Col_.text)
    return text.x + text.y + text.z < 1.5
