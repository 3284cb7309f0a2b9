"""Weights panel: scalar quantities as colours, and tools to inspect single vertices."""

from __future__ import annotations

import math

from imgui_bundle import imgui

from viewer.app.core.fields import begin_field
from viewer.app.core.reasons import no_mesh
from viewer.app.core.state import AppState
from viewer.app.core.text_fields import number_field
from viewer.app.core.widgets import (
    button,
    checkbox,
    choice,
    disabled,
    explain,
    note_item,
    plain_zero,
    same_line_if_room,
)
from viewer.app.weights.actions import no_view, show_scalar, shown_joint, start_heat_map, unpin
from viewer.app.weights.state import Weights
from viewer.phrases import printable
from viewer.rendering.options import COLORMAPS
from viewer.rendering.scalar_look import TYPICAL
from viewer.rig.figure import Figure
from viewer.rig.number_text import short_number
from viewer.rig.scalars import SCALARS, length_unit, menu_title, shown_unit, split_name

__all__ = ["draw"]

_LONGEST = 40  # maximum length of a name in characters
_FIELD = 7.0  # width of a field, in font sizes
_WHOLE = ("discrete", "categorical")


def draw(state: AppState) -> None:
    """Draw the panel."""
    state.of(Weights).panel_frame = imgui.get_frame_count()
    options, why = state.options, no_mesh(state)
    shows = options.shading == "scalar"
    if checkbox(state, "Heat map", shows, why) != shows:
        if shows:
            options.shading = "auto"
        else:
            start_heat_map(state)
    _draw_views(state)
    key = split_name(options.scalar)[0]
    if SCALARS[key].takes_joint:
        _draw_joint(state)
    if SCALARS[key].about == "field":
        _draw_fields(state, key)
    _draw_largest(state, key)
    with disabled(state, "" if options.shading == "scalar" else "the heat map is off"):
        _draw_range(state, key)
        _draw_marks(state, key)
    imgui.separator()
    _draw_vertex_tools(state)


def _draw_views(state: AppState) -> None:
    """Draw the list of quantities; unavailable ones are disabled, with the reason as tooltip."""
    key = split_name(state.options.scalar)[0]
    imgui.set_next_item_width(-1.0)
    whole = imgui.ComboFlags_.height_largest
    skinning = state.options.skinning
    opened = imgui.begin_combo("##Heat map of", menu_title(key, skinning), whole)
    if not opened:
        note_item(state, "##Heat map of")
        return
    for name in SCALARS:
        why = no_view(state, name)
        with disabled(state, why):
            # Choosing the current quantity again keeps a joint named on the command line.
            if imgui.selectable(menu_title(name, skinning), name == key)[0]:
                show_scalar(state, state.options.scalar if name == key else name)
            note_item(state, f"view {name}")
            explain("", why)
    imgui.end_combo()


def _draw_joint(state: AppState) -> None:
    """Draw the name of the joint whose weights are shown: the selected joint or an explicit one."""
    joint, named = shown_joint(state), split_name(state.options.scalar)[1]
    if not joint:
        imgui.text_wrapped("Click the skin in the view, or a joint in the tree.")
        return
    imgui.text_wrapped(f"of {printable(joint, _LONGEST)}")
    if named and button(state, "Of the selected joint"):
        state.options.scalar = split_name(state.options.scalar)[0]
    shown = printable(joint, _LONGEST)
    explain(f"{shown} is currently shown, regardless of the selected joint" if named else "")


def _draw_fields(state: AppState, key: str) -> None:
    """Draw the list of fields if a figure has several."""
    fields = {
        field.name: field.title
        for actor in state.scene.actors
        for field in actor.figure.fields
        if bool(field.names) == (key == "class")
    }
    if len(fields) < 2:
        return
    about = split_name(state.options.scalar)[1]
    chosen = choice(state, "Field", about, fields)
    if chosen != about and (about or chosen != next(iter(fields))):
        show_scalar(state, f"{key}:{chosen}")


def _draw_largest(state: AppState, key: str) -> None:
    """Draw the largest value of a length, in the figure's unit."""
    if state.options.shading == "scalar" and SCALARS[key].unit == "length":
        factor, unit = length_unit(state.actor.figure)
        most = short_number(factor * state.stats.scalar_range[1])
        imgui.text_wrapped(f"up to {most} {unit} in this pose")


def _draw_range(state: AppState, key: str) -> None:
    """Draw the choice of the colour range: automatic, or fixed by two numbers."""
    options = state.options
    why = "this quantity has one colour per integer" if SCALARS[key].kind in _WHOLE else ""
    with disabled(state, why):
        if imgui.radio_button("Automatic", options.scalar_range is None):
            options.scalar_range = None
        note_item(state, "Automatic")
        explain(
            f"the colours span {TYPICAL:.0%} of the nonzero values; values outside have the end "
            f"colours"
            if SCALARS[key].robust
            else "the colours span all values",
            why,
        )
        same_line_if_room("Fixed")
        if imgui.radio_button("Fixed", options.scalar_range is not None):
            options.scalar_range = options.scalar_range or _present_range(state)
        note_item(state, "Fixed")
        explain("the range does not change with the pose; values outside it have the end "
                "colours", why)  # fmt: skip
    if options.scalar_range is not None and not why:
        low, high = options.scalar_range
        unit = _unit(state.actor.figure, options.scalar)
        options.scalar_range = (
            _end_field(state, "From", low, unit, -math.inf, high),
            _end_field(state, "To", high, unit, low, math.inf),
        )
    with disabled(state, why):
        options.colormap = choice(state, "Colours", options.colormap, COLORMAPS)


def _end_field(
    state: AppState, label: str, value: float, unit: str, above: float, below: float
) -> float:
    """Draw a field for one end of the range; the ends keep their order."""
    hidden = begin_field(label, _FIELD)
    typed = number_field(state, hidden, plain_zero(value, "%.6g"))
    note_item(state, label)
    if unit:
        imgui.same_line()
        imgui.text_disabled(unit)
    return typed if typed is not None and above < typed < below else value


def _present_range(state: AppState) -> tuple[float, float]:
    """Return the current automatic range, in the unit of the legend."""
    factor, _ = shown_unit(state.options.scalar, state.actor.figure)
    low, high = state.stats.scalar_ends
    return float(f"{factor * low:.3g}"), float(f"{factor * high:.3g}")


def _unit(figure: Figure, name: str) -> str:
    return shown_unit(name, figure)[1]


def _draw_marks(state: AppState, key: str) -> None:
    """Draw the check boxes for isolines and the legend."""
    options, view = state.options, SCALARS[key]
    why = "isolines need a continuous quantity" if view.kind in _WHOLE else ""
    shown = view.isolines if options.isolines is None else options.isolines
    wanted = checkbox(state, "Isolines", shown and not why, why)
    if wanted != shown and not why:
        options.isolines = None if wanted == view.isolines else wanted
    text = "Legend in pictures"
    same_line_if_room(text)
    options.legend = checkbox(state, text, options.legend)
    explain("draw the legend into screenshots and recordings")


def _draw_vertex_tools(state: AppState) -> None:
    """Draw the settings of hover text and vertex picking."""
    view, why = state.of(Weights), no_mesh(state)
    imgui.text_wrapped("Hover over a surface to see the properties of a vertex.")
    text = "Even without this panel"
    view.always_shows_info = checkbox(state, text, view.always_shows_info, why)
    view.picks_vertices = checkbox(state, "Pick vertices", view.picks_vertices, why)
    explain("click to explain a vertex; Alt+click does so at any time")
    if view.pinned is not None:
        same_line_if_room(f"Unpin {view.pinned.vertex}")
        if button(state, f"Unpin {view.pinned.vertex}###unpin"):
            unpin(state)
