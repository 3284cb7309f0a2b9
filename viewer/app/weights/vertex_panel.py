"""Vertex: every number that puts the pinned vertex where it is, to be checked by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.widgets import button, checkbox, explain, note_item, same_line_if_room
from viewer.app.posing.joint_tree import joint_tree
from viewer.app.weights.actions import explained, toggle_picking, unpin
from viewer.app.weights.explanation_lines import influence_colors
from viewer.app.weights.state import Weights
from viewer.errors import ViewerError
from viewer.phrases import printable
from viewer.rig.arrays import Floats
from viewer.rig.inspection.explanation import DualTerms, Explanation
from viewer.rig.inspection.explanation_text import explanation_text
from viewer.rig.number_text import number_text
from viewer.rig.skinning import METHODS

__all__ = ["draw", "fitting", "matrix_text"]

_DIGITS = 4
_COPIED_DIGITS = 6
_LONGEST = 40  # letters of a name
_NUMBER, _LABEL = 3.8, 4.7  # widths of columns, letters' heights
_DIGIT = 0.56  # width, letters' heights
_SMALLEST, _FEWEST = 0.75, 3  # share of the usual letters, digits: in a narrow panel
_PADDING = 2.0  # points beside each number
_SPARE = 6.0  # points: heights of letters are whole pixels


def draw(state: AppState) -> None:
    """Draw the panel."""
    weights = state.of(Weights)
    try:
        explanation = explained(state)
    except ViewerError as problem:
        state.error = str(problem)
        unpin(state)
        return
    pinned = weights.pinned
    if explanation is None or pinned is None or pinned.figure.skeleton is None:
        imgui.text_wrapped("Alt+click a vertex to explain its position here.")
        text = "Click without Alt"
        if checkbox(state, text, weights.picks_vertices) != weights.picks_vertices:
            toggle_picking(state)
        return
    _draw_head(state, explanation)
    # Numbers are not cut off in the narrowest panel either. Were the other scroll bar not always
    # there, what is drawn smaller could make it go, and come back as it is drawn larger then.
    bars = imgui.WindowFlags_.horizontal_scrollbar | imgui.WindowFlags_.always_vertical_scrollbar
    if imgui.begin_child("numbers", (0.0, 0.0), 0, bars):
        share, digits = fitting(imgui.get_content_region_avail().x, imgui.get_font_size())
        imgui.push_font(None, share * imgui.get_style().font_size_base)
        imgui.push_style_var_x(imgui.StyleVar_.cell_padding, _PADDING)
        colors = influence_colors(explanation, pinned.figure.skeleton)
        _draw_steps(_Sheet(state, digits), explanation, colors)
        imgui.pop_style_var()
        imgui.pop_font()
    imgui.end_child()


def fitting(room: float, letters: float) -> tuple[float, int]:
    """Return how much smaller letters are so that rows fit, and how many digits numbers have.

    Parameters
    ----------
    room : float
        Width of the panel, points.
    letters : float
        Usual height of the letters, points.

    Returns
    -------
    share : float
        Of that height, 0.75 to 1.
    digits : int
        Behind the point: four, or three where that is not small enough.

    >>> fitting(300.0, 15.0), fitting(240.0, 15.0)[1], fitting(50.0, 15.0)
    ((1.0, 4), 4, (0.75, 3))
    """
    share = 0.0
    for digits in range(_DIGITS, _FEWEST - 1, -1):
        number = _NUMBER - _DIGIT * (_DIGITS - digits)
        # Four numbers of a matrix, or a label and three of a point.
        share = min(
            (room - 8.0 * _PADDING - _SPARE) / (max(_LABEL, number) + 3.0 * number) / letters, 1.0
        )
        if share >= _SMALLEST:
            break
    return max(share, _SMALLEST), digits


@dataclass(frozen=True, slots=True)
class _Sheet:
    """Where rows of numbers are written, and with how many digits."""

    state: AppState
    digits: int


def _draw_steps(sheet: _Sheet, one: Explanation, colors: Floats) -> None:
    """Draw what happens to the vertex, in the order in which it does."""
    _draw_rest(sheet, one)
    if one.is_free:
        imgui.text_wrapped("No influence: the vertex stays at its bind position.")
    else:
        for index in range(len(one.joints)):
            _draw_influence(sheet, one, index, colors[index])
        _draw_sums(sheet, one)
        if one.dual is not None:
            _draw_dual(sheet, one.dual)
    _draw_end(sheet, one)


def _draw_head(state: AppState, one: Explanation) -> None:
    weights = state.of(Weights)
    pinned = weights.pinned
    assert pinned is not None  # it is explained
    name = printable(state.scene.actors[pinned.actor].name, _LONGEST)
    imgui.text_wrapped(f"Vertex {one.vertex} of {name}: {METHODS[one.skinning.method].title}")
    if button(state, "Copy as text"):
        imgui.set_clipboard_text("\n".join(explanation_text(one, _COPIED_DIGITS)))
        state.say_status("Explanation copied")
    same_line_if_room("Unpin")
    if button(state, "Unpin"):
        unpin(state)
    explain("unpin the vertex (Esc)")
    same_line_if_room("Lines")
    weights.draws_lines = checkbox(state, "Lines", weights.draws_lines)
    explain("to where each joint alone would move the vertex; thicker for larger weights")


def _draw_rest(sheet: _Sheet, one: Explanation) -> None:
    """Draw how the file's vertex became p, what the joints move."""
    rows = [("stored", one.stored)]
    if not np.array_equal(one.shaped, one.stored):
        rows.append(("+ shape", one.shaped))
    if not np.array_equal(one.rest, one.shaped):
        rows.append(("+ pose", one.rest))
    _draw_rows(sheet, "rest", [*rows, ("p", one.rest)])


def _draw_influence(sheet: _Sheet, one: Explanation, index: int, color: Floats) -> None:
    """Draw what one joint does: its matrix, its image of the vertex, its term of the sum."""
    state, number = sheet.state, index + 1
    imgui.separator()
    _draw_swatch(color)
    pinned = state.of(Weights).pinned
    is_chosen = pinned is not None and state.chosen_actor == pinned.actor
    joint, name = int(one.joints[index]), printable(one.names[index], _LONGEST)
    room, head = imgui.get_content_region_avail().x, f"{number}. {name}"
    weight = f"w = {one.weights[index]:.{_DIGITS}f}"
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
    terms = [(f"M{number} p", one.images[index]), (f"w M{number} p", one.terms[index])]
    _draw_rows(sheet, f"terms {number}", terms)
    if button(state, f"Copy M{number}"):
        imgui.set_clipboard_text(matrix_text(one.matrices[index]))
        state.say_status(f"M{number} copied")


def _draw_swatch(color: Floats) -> None:
    """Draw the colour that an influence has in the view, at the beginning of a line."""
    place, side = imgui.get_cursor_screen_pos(), imgui.get_text_line_height()
    r, g, b = color.tolist()
    ink = imgui.get_color_u32((r, g, b, 1.0))
    corner = (place.x + side, place.y + side)
    imgui.get_window_draw_list().add_rect_filled(place, corner, ink)
    imgui.dummy((side, side))
    imgui.same_line()


def matrix_text(matrix: Floats) -> str:
    """Return a matrix as rows of numbers that read back as the same ones.

    Parameters
    ----------
    matrix : (4, 4)
        Any.
    """
    return "\n".join(" ".join(map(repr, row)) for row in matrix.tolist())


def _draw_sums(sheet: _Sheet, one: Explanation) -> None:
    imgui.separator()
    _draw_rows(
        sheet, "sums", [("sum w", one.weights.sum(keepdims=True)), ("sum w M p", one.linear)]
    )


def _draw_dual(sheet: _Sheet, dual: DualTerms) -> None:
    """Draw the quaternions that dual quaternion skinning adds (Kavan et al. 2008)."""
    imgui.separator_text("Dual quaternions")
    for index, values in enumerate(dual.duals):
        flip = "" if dual.signs[index] > 0.0 else ", negated to the hemisphere of q1"
        imgui.text_wrapped(f"q{index + 1}: weight {dual.fractions[index]:.{_DIGITS}f}{flip}")
        _draw_quaternions(sheet, f"dual {index}", values)
    imgui.text_wrapped("q = sum of weight times q, negated as above")
    _draw_quaternions(sheet, "blended", dual.blended)
    _draw_rows(sheet, "length", [("length", np.array([dual.length]))])
    explain("of the real part; both parts are divided by it")
    _draw_rows(sheet, "moved", [("stretched", dual.stretched), ("by q", dual.position)])


def _draw_quaternions(sheet: _Sheet, name: str, values: Floats) -> None:
    """Draw both parts of a dual quaternion."""
    _draw_rows(sheet, name, [("", values[:4]), ("", values[4:])])
    explain("the real part x y z w, then the dual part")


def _draw_end(sheet: _Sheet, one: Explanation) -> None:
    """Draw where the vertex ends up."""
    imgui.separator()
    method = METHODS[one.skinning.method]
    if method.result:
        ends = " to ".join(METHODS[end].short for end in method.ends)
        text = method.result.format(blend_factor=f"{one.skinning.blend_factor:.2f}")
        imgui.text_wrapped(f"{text} from {ends}" if ends else text)
        _draw_rows(sheet, "result", [("skinned", one.skinned)])
    if not np.array_equal(one.placement, np.eye(4)):
        factor = one.placement[0, :1]
        _draw_rows(sheet, "placed", [("times", factor), ("plus", one.placement[:3, 3])])
    _draw_rows(sheet, "end", [("position", one.position)])


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
                _draw_number(value, sheet.digits)
        imgui.end_table()
    imgui.end_group()


def _draw_number(value: float, digits: int) -> None:
    """Draw a number at the right edge of the next cell."""
    imgui.table_next_column()
    text = number_text(value, f".{digits}f")
    room = imgui.get_content_region_avail().x - imgui.calc_text_size(text).x
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(room, 0.0))
    imgui.text_unformatted(text)
