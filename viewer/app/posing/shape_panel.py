"""Shape panel: sliders of the blend shapes, measurements, and shapes that cannot be read."""

from __future__ import annotations

from itertools import groupby

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.fields import begin_field, slider_float
from viewer.app.core.state import AppState
from viewer.app.core.text_fields import search_field, whole_field
from viewer.app.core.theme import faint
from viewer.app.core.widgets import (
    button,
    draw_setting,
    is_reset,
    note_item,
    plain_zero,
    same_line_if_room,
    visible_rows,
)
from viewer.app.files.files import offer_files
from viewer.app.posing.posing import Posing, pause_for_edit, random_shape, reset_shape
from viewer.errors import ViewerError
from viewer.phrases import counted, printable
from viewer.rigs.arrays import Floats
from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.figure import Figure
from viewer.rigs.inspection.measure import measure
from viewer.rigs.memo import Memo
from viewer.rigs.morph_target import MORPH_GROUP
from viewer.rigs.pose import Pose
from viewer.rigs.shape import shaped

_REACH = 5.0  # range of a slider in standard deviations; larger values can be typed
_SEARCHED = 60  # lists with more shapes have a filter
_LABELS = 0.55  # maximum width of the names, relative to the width of the panel
_HEADINGS = {
    "shape": "Shape",
    "expression": "Expression",
    MORPH_GROUP: "Morphs",
    "detail": "Local changes",
}
_SIGMA = "standard deviations"
_measured: Memo[Figure, tuple[tuple[str, str], ...]] = Memo(kept=4)


def draw(state: AppState) -> None:
    """Draw the panel for the chosen actor."""
    figure, pose = state.actor.figure, state.actor.own_pose
    if figure.blend_shapes is None or pose is None:
        offer_files(state, "This figure has no blend shapes: open a body model or a .morph file.")
        return
    # Height, volume and mass are those of the shaped rest body.
    rest = shaped(figure, pose.shape_weights)
    for name, value in _measured.get(rest, None, lambda: _measures(rest)):
        imgui.text_disabled(name)
        imgui.same_line(imgui.get_font_size() * 5)
        imgui.text_wrapped(value)
        note_item(state, f"measured {name}")
    varies = "shape" in figure.blend_shapes.groups
    if varies and button(state, "Random"):
        state.of(Posing).shape_seed += 1
        random_shape(state)
    if varies:
        same_line_if_room("Reset shape")
    if button(state, "Reset shape"):
        reset_shape(state)
    if varies:
        seed = whole_field(state, begin_field("Seed##seed"), state.of(Posing).shape_seed)
        note_item(state, "seed")
        if seed is not None and seed != state.of(Posing).shape_seed:
            state.of(Posing).shape_seed = max(seed, 0)
            random_shape(state)
    if figure.correctives is not None:
        draw_setting(state, "Pose correctives", state.options.skinning, "correctives")
    imgui.separator()
    if figure.n_shapes > _SEARCHED:
        posing = state.of(Posing)
        posing.shape_filter = search_field("##shapes", posing.shape_filter, "Filter shapes")
    if imgui.begin_child("coefficients", (0.0, 0.0), imgui.ChildFlags_.nav_flattened):
        _draw_coefficients(state, figure, pose)
    imgui.end_child()


def _measures(rest: Figure) -> tuple[tuple[str, str], ...]:
    found = measure(rest)
    if found.volume is None:
        height = f"{found.height:.3f} m" if rest.unit == "m" else f"{found.height:.4g}"
        edges = counted(found.n_open_edges, "boundary edge")
        return (("Height", height), ("Volume", f"none: open mesh ({edges})"))
    if found.mass is None:
        return (("Height", f"{found.height:.4g}"), ("Volume", f"{found.volume:.4g}"))
    return (
        ("Height", f"{found.height:.3f} m"),
        ("Volume", f"{1000.0 * found.volume:.1f} litres"),
        ("Mass", f"{found.mass:.1f} kg at 985 kg/m\N{SUPERSCRIPT THREE}"),
    )


def _draw_coefficients(state: AppState, figure: Figure, pose: Pose) -> None:
    shapes = figure.blend_shapes
    assert shapes is not None  # checked by the caller
    weights = np.zeros(max(shapes.n_shapes, len(pose.shape_weights)))
    weights[: len(pose.shape_weights)] = pose.shape_weights
    wanted = state.of(Posing).shape_filter.lower() if shapes.n_shapes > _SEARCHED else ""
    # The headings of groups are rows too, so that long lists can be clipped.
    rows: list[int | str] = []
    found = (index for index, name in enumerate(shapes.names) if wanted in name.lower())
    for group, members in groupby(found, lambda index: shapes.groups[index]):
        rows += [_HEADINGS.get(group, group), *members]
    longest = imgui.calc_text_size(printable(max(shapes.names, key=len), 40)).x
    column = min(longest, _LABELS * imgui.get_content_region_avail().x)
    for place in visible_rows(len(rows), imgui.get_frame_height_with_spacing()):
        row = rows[place]
        if isinstance(row, str):
            imgui.align_text_to_frame_padding()
            imgui.text_disabled(row)
        elif _draw_slider(state, shapes.names[row], row, weights, column):
            pose.shape_weights = weights


def _draw_slider(state: AppState, name: str, index: int, weights: Floats, column: float) -> bool:
    """Draw the slider of one of the weights, and return whether it has changed."""
    shapes, shown = state.actor.figure.blend_shapes, printable(name, 40)
    assert shapes is not None  # checked by the caller
    low, high, unit = _slider_range(shapes, index)
    origin = shapes.origin(index)
    changed, value = slider_float(
        state,
        begin_field(f"{shown}##{index}", column=column),
        plain_zero(float(weights[index]) + origin, "%.2f"),
        low,
        high,
        "%.2f",
    )
    note_item(state, f"coefficient {index}")
    if imgui.is_item_activated() and state.actor.transforms is not None:
        pause_for_edit(state)
    changed = changed and abs(value) < 1e6  # "nan" and "1e99" can be typed into a slider
    if changed:
        weights[index] = value - origin
    if unit == _SIGMA:
        _draw_marks()
    if is_reset(f"{shown}: {unit}\nCtrl+click to type a value, double-click to reset"):
        weights[index], changed = state.actor.figure.rest_shape_weights[index], True
    return changed


def _slider_range(shapes: BlendShapes, index: int) -> tuple[float, float, str]:
    """Return the ends of a slider, and the unit in its tooltip."""
    if shapes.ranges is not None:
        low, high = shapes.ranges[index].tolist()
        return low, high, f"{low:.2g} to {high:.2g}"
    if shapes.groups[index] == MORPH_GROUP:
        return 0.0, 1.0, "the whole morph target applies at 1"
    return -_REACH, _REACH, _SIGMA


def _draw_marks() -> None:
    """Mark integer standard deviations under the last slider, with a stronger mark at the mean."""
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    width = high.x - low.x
    grab = imgui.get_style().grab_min_size * 0.5
    draw_list = imgui.get_window_draw_list()
    for sigma in range(-int(_REACH), int(_REACH) + 1):
        fraction = 0.5 + sigma / (2.0 * _REACH)
        x = low.x + grab + fraction * (width - 2.0 * grab)
        height = 7.0 if sigma == 0 else 4.0
        color = imgui.get_color_u32(faint(0.8 if sigma == 0 else 0.5))
        draw_list.add_line((x, high.y - height), (x, high.y - 1.0), color)


def drop_unreadable_shapes(state: AppState) -> None:
    """Set all shapes to 0 if blend shape offsets, which are read on first use, cannot be read."""
    try:
        for actor in state.scene.actors:
            if actor.own_pose is not None:
                shaped(actor.figure, actor.own_pose.shape_weights)
    except ViewerError as problem:
        state.error = str(problem)
        for actor in state.scene.actors:
            if actor.own_pose is not None:
                actor.own_pose.shape_weights = np.zeros(actor.figure.n_shapes)
