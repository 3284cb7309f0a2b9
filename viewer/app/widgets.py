"""Widgets that several panels use; each notes where it was drawn."""

from __future__ import annotations

import math

from imgui_bundle import imgui

from viewer.app.state import AppState

__all__ = [
    "begin_menu",
    "button",
    "checkbox",
    "choice",
    "menu_item",
    "note_item",
    "number_text",
    "same_line_if_room",
    "slider",
]


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
    # "nan" and "1e99" can be typed into a slider.
    return moved if changed and math.isfinite(moved) else value


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


def begin_menu(state: AppState, text: str, enabled: bool = True) -> bool:
    """Draw a menu's title and return whether it is open; then ``imgui.end_menu`` follows."""
    opened = imgui.begin_menu(text, enabled)
    if not opened:
        note_item(state, f"menu {text}")
    return opened


def menu_item(
    state: AppState, text: str, key: str = "", checked: bool = False, enabled: bool = True
) -> bool:
    """Draw an entry of a menu and return whether it was chosen."""
    chosen = imgui.menu_item(text, key, checked, enabled)[0]
    note_item(state, text)
    return chosen


def same_line_if_room(text: str) -> None:
    """Put a check box, radio button or button with this text beside the last widget if it fits."""
    style = imgui.get_style()
    width = imgui.calc_text_size(text).x + imgui.get_frame_height() + style.item_inner_spacing.x
    end = imgui.get_item_rect_max().x + style.item_spacing.x + width
    if end <= imgui.get_cursor_screen_pos().x + imgui.get_content_region_avail().x:
        imgui.same_line()


def choice(state: AppState, label: str, value: str, texts: dict[str, str]) -> str:
    """Draw a drop-down list and return the chosen key."""
    keys = list(texts)
    index = keys.index(value) if value in keys else 0
    changed, chosen = imgui.combo(label, index, list(texts.values()))
    note_item(state, label)
    return keys[chosen] if changed else value


def number_text(value: float) -> str:
    """Return a number with three digits, or with all before the point if there are more.

    >>> number_text(0.012345), number_text(1234.5)
    ('0.0123', '1,234')
    """
    return f"{value:.3g}" if abs(value) < 999.5 else f"{value:,.0f}"
