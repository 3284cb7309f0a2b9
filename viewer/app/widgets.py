"""Widgets that several panels use; each notes where it was drawn."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.state import AppState

__all__ = ["button", "checkbox", "choice", "note_item", "slider"]


def note_item(state: AppState, label: str) -> None:
    """Remember where the last widget is, under a label that tests can aim at."""
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    state.item_rects[label] = (low.x, low.y, high.x, high.y)


def slider(
    state: AppState,
    label: str,
    value: float,
    low: float,
    high: float,
    unit: str = "%.2f",
    flags: int = 0,
) -> float:
    """Draw a slider and return its value; one that was not moved keeps every digit."""
    changed, moved = imgui.slider_float(label, value, low, high, unit, flags)
    note_item(state, label)
    return moved if changed else value


def checkbox(state: AppState, label: str, value: bool) -> bool:
    """Draw a check box and return its state."""
    result = imgui.checkbox(label, value)[1]
    note_item(state, label)
    return result


def button(state: AppState, label: str) -> bool:
    """Draw a button and return whether it was pressed."""
    pressed = imgui.button(label)
    note_item(state, label)
    return pressed


def choice(state: AppState, label: str, value: str, texts: dict[str, str]) -> str:
    """Draw a drop-down list and return the chosen key."""
    keys = list(texts)
    index = keys.index(value) if value in keys else 0
    changed, chosen = imgui.combo(label, index, list(texts.values()))
    note_item(state, label)
    return keys[chosen] if changed else value
