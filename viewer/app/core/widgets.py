"""Widgets shared by several panels, which record where they were drawn; names of keys in texts."""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field
from typing import TYPE_CHECKING, TypeVar

from imgui_bundle import imgui

from viewer.app.core.fields import begin_field, slider_float, slider_int
from viewer.app.core.state import AppState
from viewer.app.core.text_fields import search_field
from viewer.app.core.theme import WARNING, text_color
from viewer.data_classes import dataclass
from viewer.rigs.number_text import number_text

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

_Key = TypeVar("_Key", bound=str)
_NUMBER = re.compile(r"%[0-9.+]*[efg]")
# Plain integers: an operation on Python's flags takes a microsecond, and a frame needs a hundred.
_DISABLED = int(imgui.ItemFlags_.disabled)
_HOVERED = int(imgui.HoveredFlags_.delay_normal | imgui.HoveredFlags_.allow_when_disabled)
_CLAMP = int(imgui.SliderFlags_.always_clamp)
_LOGARITHMIC = int(imgui.SliderFlags_.logarithmic)
_OVERLAY = int(
    imgui.WindowFlags_.no_decoration
    | imgui.WindowFlags_.no_docking
    | imgui.WindowFlags_.always_auto_resize
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_inputs
    | imgui.WindowFlags_.no_focus_on_appearing
    | imgui.WindowFlags_.no_nav
)
_ENABLED = contextlib.nullcontext()
Rect = tuple[float, float, float, float]
"""Left, upper, right and lower edge, in window coordinates."""


@dataclass(slots=True)
class KeyNames:
    """Keys changed by the user."""

    changed: dict[str, str] = field(default_factory=dict)
    """Maps the label of a key in the table of keys to the name of the key that replaces it."""


@dataclass(slots=True)
class _Disabled:
    """Reasons of the enclosing blocks that are disabled."""

    reasons: list[str] = field(default_factory=list)


def note_item(state: AppState, label: str) -> None:
    """Record the rectangle of the last widget under a label, for tests."""
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    state.item_rects[label] = (low.x, low.y, high.x, high.y)
    reasons = state.of(_Disabled).reasons
    if reasons:
        explain("", reasons[-1])


def disabled(state: AppState, why: str) -> contextlib.AbstractContextManager[None]:
    """Disable the widgets of a block if there is a reason, which their tooltips show."""
    return _disabled_for(state, why) if why else _ENABLED


@contextlib.contextmanager
def _disabled_for(state: AppState, why: str) -> Iterator[None]:
    reasons = state.of(_Disabled).reasons
    reasons.append(why)
    imgui.begin_disabled()
    try:
        yield
    finally:
        imgui.end_disabled()
        reasons.pop()


def explain(text: str, why: str = "") -> None:
    """Give the last widget a tooltip: its effect, and the reason why it is disabled, if it is."""
    if not (text or why):
        return
    if not why and imgui.get_current_context().last_item_data.item_flags & _DISABLED:
        # The reason of the enclosing block is shown already.
        return
    if imgui.is_item_hovered(_HOVERED):
        show_tooltip("\n".join(filter(None, (text, why))))


def show_tooltip(text: str) -> None:
    """Show a tooltip, unless it would cover text being typed, or a drag, in the last widget."""
    if not imgui.is_item_active():
        imgui.set_tooltip(text)


def filter_field(state: AppState, label: str, text: str, hint: str, width: float = -1.0) -> str:
    """Draw a search field and return its text; ``width``: window coordinates, -1 for the line."""
    imgui.set_next_item_width(width)
    found = search_field(f"##{label}", text, hint)
    note_item(state, label)
    return found


def warning(text: str) -> None:
    """Draw a wrapped text in the colour of warnings."""
    with text_color(WARNING):
        imgui.text_wrapped(text)


def is_reset(text: str | Callable[[], str]) -> bool:
    """Give the last widget a tooltip; return whether a double click resets the widget."""
    if not imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
        return False
    show_tooltip(text if isinstance(text, str) else text())
    return imgui.is_mouse_double_clicked(imgui.MouseButton_.left)


def visible_rows(count: int, height: float = -1.0, wanted: int = -1) -> Iterator[int]:
    """Yield the rows of a long list that are in view, and a wanted one, to scroll to it."""
    clipper = imgui.ListClipper()
    clipper.begin(count, height)
    if wanted >= 0:
        clipper.include_item_by_index(wanted)
    while clipper.step():
        yield from range(clipper.display_start, clipper.display_end)


def pressed_step(page: int) -> int:
    """Return the rows by which pressed arrow and page keys move the highlight of a list."""
    keys = imgui.Key
    steps = {keys.down_arrow: 1, keys.up_arrow: -1, keys.page_down: page, keys.page_up: -page}
    return sum(by for key, by in steps.items() if imgui.is_key_pressed(key))


def begin_dialog(title: str, width: float, name: str = "") -> tuple[bool, bool]:
    """Begin a dialog above everything else, of a width in window coordinates.

    ``name``: what identifies it if its title changes. Returns whether it is drawn, in which case
    ``imgui.end_popup`` must follow, and False once the user closes it.
    """
    title = f"{title}###{name}" if name else title
    imgui.open_popup(title)
    viewport = imgui.get_main_viewport()
    imgui.set_next_window_pos(viewport.get_center(), imgui.Cond_.always, (0.5, 0.5))
    imgui.set_next_window_size((min(width, 0.92 * viewport.size.x), 0.0))
    opened, stays = imgui.begin_popup_modal(title, True, imgui.WindowFlags_.no_resize)
    return opened, bool(stays)


def begin_overlay(name: str, x: float, y: float, pivot: tuple[float, float]) -> bool:
    """Begin a small window over the view that takes no input; ``imgui.end`` must follow."""
    imgui.set_next_window_pos((x, y), imgui.Cond_.always, pivot)
    imgui.set_next_window_bg_alpha(0.86)
    return imgui.begin(name, None, _OVERLAY)[0]


def begin_window(title: str, size: tuple[float, float]) -> tuple[bool, bool]:
    """Begin a centred window of a first size in font sizes; return (is visible, stays open)."""
    letter, viewport = imgui.get_font_size(), imgui.get_main_viewport()
    room = (
        min(size[0] * letter, 0.95 * viewport.size.x),
        min(size[1] * letter, 0.9 * viewport.size.y),
    )
    imgui.set_next_window_size(room, imgui.Cond_.appearing)
    imgui.set_next_window_pos(viewport.get_center(), imgui.Cond_.appearing, (0.5, 0.5))
    flags = imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_saved_settings
    # Docked panels are separated by their tabs; a window on top of them needs an outline.
    imgui.push_style_var(imgui.StyleVar_.window_border_size, max(1.0, round(letter / 16.0)))
    shown, stays = imgui.begin(title, True, flags | imgui.WindowFlags_.no_collapse)
    imgui.pop_style_var()
    return shown, bool(stays)


def overlay_rect(state: AppState, name: str) -> Rect:
    """Return the rectangle of the current window, and record it under its name."""
    place, size = imgui.get_window_pos(), imgui.get_window_size()
    rect = (place.x, place.y, place.x + size.x, place.y + size.y)
    state.item_rects[name] = rect
    return rect


def slider(
    state: AppState,
    label: str,
    value: float,
    low: float,
    high: float,
    unit: str = "%.2f",
    flags: int = 0,
    width: float = 0.0,
) -> float:
    """Draw a slider and return its value, which keeps its full precision unless it was moved."""
    shown = plain_zero(value, unit)
    changed, moved = slider_float(state, begin_field(label, width), shown, low, high, unit, flags)
    note_item(state, label)
    # "nan" and "1e99" can be typed into a slider.
    return moved if changed and math.isfinite(moved) else value


def count_slider(
    state: AppState,
    label: str,
    value: int,
    limits: tuple[int, int],
    text: str = "%d",
    flags: int = 0,
) -> int:
    """Draw a slider of whole numbers and return its number."""
    changed, moved = slider_int(state, begin_field(label), value, *limits, text, flags)
    note_item(state, label)
    return moved if changed else value


def checkbox(state: AppState, label: str, value: bool, why: str = "") -> bool:
    """Draw a check box and return its state; disabled if there is a reason."""
    with disabled(state, why):
        result = imgui.checkbox(label, value)[1]
        note_item(state, label)
        explain("", why)
    return value if why else result


def button(
    state: AppState, label: str, why: str = "", text: str = "", name: str = "", width: float = 0.0
) -> bool:
    """Draw a button and return whether it was pressed; disabled if there is a reason.

    ``text``: its tooltip; ``name``: what it is recorded under, if not its label.
    """
    with disabled(state, why):
        pressed = imgui.button(label, (width, 0.0))
        note_item(state, name or label)
        explain(text, why)
    return pressed and not why


def radio(
    state: AppState, label: str, is_on: bool, name: str = "", text: str = "", why: str = ""
) -> bool:
    """Draw a radio button, recorded under a name; return whether it was pressed."""
    with disabled(state, why):
        pressed = imgui.radio_button(label, is_on)
        note_item(state, name or label)
        explain(text, why)
    return pressed


def begin_menu(state: AppState, text: str, enabled: bool = True) -> bool:
    """Draw a menu's title and return whether it is open; ``imgui.end_menu`` must then follow."""
    opened = imgui.begin_menu(text, enabled)
    if not opened:
        note_item(state, f"menu {text}")
    return opened


def menu_item(
    state: AppState, text: str, key: str = "", checked: bool = False, why: str = "", more: str = ""
) -> bool:
    """Draw a menu item and return whether it was chosen; disabled if there is a reason."""
    shown, label = key_name(state, key), f"{text} {more}###{text}" if more else text
    chosen = imgui.menu_item(label, shown, checked, not why)[0]
    note_item(state, text)
    explain("", why)
    return chosen


def same_line_if_room(text: str) -> None:
    """Place the next check box or button, with this text, next to the last widget if it fits."""
    style = imgui.get_style()
    width = imgui.calc_text_size(text).x + imgui.get_frame_height() + style.item_inner_spacing.x
    end = imgui.get_item_rect_max().x + style.item_spacing.x + width
    if end <= imgui.get_cursor_screen_pos().x + imgui.get_content_region_avail().x:
        imgui.same_line()


def choice(
    state: AppState, label: str, value: _Key, texts: Mapping[_Key, str], width: float = 0.0
) -> _Key:
    """Draw a drop-down list and return the chosen key; ``width`` is that of ``begin_field``."""
    keys = list(texts)
    index = keys.index(value) if value in keys else 0
    # A list clips none of its labels.
    widest = max((imgui.calc_text_size(text).x for text in texts.values()), default=0.0)
    needs = widest + imgui.get_frame_height() + 2.0 * imgui.get_style().frame_padding.x
    hidden = begin_field(label, width, needs=needs)
    changed, chosen = imgui.combo(hidden, index, list(texts.values()), len(keys))
    note_item(state, label)
    return keys[chosen] if changed else value


def draw_setting(
    state: AppState,
    label: str,
    settings: DataclassInstance,
    name: str,
    text: str = "",
    why: str = "",
) -> None:
    """Draw a setting by what its field states: its choices, or its ends, unit and scale.

    ``text``: effect, as a tooltip. ``why``: reason why it is disabled.
    """
    facts, value = settings.__dataclass_fields__[name].metadata, getattr(settings, name)
    with disabled(state, why):
        if isinstance(value, bool):
            new: object = checkbox(state, label, value)
        elif "choices" in facts:
            new = choice(state, label, value, facts["choices"])
        elif isinstance(value, int):
            new = count_slider(state, label, value, facts["limits"], flags=_CLAMP)
        else:
            flags = _CLAMP | _LOGARITHMIC if facts.get("logarithmic") else _CLAMP
            low, high = facts.get("slider") or facts["limits"]
            new = slider(state, label, value, low, high, facts.get("unit", "%.2f"), flags)
        explain(text, why)
    if new != value:
        setattr(settings, name, new)


def swatch(color: Sequence[float]) -> None:
    """Draw a square in a colour (r, g, b), sRGB from 0 to 1, at the beginning of a line."""
    place, side = imgui.get_cursor_screen_pos(), imgui.get_text_line_height()
    ink = imgui.get_color_u32((color[0], color[1], color[2], 1.0))
    imgui.get_window_draw_list().add_rect_filled(place, (place.x + side, place.y + side), ink)
    imgui.dummy((side, side))
    imgui.same_line()


def plain_zero(value: float, text: str) -> float:
    """Return a number for a widget: 0 if its format would show it as -0.

    >>> plain_zero(-0.04, "%.1f s"), plain_zero(-0.06, "%.1f s")
    (0.0, -0.06)
    """
    spec = _NUMBER.search(text)
    shown = spec.group() % value if spec else ""
    return value if not shown.startswith("-") or number_text(float(shown)) != "0" else 0.0


def key_name(state: AppState, usual: str) -> str:
    """Return the current name of a key, the first if there are several, given its usual label."""
    return state.of(KeyNames).changed.get(usual, usual).partition(" or ")[0]


def with_key(state: AppState, text: str, usual: str) -> str:
    """Return the text of a button or tooltip, followed by the name of its key."""
    return f"{text} ({key_name(state, usual)})"
