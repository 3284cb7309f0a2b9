"""Vertex panel: all intermediate values of the skinning of the pinned vertex.

In the view, lines lead from the vertex to its images under each joint alone; a vertex under the
mouse has a short text.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.widgets import (
    begin_overlay,
    button,
    checkbox,
    explain,
    note_item,
    overlay_rect,
    same_line_if_room,
    swatch,
    with_key,
)
from viewer.app.files.files import Files
from viewer.app.posing.joint_tree import joint_tree
from viewer.app.weights.weights_panel import Weights, explained, toggle_picking, unpin
from viewer.data_classes import dataclass
from viewer.phrases import printable
from viewer.rendering.colors import joint_palette
from viewer.rendering.overlay.annotation import LABEL_COLOR, Annotation, Labels
from viewer.rendering.overlay.segments import Segments, SegmentStyle, dots, joined
from viewer.rendering.projection import picture_scale, project
from viewer.rendering.view import view_of
from viewer.rigs.arrays import Bytes, Floats
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.inspection.explanation import DualTerms, Explanation, explanation_text
from viewer.rigs.memo import Memo
from viewer.rigs.number_text import number_text
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.skinning import METHODS

_DIGITS = 4
_COPIED_DIGITS = 6
_LONGEST = 40  # maximum length of a name in characters
_NUMBER, _LABEL = 3.8, 4.7  # widths of columns, in font sizes
_DIGIT = 0.56  # width of a digit, in font sizes
_SMALLEST, _FEWEST = 0.75, 3  # smallest font scale and number of decimals, for a narrow panel
_PADDING = 2.0  # points at each side of a number
_SPARE = 6.0  # reserve in points, because font sizes are rounded to whole pixels
# Pixels in an image of standard height.
_THINNEST, _THICKEST = 1.0, 5.0  # line widths for the smallest and largest weight
_DOT, _RIM, _BORDER = 8.0, 3.0, 2.0  # diameter of a dot; dark borders of dots and lines
_FAINTEST = 0.35
_LONGEST_CELL = 24  # maximum length of a name in characters
_DARK, _LIGHT = (0.05, 0.06, 0.08, 0.8), (1.0, 1.0, 1.0, 1.0)
_palettes: Memo[Skeleton, Bytes] = Memo()
_AWAY = 16.0  # points between the mouse and the text


@dataclass(frozen=True, slots=True)
class _Sheet:
    """State of the window, and the number of decimals to show."""

    state: AppState
    digits: int


def draw(state: AppState) -> None:
    """Draw the panel."""
    weights = state.of(Weights)
    explanation = explained(state)
    pinned = weights.pinned
    if explanation is None or pinned is None or pinned.figure.skeleton is None:
        imgui.text_wrapped("Alt+click a vertex to explain its position here.")
        text = "Pick vertices without Alt"
        if checkbox(state, text, weights.picks_vertices) != weights.picks_vertices:
            toggle_picking(state)
        return
    _draw_head(state, explanation)
    # The horizontal scroll bar keeps numbers readable in the narrowest panel. If the vertical
    # scroll bar were optional, the scaled text could hide it, grow into the freed space, and
    # flicker.
    bars = imgui.WindowFlags_.horizontal_scrollbar | imgui.WindowFlags_.always_vertical_scrollbar
    if imgui.begin_child("numbers", (0.0, 0.0), 0, bars):
        scale, digits = _fitting(imgui.get_content_region_avail().x, imgui.get_font_size())
        imgui.push_font(None, scale * imgui.get_style().font_size_base)
        imgui.push_style_var_x(imgui.StyleVar_.cell_padding, _PADDING)
        colors = influence_colors(explanation, pinned.figure.skeleton)
        _draw_steps(_Sheet(state, digits), explanation, colors)
        imgui.pop_style_var()
        imgui.pop_font()
    imgui.end_child()


def _fitting(room: float, font_size: float) -> tuple[float, int]:
    """Return the font scale and the number of decimals with which rows fit into the panel.

    >>> _fitting(300.0, 15.0), _fitting(240.0, 15.0)[1], _fitting(50.0, 15.0)
    ((1.0, 4), 4, (0.75, 3))
    """
    scale = 0.0
    for digits in range(_DIGITS, _FEWEST - 1, -1):
        number = _NUMBER - _DIGIT * (_DIGITS - digits)
        # Four numbers of a matrix row, or a label and the three numbers of a point.
        widest = (max(_LABEL, number) + 3.0 * number) * font_size
        scale = min((room - 8.0 * _PADDING - _SPARE) / widest, 1.0)
        if scale >= _SMALLEST:
            break
    return max(scale, _SMALLEST), digits


def _draw_steps(sheet: _Sheet, one: Explanation, colors: Floats) -> None:
    """Draw the steps of the skinning of the vertex in order."""
    # From the vertex in the file to p, the position before skinning.
    rows = [("stored", one.stored)]
    if not np.array_equal(one.shaped, one.stored):
        rows.append(("+ shape", one.shaped))
    if not np.array_equal(one.rest, one.shaped):
        rows.append(("+ correctives", one.rest))
    _draw_rows(sheet, "rest", [*rows, ("p", one.rest)])
    if one.is_free:
        imgui.text_wrapped("No influence: the vertex stays at its bind position.")
    else:
        for index in range(len(one.joints)):
            _draw_influence(sheet, one, index, colors[index])
        imgui.separator()
        sums = [("sum w", one.weights.sum(keepdims=True)), ("sum w M p", one.linear)]
        _draw_rows(sheet, "sums", sums)
        if one.dual is not None:
            _draw_dual(sheet, one.dual)
    imgui.separator()
    method = METHODS[one.skinning.method]
    if method.result:
        ends = " to ".join(METHODS[end].short for end in method.ends)
        text = method.result.format(blend_factor=f"{one.skinning.blend_factor:.2f}")
        imgui.text_wrapped(f"{text} from {ends}" if ends else text)
        _draw_rows(sheet, "result", [("skinned", one.skinned)])
    if not np.array_equal(one.placement, np.eye(4)):
        factor = one.placement[0, :1]
        _draw_rows(sheet, "placed", [("scale", factor), ("translation", one.placement[:3, 3])])
    _draw_rows(sheet, "end", [("position", one.position)])


def _draw_head(state: AppState, one: Explanation) -> None:
    weights = state.of(Weights)
    pinned = weights.pinned
    assert pinned is not None  # only a pinned vertex is explained
    name = printable(state.scene.actors[pinned.actor].name, _LONGEST)
    imgui.text_wrapped(f"Vertex {one.vertex} of {name}: {METHODS[one.skinning.method].title}")
    if button(state, "Copy as text"):
        imgui.set_clipboard_text("\n".join(explanation_text(one, _COPIED_DIGITS)))
        state.say_status("Explanation copied")
    same_line_if_room("Unpin")
    if button(state, "Unpin"):
        unpin(state)
    explain(with_key(state, "unpin the vertex", "Esc"))
    same_line_if_room("Lines")
    weights.draws_lines = checkbox(state, "Lines", weights.draws_lines)
    explain(
        "draw lines to the vertex as transformed by each joint alone; larger weights have "
        "thicker lines"
    )


def _draw_influence(sheet: _Sheet, one: Explanation, index: int, color: Floats) -> None:
    """Draw one influence: its matrix, its image of the vertex, and its term of the sum."""
    state, number = sheet.state, index + 1
    imgui.separator()
    swatch(color.tolist())
    pinned = state.of(Weights).pinned
    is_chosen = pinned is not None and state.chosen_actor == pinned.actor
    joint, name = int(one.joints[index]), printable(one.names[index], _LONGEST)
    room, head = imgui.get_content_region_avail().x, f"{number}. {name}"
    weight = f"w{number} = {one.weights[index]:.{_DIGITS}f}"
    fits = imgui.calc_text_size(f"{head}: {weight}").x <= room
    text = f"{head}: {weight}" if fits else head
    is_chosen &= state.selected_joint == joint
    if imgui.selectable(f"{text}###influence{number}", is_chosen, 0, (room, 0.0))[0]:
        if pinned is not None and state.chosen_actor != pinned.actor:
            state.choose_actor(pinned.actor)
        state.selected_joint = joint_tree(state).scrolls_to = joint
    note_item(state, f"influence {number}")
    explain("select this joint" if fits else f"select {name}")
    if not fits:
        imgui.text_unformatted(weight)
    _draw_rows(sheet, f"matrix {number}", [("", row) for row in one.matrices[index]])
    explain(f"M{number}, the skinning matrix")
    terms = [(f"M{number} p", one.images[index]), (f"w{number} M{number} p", one.terms[index])]
    _draw_rows(sheet, f"terms {number}", terms)
    if button(state, f"Copy M{number}"):
        imgui.set_clipboard_text(matrix_text(one.matrices[index]))
        state.say_status(f"M{number} copied")


def matrix_text(matrix: Floats) -> str:
    """Return a matrix (4, 4) as rows of numbers in full precision."""
    return "\n".join(" ".join(map(repr, row)) for row in matrix.tolist())


def _draw_dual(sheet: _Sheet, dual: DualTerms) -> None:
    """Draw the quaternions that dual quaternion skinning adds (Kavan et al. 2008)."""
    imgui.separator_text("Dual quaternions")
    for index, values in enumerate(dual.duals):
        flip = "" if dual.signs[index] > 0.0 else ", negated into the hemisphere of q1"
        weight = f"{dual.fractions[index]:.{_DIGITS}f}"
        imgui.text_wrapped(f"q{index + 1}: normalised weight {weight}{flip}")
        _draw_quaternions(sheet, f"dual {index}", values)
    imgui.text_wrapped("q = sum of normalised weight times q, with these signs")
    _draw_quaternions(sheet, "blended", dual.blended)
    _draw_rows(sheet, "length", [("length", np.array([dual.length]))])
    explain("length of the real part, by which both parts are divided")
    _draw_rows(sheet, "moved", [("stretched p", dual.stretched), ("moved by q", dual.position)])


def _draw_quaternions(sheet: _Sheet, name: str, values: Floats) -> None:
    """Draw both parts of a dual quaternion."""
    _draw_rows(sheet, name, [("", values[:4]), ("", values[4:])])
    explain("the real part x y z w, then the dual part")


def _draw_rows(sheet: _Sheet, name: str, rows: Sequence[tuple[str, Floats]]) -> None:
    """Draw rows of a label and some numbers; four numbers leave no room for labels."""
    count = max(len(values) for _, values in rows)
    has_labels, width = count < 4, imgui.get_font_size()
    padding, number = 2.0 * _PADDING, _NUMBER - _DIGIT * (_DIGITS - sheet.digits)
    room = (has_labels * (_LABEL * width + padding) + count * (number * width + padding), 0.0)
    fixed = imgui.TableColumnFlags_.width_fixed
    imgui.begin_group()
    if imgui.begin_table(name, has_labels + count, imgui.TableFlags_.sizing_fixed_fit, room):
        for column in range(has_labels + count):
            is_label = has_labels and column == 0
            imgui.table_setup_column("", fixed, (_LABEL if is_label else number) * width)
        for text, values in rows:
            imgui.table_next_row()
            if has_labels:
                imgui.table_next_column()
                imgui.text_unformatted(text)
            for value in values.tolist():
                imgui.table_next_column()
                text = number_text(value, f".{sheet.digits}f")
                # Numbers end at the right edge of their cells.
                rest = imgui.get_content_region_avail().x - imgui.calc_text_size(text).x
                imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(rest, 0.0))
                imgui.text_unformatted(text)
        imgui.end_table()
    imgui.end_group()


def influence_colors(explanation: Explanation, skeleton: Skeleton) -> Floats:
    """Return the colours of the influences, as for dominant joints: (K, 3), sRGB."""
    colors = _palettes.get(skeleton, (), lambda: joint_palette(skeleton.parents))
    return colors[explanation.joints, :3] / 255.0


def pinned_annotations(state: AppState, size: tuple[int, int]) -> tuple[Annotation, ...]:
    """Return the annotation of the pinned vertex; the same object as long as nothing changes."""
    view = state.of(Weights)
    pinned = view.pinned
    if pinned is None or state.options.show == "binding":
        return ()
    explanation = explained(state)
    if explanation is None or not state.scene.actors[pinned.actor].is_drawn:
        return ()
    actor = state.scene.actors[pinned.actor]
    key = (explanation, actor.placement.tobytes(), view.draws_lines, size)
    if key != view.annotation_key or not view.annotations:
        view.annotations = (vertex_annotation(explanation, actor, view.draws_lines, size),)
        view.annotation_key = key
    return view.annotations


def vertex_annotation(
    explanation: Explanation, actor: Actor, draws_lines: bool, size: tuple[int, int]
) -> Annotation:
    """Return a dot at a vertex, and lines from it to its rigid images M_i p with their weights."""
    scale = picture_scale(size)
    vertex = apply_transform(actor.placement, explanation.position)
    rim = dots(vertex[None], np.array(_DARK), scale * (_DOT + _RIM + 1.0))
    parts = [rim, dots(vertex[None], np.array(_LIGHT), scale * _DOT)]
    if not draws_lines or not len(explanation.joints):
        return Annotation(joined(parts), SegmentStyle(on_top=True))
    skeleton = actor.figure.skeleton
    assert skeleton is not None  # influences imply a skeleton
    images = apply_transform(actor.placement @ explanation.placement, explanation.images)
    colors = influence_colors(explanation, skeleton)
    lines = _image_lines(vertex, images, colors, explanation.weights, scale)
    texts = tuple(
        f"{printable(name, _LONGEST_CELL)}  {weight:.3f}"
        for name, weight in zip(explanation.names, explanation.weights.tolist(), strict=True)
    )
    white = np.broadcast_to(LABEL_COLOR, (len(texts), 3))
    # Priorities after the name of the selected joint, before those of all other joints.
    labels = Labels(texts, images, np.arange(1, len(texts) + 1, dtype=np.int32), white)
    return Annotation(joined([lines, *parts]), SegmentStyle(on_top=True), labels)


def _image_lines(
    vertex: Floats, images: Floats, colors: Floats, weights: Floats, scale: float
) -> Segments:
    """Return a line and a dot for each influence, both with a dark rim; the strongest is on top."""
    strengths = np.clip(np.abs(weights), 0.0, 1.0)
    opacities = _FAINTEST + (1.0 - _FAINTEST) * strengths
    widths = _THINNEST + (_THICKEST - _THINNEST) * strengths
    count = len(images)
    dark, one = np.tile(_DARK, (count, 1)), np.ones((count, 1))
    starts = np.stack([np.broadcast_to(vertex, images.shape)] * 2 + [images] * 2, axis=1)
    ends = np.repeat(images[:, None], 4, axis=1)
    faint, solid = np.hstack([colors, opacities[:, None]]), np.hstack([colors, one])
    shades = np.stack([dark, faint, dark, solid], axis=1)
    dot = np.full(count, _DOT)
    thick = scale * np.stack([widths + _BORDER, widths, dot + _RIM, dot], axis=1)
    # The weakest influence is drawn first; explanations list it last.
    order = np.arange(count)[::-1]
    return Segments(
        starts[order].reshape(-1, 3),
        ends[order].reshape(-1, 3),
        shades[order].reshape(-1, 4),
        thick[order].ravel(),
    )


def draw_hovered(state: AppState) -> None:
    """Mark the vertex that the hover text describes, only in the window, not in screenshots."""
    hover = state.of(Weights).hover
    if not hover.lines:
        return
    x, y, width, height = state.view_rect
    size = (max(round(width), 1), max(round(height), 1))
    found = project(view_of(state.camera, size, state.box), size, hover.point[None])
    if not found.seen[0]:
        return
    draw_list = imgui.get_background_draw_list()
    draw_list.push_clip_rect((x, y), (x + width, y + height), True)
    across, down = (found.pixels[0] + [x, y]).tolist()
    for radius, color in ((0.5 * (_DOT + _RIM), _DARK), (0.5 * _DOT, _LIGHT)):
        draw_list.add_circle((across, down), radius, imgui.get_color_u32(color), 0, 2.0)
    draw_list.pop_clip_rect()


def draw_hover_text(state: AppState) -> None:
    """Draw the hover text while the mouse does not move."""
    hover = state.of(Weights).hover
    mouse = imgui.get_io().mouse_pos
    if not hover.lines or hover.place != (mouse.x, mouse.y) or not shows_vertex_info(state):
        return
    x, y, width, height = state.view_rect
    is_right, is_low = mouse.x > x + 0.6 * width, mouse.y > y + 0.6 * height
    left = mouse.x - _AWAY if is_right else mouse.x + _AWAY
    top = mouse.y - _AWAY if is_low else mouse.y + _AWAY
    if begin_overlay("##hover", left, top, (float(is_right), float(is_low))):
        for line in hover.lines:
            imgui.text_unformatted(line)
    overlay_rect(state, "##hover")
    imgui.end()


def shows_vertex_info(state: AppState) -> bool:
    """Return whether hover text is currently shown."""
    view, io = state.of(Weights), imgui.get_io()
    shows_panel = view.panel_frame == imgui.get_frame_count()
    is_covered = bool(state.error) or state.of(Files).dialog is not None or io.want_capture_mouse
    is_held = any(io.mouse_down[button] for button in range(3))
    return (view.always_shows_info or shows_panel) and not is_covered and not is_held
