"""Curves panel: a motion's channels over time, with editable keys, tangents and extrapolation."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from imgui_bundle import imgui

from viewer.app.core.fields import begin_field
from viewer.app.core.state import AppState
from viewer.app.core.text_fields import number_field
from viewer.app.core.widgets import (
    button,
    choice,
    explain,
    filter_field,
    note_item,
    plain_zero,
    same_line_if_room,
    visible_rows,
)
from viewer.app.curves.data import Curve, curves_of
from viewer.app.curves.editing import (
    Curves,
    add_key_at,
    ask_for_clip,
    can_have_keys,
    change_tangent,
    delete_chosen,
    drop_missing,
    extrapolate,
    focused_rows,
    interpolate,
    key_present_pose,
    keyed_of,
    new_clip,
    place_key,
)
from viewer.app.curves.plot import curve_color, draw_plot, factor_of
from viewer.app.files.files import offer_files
from viewer.rigs.motion.clip import EXTRAPOLATIONS, TANGENT_RULES
from viewer.rigs.motion.transform_clip import INTERPOLATIONS

_LIST_WIDTH, _SIDE_WIDTH = 10.0, 15.0  # widths, in font sizes
_MODES: dict[str, str] = {mode: mode.replace("_", " ") for mode in EXTRAPOLATIONS}
_TANGENTS: dict[str, str] = {rule: rule for rule in TANGENT_RULES} | {"number": "number"}
_INTERPOLATIONS: dict[str, str] = {mode: mode for mode in INTERPOLATIONS}
_SIDES = ("In", "Out")
_FARTHEST = 1e9  # largest number that can be typed
_HINT = "Double-click adds a key. Drag keys and tangents; Delete removes keys, Shift selects more."


def draw(state: AppState) -> None:
    """Draw the panel for the chosen actor."""
    curves = curves_of(state.actor)
    if not curves or state.actor.clip is None:
        if can_have_keys(state):
            imgui.text_wrapped("This figure has no motion.")
            if button(state, "New clip"):
                new_clip(state)
            same_line_if_room("Open files…")
        offer_files(state, "" if can_have_keys(state) else "This figure has no motion.")
        return
    # Deselect curves and keys that no longer exist; show the curves of a newly selected joint.
    view, clip = state.of(Curves), state.actor.clip
    kind = f"{type(clip).__name__} {state.actor.animation}"
    owner = (id(state.actor), kind, len(curves))
    if owner != view.owner:
        view.owner, view.joint = owner, -1
        view.choose(_first_shown(state, curves, _first_number(state, curves)))
    if state.selected_joint != view.joint:
        view.joint = state.selected_joint
        rows = _first_shown(state, curves, view.joint)
        if view.joint >= 0 and rows:
            view.choose(rows)
            view.wants_scroll = True
    keyed = keyed_of(state.actor)
    if keyed is not None:
        drop_missing(view, keyed, len(curves))
    if imgui.begin_child("##channels", (_LIST_WIDTH * imgui.get_font_size(), 0.0)):
        _draw_list(state, curves)
    imgui.end_child()
    imgui.same_line()
    # The fields are next to the plot, not above it: widgets that appear must not move a key away
    # from the mouse.
    room, side = imgui.get_content_region_avail().x, 0.0
    if keyed_of(state.actor) is not None:
        side = min(_SIDE_WIDTH * imgui.get_font_size(), 0.35 * room)
    if imgui.begin_child("##plot", (-side, 0.0)):
        _draw_tools(state)
        draw_plot(state, curves)
    imgui.end_child()
    if side:
        imgui.same_line()
        if imgui.begin_child("##keys"):
            _draw_key_fields(state, curves)
            _draw_modes(state)
        imgui.end_child()


def _first_shown(state: AppState, curves: tuple[Curve, ...], number: int) -> tuple[int, ...]:
    """Return the curves of a selected joint; for keyed transforms, its angles that have keys."""
    rows = tuple(row for row, curve in enumerate(curves) if curve.number == number)
    keyed = keyed_of(state.actor)
    return rows if keyed is None else keyed.shown_first(curves, rows)


def _first_number(state: AppState, curves: tuple[Curve, ...]) -> int:
    """Return the joint whose curves are shown first: the first with keys, if there are any."""
    keyed, numbers = keyed_of(state.actor), [curve.number for curve in curves]
    if keyed is None:
        return numbers[0]
    return next((n for row, n in enumerate(numbers) if keyed.keys(row) is not None), numbers[0])


# The list


def _draw_list(state: AppState, curves: tuple[Curve, ...]) -> None:
    view = state.of(Curves)
    view.filter = filter_field(state, "Curve filter", view.filter, "Filter channels")
    if not imgui.begin_child("##curve rows"):
        imgui.end_child()
        return
    # Each joint's number, as text, precedes its curves.
    shown: list[int | str] = []
    text = view.filter.lower()
    wanted = (r for r, c in enumerate(curves) if not text or text in c.label.lower())
    for number, found in groupby(wanted, lambda row: curves[row].number):
        shown += [str(number), *found]
    if not shown:
        imgui.text_disabled("no channel name contains this text")
    if view.wants_scroll:
        view.wants_scroll = False
        above = shown.index(view.rows[0]) - 1 if view.rows and view.rows[0] in shown else 0
        imgui.set_scroll_y(above * imgui.get_text_line_height_with_spacing())
    for place in visible_rows(len(shown)):
        entry = shown[place]
        if isinstance(entry, str):
            _draw_heading(state, curves, entry, shown)
        else:
            _draw_entry(state, curves, entry)
    imgui.end_child()


def _draw_heading(
    state: AppState, curves: tuple[Curve, ...], entry: str, shown: list[int | str]
) -> None:
    """Draw a joint's name; a click selects its listed curves."""
    rows = tuple(row for row in shown if isinstance(row, int) and curves[row].number == int(entry))
    name = curves[rows[0]].group
    is_chosen = set(rows) <= set(state.of(Curves).rows)
    if imgui.selectable(f"{name}##group {entry}", is_chosen)[0]:
        _choose(state, rows)
    note_item(state, f"curves of {name}")


def _draw_entry(state: AppState, curves: tuple[Curve, ...], row: int) -> None:
    curve, view = curves[row], state.of(Curves)
    is_chosen = row in view.rows
    imgui.push_style_color(imgui.Col_.text, curve_color(view, curves, row))
    keyed = keyed_of(state.actor)
    keys = None if keyed is None else keyed.keys(row)
    count = "" if keys is None or not len(keys[0]) else f"  {len(keys[0])}"
    if imgui.selectable(f"    {curve.name}{count}##row {row}", is_chosen)[0]:
        _choose(state, (row,))
    imgui.pop_style_color()
    note_item(state, f"curve {curve.label}")


def _choose(state: AppState, rows: tuple[int, ...]) -> None:
    """Select these curves only; with Ctrl or Shift, add them to the selection or remove them."""
    view, io = state.of(Curves), imgui.get_io()
    if io.key_ctrl or io.key_shift:
        if set(rows) <= set(view.rows):
            rows = tuple(row for row in view.rows if row not in rows)
        else:
            rows = (*view.rows, *(row for row in rows if row not in view.rows))
    view.choose(rows)


# The tools


def _draw_tools(state: AppState) -> None:
    view = state.of(Curves)
    if button(state, "Fit"):
        view.wants_fit = True
    explain("fit the axes to the selected curves")
    if keyed_of(state.actor) is None:
        imgui.same_line()
        imgui.text_disabled("sampled animation without keys: read-only")
        return
    if _button_beside(state, "Add key", "add a key to the shown curves at the current time"):
        add_key_at(state, view.rows, state.clock.time - state.actor.offset)
    if _button_beside(state, "Key pose", "key the whole pose at the current time"):
        key_present_pose(state)
    if _button_beside(state, "Key changes", "key only the values that differ from the clip"):
        key_present_pose(state, only_changed=True)
    if state.actor.transforms is None and _button_beside(
        state, "Save clip…", "save the clip as .anim"
    ):
        ask_for_clip(state)


def _button_beside(state: AppState, text: str, tooltip: str) -> bool:
    same_line_if_room(text)
    pressed = button(state, text)
    explain(tooltip)
    return pressed


# Keys, tangents and extrapolation


def _draw_modes(state: AppState) -> None:
    """Draw the choices for whole channels: interpolation of transforms, extrapolation of DOFs."""
    rows, keyed = focused_rows(state.of(Curves)), keyed_of(state.actor)
    if keyed is None or not rows:
        return
    interpolation = keyed.interpolation(rows[0])
    if interpolation is not None:
        between = choice(state, "Interpolation", interpolation, _INTERPOLATIONS)
        explain("between the keys of the curves with selected keys, otherwise of all shown curves")
        for each in INTERPOLATIONS:
            if between == each != interpolation:
                interpolate(state, each)
    for side, now in enumerate(keyed.extrapolation(rows[0]) or ()):
        text = ("Before", "After")[side]
        new = choice(state, text, now, _MODES)
        explain("extrapolation of the curves with selected keys, otherwise of all shown curves")
        for mode in EXTRAPOLATIONS:
            if new == mode != now:
                extrapolate(state, side, mode)


def _draw_key_fields(state: AppState, curves: tuple[Curve, ...]) -> None:
    """Draw the fields of the selected keys: time, value and tangents."""
    view, keyed = state.of(Curves), keyed_of(state.actor)
    place = min(view.keys, default=None)
    keys = None if keyed is None or place is None else keyed.keys(place[0])
    if keyed is None or keys is None or place is None:
        imgui.push_text_wrap_pos(0.0)
        imgui.text_disabled(_HINT)
        imgui.pop_text_wrap_pos()
        return
    factor = factor_of(state, curves[place[0]])
    more = f" and {len(view.keys) - 1} more" * (len(view.keys) > 1)
    if button(state, "Delete"):
        delete_chosen(state)
        return
    imgui.same_line()
    imgui.text_unformatted(f"{curves[place[0]].label}, key {place[1]}{more}")
    row, key = place
    if len(view.keys) == 1:
        time = _field(state, "Time", float(keys[0][key]))
        if time is not None:
            place_key(state, place, time=time)
        value = _field(state, "Value", factor * float(keys[1][key]))
        if value is not None:
            place_key(state, place, value=value / factor)
    tangents, known = keyed.tangents(row), keyed.slopes(row)
    if tangents is not None:
        for side, text in enumerate(_SIDES):
            # Draw the choice of the tangent rule on one side.
            tangent = tangents[key][side]
            now = tangent if isinstance(tangent, str) else "number"
            new = choice(state, text, now, _TANGENTS)
            if new == "number" != now:
                # The slope computed by the rule keeps the curve unchanged.
                present = 0.0 if known is None else float(known[key, side])
                change_tangent(state, [place], side, present)
            for rule in TANGENT_RULES:
                if new == rule != now:
                    change_tangent(state, state.of(Curves).keys, side, rule)
    if len(view.keys) != 1:
        return
    # Explicit tangents have fields for their slopes, per second.
    own: Sequence[float | None] = ()
    if tangents is not None:
        own = [None if isinstance(rule, str) else rule for rule in tangents[key]]
    elif known is not None:
        own = known[key].tolist()
    for side, slope in enumerate(own):
        typed = None if slope is None else _field(state, f"{_SIDES[side]} slope", factor * slope)
        if typed is not None:
            change_tangent(state, [place], side, typed / factor)


def _field(state: AppState, label: str, value: float) -> float | None:
    """Draw a number field; return the number that was entered."""
    typed = number_field(state, begin_field(label), plain_zero(value, "%.5g"), "%.5g")
    note_item(state, label)
    return typed if typed is not None and abs(typed) < _FARTHEST else None
