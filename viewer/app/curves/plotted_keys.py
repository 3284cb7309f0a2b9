"""Keys and tangents in the Curves panel's plot: drawing, dragging, adding and deleting."""

from __future__ import annotations

import math

import numpy as np
from imgui_bundle import imgui, implot

from viewer.app.core.ink import faint, ink
from viewer.app.curves.axes import Plot, ui_scale
from viewer.app.curves.editing import (
    add_key_at,
    change_slope,
    delete_chosen,
    move_chosen,
    nearest_row,
)
from viewer.app.curves.keyed import KeyedMotion, keyed_of
from viewer.app.curves.state import KeyPlace
from viewer.app.files.state import Files
from viewer.rig.arrays import Floats
from viewer.rig.number_text import number_text

__all__ = ["draw_keys", "edit"]

_HANDLE = 1.0, 0.85, 0.4, 1.0
_FAINT = (0.75, 0.75, 0.8, 0.8)
_MOST_KEYS = 300  # if more keys are visible, none can be dragged
_SAME_KEY = 2.0  # points: keys closer than this cannot be distinguished
_HANDLE_LENGTH = 4.0  # length of a tangent's handle, in font sizes
_HANDLE_ID = 16
_FIRST_KEY_ID = 32
_KEYS_PER_ROW = 1 << 20
_FIXED = implot.DragToolFlags_.no_fit


def draw_keys(plot: Plot) -> bool:
    """Draw keys and tangents; return whether the mouse is over one of them.

    Of several overlapping items, the one drawn first gets the mouse. Selected keys are therefore
    drawn first, then tangents, then other keys.
    """
    keyed = keyed_of(plot.state.actor)
    if keyed is None:
        return False
    low, high, bottom, top = plot.limits
    seen: list[tuple[int, Floats, Floats, list[int]]] = []
    for row in plot.view.rows:
        keys = keyed.keys(row)
        if keys is not None:
            times, values = keys[0], plot.factor(row) * keys[1]
            inside = (times >= low) & (times <= high)
            inside &= (values >= bottom) & (values <= top)
            # A selected key may be dragged out of the plot.
            inside[[key for owner, key in plot.view.keys if owner == row]] = True
            seen.append((row, times, values, np.flatnonzero(inside).tolist()))
    if sum(len(keys) for *_, keys in seen) > _MOST_KEYS:
        _draw_many(plot, seen)
        return False
    places = [
        ((row, key), float(times[key]), float(values[key]))
        for row, times, values, keys in seen
        for key in keys
    ]
    chosen = [one for one in places if one[0] in plot.view.keys]
    touched = [_draw_key(plot, *one) for one in chosen]
    touched.append(_draw_handles(plot))
    touched += [_draw_key(plot, *one) for one in places if one not in chosen]
    _mark(plot, chosen)
    return any(touched)


def _mark(plot: Plot, chosen: list[tuple[KeyPlace, float, float]]) -> None:
    """Draw the selected keys again, on top of everything."""
    implot.push_plot_clip_rect()
    for place, time, value in chosen:
        middle, inner = implot.plot_to_pixels(time, value), plot.color(place[0])
        draw_list = implot.get_plot_draw_list()
        draw_list.add_circle_filled(middle, 6.0 * ui_scale(), imgui.get_color_u32(faint(1.0)))
        draw_list.add_circle_filled(middle, 3.5 * ui_scale(), imgui.get_color_u32(inner))
    implot.pop_plot_clip_rect()


def _draw_many(plot: Plot, seen: list[tuple[int, Floats, Floats, list[int]]]) -> None:
    """Draw keys as plain dots, which cannot be dragged, if there are too many keys."""
    for row, times, values, keys in seen:
        if keys:
            color = plot.color(row)
            spec = implot.Spec(
                marker=implot.Marker_.circle,
                marker_size=2.0 * ui_scale(),
                marker_fill_color=color,
                marker_line_color=color,
            )
            implot.plot_scatter(f"##keys {row}", times[keys], values[keys], spec)
    place, light = implot.get_plot_pos(), imgui.get_color_u32(_FAINT)
    text = f"{sum(len(keys) for *_, keys in seen)} keys: zoom in to edit them"
    implot.get_plot_draw_list().add_text((place.x + 6.0, place.y + 4.0), light, text)


def _draw_key(plot: Plot, place: KeyPlace, time: float, value: float) -> bool:
    view, (row, key) = plot.view, place
    is_chosen = place in view.keys
    moved, x, y, _, hovered, held = implot.drag_point(
        (_FIRST_KEY_ID + row * _KEYS_PER_ROW + key) & 0x7FFFFFFF,
        time,
        value,
        plot.color(row),
        4.5 * ui_scale(),
        _FIXED,
        False,
        False,
        False,
    )
    plot.note(f"key {plot.curves[row].label} {key}", time, value)
    if held and not is_chosen:
        kept = view.keys if imgui.get_io().key_shift else frozenset()
        view.keys = kept | {place}
    if moved:
        move_chosen(plot.state, x - time, (y - value) / plot.factor(row))
    return bool(hovered or held)


def _draw_handles(plot: Plot) -> bool:
    """Draw the tangents of a single selected key; return whether the mouse is over one."""
    keyed, view = keyed_of(plot.state.actor), plot.view
    if keyed is None or len(view.keys) != 1:
        return False
    row, key = next(iter(view.keys))
    keys, slopes = keyed.keys(row), keyed.slopes(row)
    if keys is None or slopes is None or row not in view.rows:
        return False
    point = float(keys[0][key]), float(keys[1][key])
    touched = [
        _draw_handle(plot, (row, key), side, point, float(slopes[key, side])) for side in (0, 1)
    ]
    return any(touched)


def _draw_handle(
    plot: Plot, place: KeyPlace, side: int, point: tuple[float, float], slope: float
) -> bool:
    """Draw one tangent as a line of fixed length with a knob; dragging makes it explicit."""
    factor, sign = plot.factor(place[0]), (-1.0, 1.0)[side]
    (time, value), slope = (point[0], factor * point[1]), factor * slope
    across, up = plot.scale
    length = _HANDLE_LENGTH * imgui.get_font_size() / math.hypot(1.0, slope * up / across)
    end, height = time + sign * length / across, value + sign * slope * length / across
    points = implot.plot_to_pixels(time, value), implot.plot_to_pixels(end, height)
    implot.push_plot_clip_rect()
    implot.get_plot_draw_list().add_line(
        points[0], points[1], imgui.get_color_u32(ink(_HANDLE)), 1.2 * ui_scale()
    )
    implot.pop_plot_clip_rect()
    moved, x, y, _, hovered, held = implot.drag_point(
        _HANDLE_ID + side, end, height, ink(_HANDLE), 3.5 * ui_scale(), _FIXED, False, False, False
    )
    plot.note(f"tangent {side}", end, height)
    if moved:
        # The knob stays at least a pixel away from the key on its side, so no tangent is vertical.
        run = sign * max(sign * (x - time), 1.0 / across)
        for each in (0, 1) if imgui.get_io().key_shift else (side,):
            change_slope(plot.state, [place], each, (y - value) / run / factor)
    return bool(hovered or held)


def edit(plot: Plot, touched: bool) -> None:
    """Handle clicks and keys in the plot.

    Parameters
    ----------
    plot : Plot
        Current plot.
    touched : bool
        Whether the mouse is over a key or tangent, which then handles clicks.
    """
    state, view, keyed = plot.state, plot.view, keyed_of(plot.state.actor)
    if keyed is None or state.error or state.of(Files).dialog is not None or not _is_mouse_inside():
        return
    left, io = imgui.MouseButton_.left, imgui.get_io()
    # Keys and lines that can be dragged take the mouse from the plot, but not the keyboard.
    is_free = implot.is_plot_hovered()
    is_second = io.mouse_clicked_last_count[left] > 1
    was_dragged = io.mouse_drag_max_distance_sqr[left] >= io.mouse_drag_threshold**2
    adds = is_free and imgui.is_mouse_double_clicked(left) and not touched
    if adds or _is_pressed(imgui.Key.insert):
        mouse = implot.get_plot_mouse_pos()
        factors = [plot.factor(row) for row in view.rows]
        row = nearest_row(keyed, view, mouse.x, mouse.y, factors)
        if row >= 0:
            _add_key(plot, keyed, row, mouse.x)
    elif _is_pressed(imgui.Key.delete):
        delete_chosen(state)
    elif is_free and imgui.is_mouse_released(left) and not (touched or was_dragged or is_second):
        view.keys = frozenset()


def _add_key(plot: Plot, keyed: KeyedMotion, row: int, time: float) -> None:
    """Add a key at the mouse; an existing one there is selected instead."""
    keys = keyed.keys(row)
    times = np.zeros(0) if keys is None else keys[0]
    near = np.flatnonzero(np.abs(times - time) * plot.scale[0] <= _SAME_KEY)
    if len(near):
        plot.view.keys = frozenset({(row, int(near[0]))})
        plot.state.say_status(
            f"There is already a key at {number_text(float(times[near[0]]), '.4g')} s"
        )
    else:
        add_key_at(plot.state, [row], time)


def _is_mouse_inside() -> bool:
    """Return whether the mouse is over the plot and no other window covers it."""
    flags = imgui.HoveredFlags_.allow_when_blocked_by_active_item
    place, size = implot.get_plot_pos(), implot.get_plot_size()
    corner = (place.x + size.x, place.y + size.y)
    return imgui.is_window_hovered(flags) and imgui.is_mouse_hovering_rect(place, corner)


def _is_pressed(key: imgui.Key) -> bool:
    """Return whether a key was pressed while no text is entered and nothing is dragged."""
    is_dragging = imgui.is_mouse_down(imgui.MouseButton_.left)
    is_free = not (is_dragging or imgui.get_io().want_text_input)
    return is_free and imgui.is_key_pressed(key, False)
