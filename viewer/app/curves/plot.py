"""Plot of the Curves panel: curves, the clip's range and the current time.

Times are seconds of the clip; angles have the unit of the Joints panel.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from imgui_bundle import imgui, implot

from viewer.app.core.ink import faint
from viewer.app.core.state import AppState
from viewer.app.curves.axes import (
    Color,
    Plot,
    factor_of,
    least_height,
    measured,
    ui_scale,
    value_limits,
)
from viewer.app.curves.data import Curve, sampled_points
from viewer.app.curves.editing import set_clip_range
from viewer.app.curves.keyed import KeyedMotion, keyed_of
from viewer.app.curves.plotted_keys import draw_keys, edit
from viewer.app.curves.state import Curves
from viewer.rig.arrays import Floats
from viewer.rig.captures.points import PointClip
from viewer.rig.memo import Memo
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.scene import Motion

__all__ = ["draw_plot", "keyed_lines", "unit_text"]

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
        _draw(state, curves)
        implot.end_plot()
    implot.pop_style_var(2)


def _draw(state: AppState, curves: tuple[Curve, ...]) -> None:
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
    touched = draw_keys(plot)
    _draw_time(plot)
    _draw_range(plot)
    edit(plot, touched)
    _draw_units(plot)


def unit_text(state: AppState, curves: tuple[Curve, ...]) -> str:
    """Return the units of the values of the selected curves, as text."""
    shown = [curves[row] for row in state.of(Curves).rows]
    units = {
        state.actor.figure.unit or "units": any(curve.is_length for curve in shown),
        "degrees" if state.in_degrees else "radians": any(curve.is_angle for curve in shown),
    }
    return ", ".join(unit for unit, is_used in units.items() if is_used)


def _draw_units(plot: Plot) -> None:
    """Draw the unit of the values in a corner."""
    text = unit_text(plot.state, plot.curves)
    place, size = implot.get_plot_pos(), implot.get_plot_size()
    corner = (place.x + 6.0, place.y + size.y - imgui.get_text_line_height() - 3.0)
    implot.get_plot_draw_list().add_text(corner, imgui.get_color_u32(faint(_RANGE)), text)


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
    elif isinstance(clip, SampledClip | PointClip):
        parts += [
            factor * sampled_points(clip, row, low, high)[1]
            for row, factor in zip(rows, factors, strict=True)
        ]
    least = least_height(state, [curves[row] for row in rows])
    return low, high, *value_limits(np.concatenate(parts), least)


def _spec(color: Color, weight: float = 1.5, flags: int = 0) -> implot.Spec:
    """Return the style of a line, whose width is in points."""
    return implot.Spec(line_color=color, line_weight=weight * ui_scale(), flags=flags)


def _draw_line(plot: Plot, row: int) -> None:
    """Draw one curve, solid between its keys and dashed where extrapolated."""
    clip, color, factor = plot.state.actor.clip, plot.color(row), plot.factor(row)
    low, high = plot.limits[:2]
    if isinstance(clip, SampledClip | PointClip):
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
    step = (high - low) / _DASHES
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


def _draw_outside(plot: Plot) -> None:
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


def _draw_range(plot: Plot) -> None:
    """Draw the start and end of the range, which can be dragged if the clip has keys."""
    clip = plot.state.actor.clip
    if clip is None:
        return
    flags = implot.DragToolFlags_.no_fit
    if keyed_of(plot.state.actor) is None:
        flags |= implot.DragToolFlags_.no_inputs
    ink = faint(_RANGE)
    moved, start, *_ = implot.drag_line_x(_START_ID, clip.start, ink, ui_scale(), flags)
    if moved:
        set_clip_range(plot.state, min(start, clip.end), clip.end)
    moved, end, *_ = implot.drag_line_x(_END_ID, clip.end, ink, ui_scale(), flags)
    if moved:
        set_clip_range(plot.state, clip.start, max(end, clip.start))
    middle = 0.5 * (plot.limits[2] + plot.limits[3])
    plot.note("range start", clip.start, middle)
    plot.note("range end", clip.end, middle)


def _draw_time(plot: Plot) -> None:
    """Draw the current time; dragging it moves the clock by whole frames, with Alt continuously."""
    state, offset = plot.state, plot.state.actor.offset
    time = state.clock.time - offset
    flags = implot.DragToolFlags_.no_fit
    moved, time, *_ = implot.drag_line_x(_TIME_ID, time, _TIME, 1.5 * ui_scale(), flags)
    if moved:
        state.clock.scrub(time + offset, between=imgui.get_io().key_alt)
    plot.note("time line", time, 0.5 * (plot.limits[2] + plot.limits[3]))
