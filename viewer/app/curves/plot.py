"""Plot of the Curves panel: curves, the clip's range and the current time.

Times are seconds of the clip; angles have the unit of the Joints panel.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from imgui_bundle import imgui, implot

from viewer.app.core.state import AppState
from viewer.app.core.theme import faint, ink
from viewer.app.curves.data import Curve, sampled_points
from viewer.app.curves.editing import (
    Curves,
    KeyedMotion,
    KeyPlace,
    add_key_at,
    change_tangent,
    delete_chosen,
    keyed_of,
    move_chosen,
    nearest_row,
    set_playback_range,
)
from viewer.app.files.files import Files
from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats
from viewer.rigs.memo import Memo
from viewer.rigs.number_text import number_text
from viewer.rigs.scene import Motion

_TIME, _RANGE = (1.0, 0.62, 0.25, 1.0), 0.55
_OUTSIDE = (0.0, 0.0, 0.0, 0.2)
_MOST_SAMPLES = 900
_DASHES = 90  # number of samples across the plot
_MARGIN = 0.08  # margin before and after the clip, relative to its duration
_FARTHEST = 1e9
_TIME_ID, _START_ID, _END_ID = 1, 2, 3
_Points: TypeAlias = tuple[Floats, Floats]
"""Times and values, (P,) each: seconds; lengths, radians or factors."""
_Lines: TypeAlias = tuple[_Points | None, _Points | None, _Points | None]
_lines: Memo[Motion, _Lines] = Memo(kept=256)  # sampled again only after an edit, pan or zoom
_HANDLE = 1.0, 0.85, 0.4, 1.0
_FAINT = (0.75, 0.75, 0.8, 0.8)
_MOST_KEYS = 300  # if more keys are visible, none can be dragged
_SAME_KEY = 2.0  # points: keys closer than this cannot be distinguished
_HANDLE_LENGTH = 4.0  # length of a tangent's handle, in font sizes
_HANDLE_ID = 16
_FIRST_KEY_ID = 32
_KEYS_PER_ROW = 1 << 20
_FIXED = implot.DragToolFlags_.no_fit
_Color = tuple[float, float, float, float]
# Smallest value range that fitted axes magnify to the height of the plot. Rotations and
# positions in single precision, as files store them, are rounded to far smaller steps.
_LEAST_ANGLE = math.radians(0.1)
_LEAST_LENGTH = 5e-4  # lengths, relative to the size of the scene
_LEAST = 1e-3  # scale factors and weights
_LEAST_RELATIVE = 1e-5  # any value, relative to its magnitude
_CONSTANT = 0.02  # fraction of that range below which a change is drawn as a constant
_AXES_MARGIN = 0.16  # margin above and below the curves, relative to their height
_COLORS = ((0.95, 0.45, 0.42), (0.48, 0.85, 0.45), (0.45, 0.65, 1.0))
_SHADES = (1.0, 0.72, 1.25, 0.85, 1.12)  # brightness factors that distinguish the joints


@dataclass(frozen=True, slots=True)
class _Plot:
    """State of the plot in this frame."""

    state: AppState
    """State that is shown and changed."""
    curves: tuple[Curve, ...]
    """All curves of the motion."""
    limits: tuple[float, float, float, float]
    """Ranges of clip time, in seconds, and of values, in the displayed unit: (low, high, bottom,
    top)."""
    scale: tuple[float, float]
    """Pixels per second and per displayed unit."""

    @property
    def view(self) -> Curves:
        """State of the Curves panel."""
        return self.state.of(Curves)

    def factor(self, row: int) -> float:
        """Return the factor from a curve's values to the displayed unit."""
        return factor_of(self.state, self.curves[row])

    def color(self, row: int) -> _Color:
        """Return a curve's colour."""
        return curve_color(self.view, self.curves, row)

    def note(self, label: str, time: float, value: float, reach: float = 4.0) -> None:
        """Record the position of a point of the plot under a label, for tests."""
        place = implot.plot_to_pixels(time, value)
        rect = (place.x - reach, place.y - reach, place.x + reach, place.y + reach)
        self.state.item_rects[label] = rect


def draw_plot(state: AppState, curves: tuple[Curve, ...]) -> None:
    """Draw the selected curves in the remaining space, and handle the mouse."""
    # A double click adds a key, so the middle button fits the axes instead.
    implot.get_input_map().fit = imgui.MouseButton_.middle
    flags = implot.Flags_.no_title | implot.Flags_.no_legend | implot.Flags_.no_menus
    room = imgui.get_content_region_avail()
    implot.push_style_var(implot.StyleVar_.plot_padding, (4.0, 4.0))
    implot.push_style_var(implot.StyleVar_.label_padding, (3.0, 2.0))
    shown = implot.begin_plot("##curves", (max(room.x, 60.0), max(room.y, 60.0)), flags)
    if shown:
        view, no_label = state.of(Curves), implot.AxisFlags_.no_label
        implot.setup_axes("seconds", "values", no_label, no_label)
        implot.setup_axis_format(implot.ImAxis_.x1, "%g s")
        for axis in (implot.ImAxis_.x1, implot.ImAxis_.y1):
            implot.setup_axis_limits_constraints(axis, -_FARTHEST, _FARTHEST)
        if view.wants_fit:
            implot.setup_axes_limits(*_fitting(state, curves), implot.Cond_.always)
            view.wants_fit = False
        implot.setup_finish()
        plot = measured(state, curves)
        _draw_outside(plot)
        for row in view.rows:
            _draw_line(plot, row)
        # Of several overlapping items, the one drawn first gets the mouse.
        touched = _draw_keys(plot)
        _draw_time(plot)
        _draw_range(plot)
        edit(plot, touched)
        # The unit of the values is in a corner.
        text = unit_text(state, curves)
        place, size = implot.get_plot_pos(), implot.get_plot_size()
        corner = (place.x + 6.0, place.y + size.y - imgui.get_text_line_height() - 3.0)
        implot.get_plot_draw_list().add_text(corner, imgui.get_color_u32(faint(_RANGE)), text)
        implot.end_plot()
    implot.pop_style_var(2)


def unit_text(state: AppState, curves: tuple[Curve, ...]) -> str:
    """Return the units of the values of the selected curves, as text."""
    shown = [curves[row] for row in state.of(Curves).rows]
    units = {
        state.actor.figure.unit or "units": any(curve.is_length for curve in shown),
        "degrees" if state.in_degrees else "radians": any(curve.is_angle for curve in shown),
    }
    return ", ".join(unit for unit, is_used in units.items() if is_used)


def _fitting(state: AppState, curves: tuple[Curve, ...]) -> tuple[float, float, float, float]:
    """Return axes that show the selected curves from their first to their last key or frame."""
    clip, rows = state.actor.clip, state.of(Curves).rows
    low, high = (0.0, 1.0) if clip is None else (clip.start, clip.end)
    keyed = keyed_of(state.actor)
    if keyed is not None:
        found = [keyed.keys(row) for row in rows]
        ends = [keys[0][[0, -1]] for keys in found if keys is not None and len(keys[0])]
        times = np.concatenate([[low, high], *ends])
        low, high = float(times.min()), float(times.max())
    pad = _MARGIN * (high - low) or 1.0
    low, high = low - pad, high + pad
    factors = [factor_of(state, curves[row]) for row in rows]
    parts = [np.zeros(0)]
    if keyed is not None:
        shown = keyed.values(rows, np.linspace(low, high, _MOST_SAMPLES))
        parts.append((shown * factors).ravel())
    elif clip is not None and clip.timing is not None:
        parts += [
            factor * sampled_points(clip, row, low, high)[1]
            for row, factor in zip(rows, factors, strict=True)
        ]
    least = _least_height(state, [curves[row] for row in rows])
    return low, high, *value_limits(np.concatenate(parts), least)


def _spec(color: _Color, weight: float = 1.5, flags: int = 0) -> implot.Spec:
    """Return the style of a line, whose width is in points."""
    return implot.Spec(line_color=color, line_weight=weight * _ui_scale(), flags=flags)


def _draw_line(plot: _Plot, row: int) -> None:
    """Draw one curve, solid between its keys and dashed where extrapolated."""
    clip, color, factor = plot.state.actor.clip, plot.color(row), plot.factor(row)
    low, high = plot.limits[:2]
    if clip is not None and clip.timing is not None:
        times, values = sampled_points(clip, row, low, high)
        implot.plot_line(f"##{row}", times, factor * values, _spec(color))
        return
    keyed = keyed_of(plot.state.actor)
    if keyed is None or clip is None:
        return
    key = id(plot.state.actor.figure.skeleton), row, low, high
    line, *dashes = _lines.get(clip, key, lambda: keyed_lines(keyed, row, low, high))
    if line is not None:
        implot.plot_line(f"##{row}", line[0], factor * line[1], _spec(color))
    spec = _spec((*color[:3], 0.75), 1.2, implot.LineFlags_.segments)
    for side, found in enumerate(dashes):
        if found is not None:
            implot.plot_line(f"##outside {row} {side}", found[0], factor * found[1], spec)


def keyed_lines(keyed: KeyedMotion, row: int, low: float, high: float) -> _Lines:
    """Return the points of a curve between its keys, and those of dashes before and after them."""
    found = keyed.keys(row)
    keys = np.zeros(0) if found is None else found[0]
    # A curve without keys is 0 everywhere: all of it is extrapolation.
    first, last = (float(keys[0]), float(keys[-1])) if len(keys) else (high, high)
    line = None
    if len(keys) and first <= high and last >= low:
        times = _inner_times(keys, max(low, first), min(high, last))
        line = times, keyed.values((row,), times)[:, 0]
        if keyed.wraps(row):
            line = _broken(*line)
    step = (high - low) / _DASHES  # from one dash to the next, seconds
    sides = (low, min(high, first)), (max(low, last), high)
    before, after = (
        _dashes(keyed, row, side, step) if side[0] < side[1] else None for side in sides
    )
    return line, before, after


def _dashes(
    keyed: KeyedMotion, row: int, side: tuple[float, float], step: float
) -> tuple[Floats, Floats]:
    """Return dashes along a curve, each of three short segments that follow its shape."""
    start, end = side
    # Multiples of the step, so that dashes stay in place while panning.
    lows = step * np.arange(math.floor(start / step), math.ceil(end / step))
    fractions = np.array([0.0, 0.2, 0.2, 0.4, 0.4, 0.6])
    points = np.clip((lows[:, None] + step * fractions).ravel(), start, end)
    return points, keyed.values((row,), points)[:, 0]


def _broken(times: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return a curve of angles with gaps where it jumps by a full rotation."""
    jumps = np.flatnonzero(np.abs(np.diff(values)) > math.pi) + 1
    return np.insert(times, jumps, times[jumps]), np.insert(values, jumps, np.nan)


def _inner_times(keys: Floats, low: float, high: float) -> Floats:
    """Return sample times: evenly over the visible range, and at the keys."""
    seen = keys[(keys >= low) & (keys <= high)][:_MOST_SAMPLES]
    # Times just before the keys are included, because two keys at the same time create a jump.
    times = np.concatenate([np.linspace(low, high, _MOST_SAMPLES), seen, np.nextafter(seen, low)])
    return np.sort(np.clip(times, low, high))


def _draw_outside(plot: _Plot) -> None:
    """Darken the plot outside the clip's range."""
    clip = plot.state.actor.clip
    if clip is None:
        return
    low, high, bottom, top = plot.limits
    draw_list = implot.get_plot_draw_list()
    implot.push_plot_clip_rect()
    for start, end in ((low, clip.start), (clip.end, high)):
        if start < end:
            corner, other = implot.plot_to_pixels(start, top), implot.plot_to_pixels(end, bottom)
            draw_list.add_rect_filled(corner, other, imgui.get_color_u32(_OUTSIDE))
    implot.pop_plot_clip_rect()


def _draw_range(plot: _Plot) -> None:
    """Draw the start and end of the range, which can be dragged if the clip has keys."""
    clip = plot.state.actor.clip
    if clip is None:
        return
    flags = implot.DragToolFlags_.no_fit
    if keyed_of(plot.state.actor) is None:
        flags |= implot.DragToolFlags_.no_inputs
    ink = faint(_RANGE)
    moved, start, *_ = implot.drag_line_x(_START_ID, clip.start, ink, _ui_scale(), flags)
    if moved:
        set_playback_range(plot.state, min(start, clip.end), clip.end)
    moved, end, *_ = implot.drag_line_x(_END_ID, clip.end, ink, _ui_scale(), flags)
    if moved:
        set_playback_range(plot.state, clip.start, max(end, clip.start))
    middle = 0.5 * (plot.limits[2] + plot.limits[3])
    plot.note("range start", clip.start, middle)
    plot.note("range end", clip.end, middle)


def _draw_time(plot: _Plot) -> None:
    """Draw the current time; dragging it moves the clock by whole frames, with Alt continuously."""
    state, offset = plot.state, plot.state.actor.offset
    time = state.clock.time - offset
    flags = implot.DragToolFlags_.no_fit
    moved, time, *_ = implot.drag_line_x(_TIME_ID, time, _TIME, 1.5 * _ui_scale(), flags)
    if moved:
        state.clock.scrub(time + offset, between=imgui.get_io().key_alt)
    plot.note("time line", time, 0.5 * (plot.limits[2] + plot.limits[3]))


def _draw_keys(plot: _Plot) -> bool:
    """Draw keys and tangents; return whether the mouse is over one of them."""
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
    # Of several overlapping items, the one drawn first gets the mouse: selected keys come first,
    # then tangents, then other keys.
    places = [
        ((row, key), float(times[key]), float(values[key]))
        for row, times, values, keys in seen
        for key in keys
    ]
    chosen = [one for one in places if one[0] in plot.view.keys]
    touched = [_draw_key(plot, *one) for one in chosen]
    touched.append(_draw_handles(plot))
    touched += [_draw_key(plot, *one) for one in places if one not in chosen]
    # The selected keys are drawn again, on top of everything.
    implot.push_plot_clip_rect()
    for place, time, value in chosen:
        middle, inner = implot.plot_to_pixels(time, value), plot.color(place[0])
        draw_list = implot.get_plot_draw_list()
        draw_list.add_circle_filled(middle, 6.0 * _ui_scale(), imgui.get_color_u32(faint(1.0)))
        draw_list.add_circle_filled(middle, 3.5 * _ui_scale(), imgui.get_color_u32(inner))
    implot.pop_plot_clip_rect()
    return any(touched)


def _draw_many(plot: _Plot, seen: list[tuple[int, Floats, Floats, list[int]]]) -> None:
    """Draw keys as plain dots, which cannot be dragged, if there are too many keys."""
    for row, times, values, keys in seen:
        if keys:
            color = plot.color(row)
            spec = implot.Spec(
                marker=implot.Marker_.circle,
                marker_size=2.0 * _ui_scale(),
                marker_fill_color=color,
                marker_line_color=color,
            )
            implot.plot_scatter(f"##keys {row}", times[keys], values[keys], spec)
    place, light = implot.get_plot_pos(), imgui.get_color_u32(_FAINT)
    text = f"{sum(len(keys) for *_, keys in seen)} keys: zoom in to edit them"
    implot.get_plot_draw_list().add_text((place.x + 6.0, place.y + 4.0), light, text)


def _draw_key(plot: _Plot, place: KeyPlace, time: float, value: float) -> bool:
    view, (row, key) = plot.view, place
    is_chosen = place in view.keys
    moved, x, y, _, hovered, held = implot.drag_point(
        (_FIRST_KEY_ID + row * _KEYS_PER_ROW + key) & 0x7FFFFFFF,
        time,
        value,
        plot.color(row),
        4.5 * _ui_scale(),
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


def _draw_handles(plot: _Plot) -> bool:
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
    plot: _Plot, place: KeyPlace, side: int, point: tuple[float, float], slope: float
) -> bool:
    """Draw one tangent as a line of fixed length with a knob; dragging makes it explicit."""
    factor, sign = plot.factor(place[0]), (-1.0, 1.0)[side]
    (time, value), slope = (point[0], factor * point[1]), factor * slope
    # The line has the same length in pixels at any slope: a step of dt is dt * across pixels wide
    # and slope * dt * up high, so it is hypot(1, slope * up / across) times as long as it is wide.
    across, up = plot.scale
    length = _HANDLE_LENGTH * imgui.get_font_size() / math.hypot(1.0, slope * up / across)
    end, height = time + sign * length / across, value + sign * slope * length / across
    points = implot.plot_to_pixels(time, value), implot.plot_to_pixels(end, height)
    implot.push_plot_clip_rect()
    implot.get_plot_draw_list().add_line(
        points[0], points[1], imgui.get_color_u32(ink(_HANDLE)), 1.2 * _ui_scale()
    )
    implot.pop_plot_clip_rect()
    moved, x, y, _, hovered, held = implot.drag_point(
        _HANDLE_ID + side, end, height, ink(_HANDLE), 3.5 * _ui_scale(), _FIXED, False, False, False
    )
    plot.note(f"tangent {side}", end, height)
    if moved:
        # The knob stays at least a pixel away from the key on its side, so no tangent is vertical.
        run = sign * max(sign * (x - time), 1.0 / across)
        for each in (0, 1) if imgui.get_io().key_shift else (side,):
            change_tangent(plot.state, [place], each, (y - value) / run / factor)
    return bool(hovered or held)


def edit(plot: _Plot, touched: bool) -> None:
    """Handle clicks and keys in the plot."""
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
            # An existing key at the mouse is selected instead.
            keys = keyed.keys(row)
            times = np.zeros(0) if keys is None else keys[0]
            near = np.flatnonzero(np.abs(times - mouse.x) * plot.scale[0] <= _SAME_KEY)
            if len(near):
                view.keys = frozenset({(row, int(near[0]))})
                at = number_text(float(times[near[0]]), ".4g")
                state.say_status(f"There is already a key at {at} s")
            else:
                add_key_at(state, [row], mouse.x)
    elif _is_pressed(imgui.Key.delete):
        delete_chosen(state)
    elif is_free and imgui.is_mouse_released(left) and not (touched or was_dragged or is_second):
        view.keys = frozenset()


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


def measured(state: AppState, curves: tuple[Curve, ...]) -> _Plot:
    """Return the current plot, after its axes have been set up."""
    box, place, size = implot.get_plot_limits(), implot.get_plot_pos(), implot.get_plot_size()
    limits = (box.x.min, box.x.max, box.y.min, box.y.max)
    state.item_rects["plot"] = (place.x, place.y, place.x + size.x, place.y + size.y)
    across, up = max(limits[1] - limits[0], 1e-12), max(limits[3] - limits[2], 1e-12)
    return _Plot(state, curves, limits, (size.x / across, size.y / up))


def factor_of(state: AppState, curve: Curve) -> float:
    """Return the factor from a curve's values to the displayed unit: angles may be in degrees."""
    return math.degrees(1.0) if curve.is_angle and state.in_degrees else 1.0


def curve_color(view: Curves, curves: tuple[Curve, ...], row: int) -> _Color:
    """Return a curve's colour: red, green or blue for x, y, z; each joint has its own shade."""
    groups = list(dict.fromkeys(curves[other].number for other in view.rows))
    number = curves[row].number
    shade = _SHADES[groups.index(number) % len(_SHADES)] if number in groups else 1.0
    red, green, blue = (min(part * shade, 1.0) for part in _COLORS[curves[row].axis])
    return ink((red, green, blue, 1.0))


def _least_height(state: AppState, curves: Sequence[Curve]) -> float:
    """Return the minimum height of fitted axes for some curves, in the displayed units."""
    low, high = state.box
    length = _LEAST_LENGTH * float(np.linalg.norm(high - low))
    return max(
        (
            factor_of(state, curve)
            * (_LEAST_ANGLE if curve.is_angle else length if curve.is_length else _LEAST)
            for curve in curves
        ),
        default=_LEAST,
    )


def _ui_scale() -> float:
    """Return the size of a point in window coordinates, which is the scale of the interface."""
    return float(imgui.get_style().font_scale_dpi)


def value_limits(values: Floats, least: float) -> tuple[float, float]:
    """Return the ends of an axis that shows the finite ones of some values (N,), with a margin.

    >>> value_limits(np.array([0.0, 100.0]), 0.1), value_limits(np.array([30.0, 30.0]), 0.1)
    ((-16.0, 116.0), (15.0, 45.0))
    """
    values = values[np.isfinite(values)]
    bottom, top = (float(values.min()), float(values.max())) if len(values) else (-1.0, 1.0)
    height, largest = top - bottom, max(abs(top), abs(bottom))
    least = max(least, _LEAST_RELATIVE * largest)
    if height < _CONSTANT * least:
        middle = 0.5 * (bottom + top)
        pad = max(0.5 * abs(middle), 0.5)
        return middle - pad, middle + pad
    pad = max(_AXES_MARGIN * height, 0.5 * (least - height))
    return bottom - pad, top + pad
