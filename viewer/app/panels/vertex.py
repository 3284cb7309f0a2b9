"""Vertex: every number that puts the pinned vertex where it is, to be checked by hand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from imgui_bundle import imgui

from viewer.app.explanation_lines import influence_colors
from viewer.app.state import AppState
from viewer.app.weights_actions import explained, toggle_picking, unpin
from viewer.app.widgets import button, checkbox, explain, note_item, same_line_if_room
from viewer.errors import ViewerError, printable
from viewer.rig.arrays import Floats
from viewer.rig.explanation import DualTerms, Explanation
from viewer.rig.explanation_text import explanation_text
from viewer.rig.skinning import METHODS

__all__ = ["draw", "matrix_text"]

_DIGITS = 4
_COPIED_DIGITS = 6
_LONGEST = 40  # letters of a name
_NUMBER, _LABEL = 3.8, 4.8  # widths of columns, letters' heights


def draw(state: AppState) -> None:
    """Draw the panel."""
    try:
        explanation = explained(state)
    except ViewerError as problem:
        state.error = str(problem)
        unpin(state)
        return
    pinned = state.weights.pinned
    if explanation is None or pinned is None or pinned.figure.skeleton is None:
        imgui.text_wrapped("Alt+click a vertex: here is said why it is where it is.")
        text = "Click without Alt"
        if checkbox(state, text, state.weights.picks_vertices) != state.weights.picks_vertices:
            toggle_picking(state)
        return
    _draw_head(state, explanation)
    # Numbers are not cut off in a narrow panel.
    sideways = imgui.WindowFlags_.horizontal_scrollbar
    if imgui.begin_child("numbers", (0.0, 0.0), 0, sideways):
        colors = influence_colors(explanation, pinned.figure.skeleton)
        _draw_steps(state, explanation, colors)
    imgui.end_child()


def _draw_steps(state: AppState, one: Explanation, colors: Floats) -> None:
    """Draw what happens to the vertex, in the order in which it does."""
    _draw_rest(one)
    if one.is_free:
        imgui.text_wrapped("No influence: the vertex stays where it was bound.")
    else:
        for index in range(len(one.joints)):
            _draw_influence(state, one, index, colors[index])
        _draw_sums(one)
        if one.dual is not None:
            _draw_dual(one.dual)
    _draw_end(one)


def _draw_head(state: AppState, one: Explanation) -> None:
    pinned = state.weights.pinned
    assert pinned is not None  # it is explained
    name = printable(state.scene.actors[pinned.actor].name, _LONGEST)
    imgui.text_wrapped(f"Vertex {one.vertex} of {name}: {METHODS[one.skinning.method]}")
    if button(state, "Copy as text"):
        imgui.set_clipboard_text("\n".join(explanation_text(one, _COPIED_DIGITS)))
        state.say_status("The explanation was copied")
    same_line_if_room("Unpin")
    if button(state, "Unpin"):
        unpin(state)
    explain("let go of the vertex (Esc)")
    same_line_if_room("Lines")
    state.weights.draws_lines = checkbox(state, "Lines", state.weights.draws_lines)
    explain("to where each joint alone would carry the vertex; thicker for larger weights")


def _draw_rest(one: Explanation) -> None:
    """Draw how the file's vertex became p, what the joints move."""
    rows = [("stored", one.stored)]
    if not np.array_equal(one.shaped, one.stored):
        rows.append(("+ shape", one.shaped))
    if not np.array_equal(one.rest, one.shaped):
        rows.append(("+ pose", one.rest))
    _draw_rows("rest", [*rows, ("p", one.rest)])


def _draw_influence(state: AppState, one: Explanation, index: int, color: Floats) -> None:
    """Draw what one joint does: its matrix, its image of the vertex, its term of the sum."""
    number = index + 1
    imgui.separator()
    _draw_swatch(color)
    pinned = state.weights.pinned
    is_chosen = pinned is not None and state.chosen_actor == pinned.actor
    joint, name = int(one.joints[index]), printable(one.names[index], _LONGEST)
    text = f"{number}. {name}: w = {one.weights[index]:.{_DIGITS}f}###influence{number}"
    if imgui.selectable(text, is_chosen and state.selected_joint == joint)[0]:
        if pinned is not None and not is_chosen:
            state.choose_actor(pinned.actor)
        state.selected_joint = state.weights.scrolls_to = joint
    note_item(state, f"influence {number}")
    explain("select this joint")
    _draw_rows(f"matrix {number}", [("", row) for row in one.matrices[index]])
    explain(f"M{number}, the skinning matrix")
    terms = [(f"M{number} p", one.images[index]), (f"w M{number} p", one.terms[index])]
    _draw_rows(f"terms {number}", terms)
    if button(state, f"Copy M{number}"):
        imgui.set_clipboard_text(matrix_text(one.matrices[index]))
        state.say_status(f"M{number} was copied")


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


def _draw_sums(one: Explanation) -> None:
    imgui.separator()
    _draw_rows("sums", [("sum w", one.weights.sum(keepdims=True)), ("sum w M p", one.linear)])


def _draw_dual(dual: DualTerms) -> None:
    """Draw the quaternions that dual quaternion skinning adds (Kavan et al. 2008)."""
    imgui.separator_text("Dual quaternions")
    for index, values in enumerate(dual.duals):
        flip = "" if dual.signs[index] > 0.0 else ", turned to the side of q1"
        imgui.text_wrapped(f"q{index + 1}: share {dual.shares[index]:.{_DIGITS}f}{flip}")
        _draw_quaternions(f"dual {index}", values)
    imgui.text_unformatted("q = sum of share times q, so turned")
    _draw_quaternions("blended", dual.blended)
    _draw_rows("length", [("length", np.array([dual.length]))])
    explain("of the real part; both parts are divided by it")
    _draw_rows("moved", [("stretched", dual.stretched), ("by q", dual.position)])


def _draw_quaternions(name: str, values: Floats) -> None:
    """Draw both parts of a dual quaternion."""
    _draw_rows(name, [("", values[:4]), ("", values[4:])])
    explain("the real part x y z w, then the dual part")


def _draw_end(one: Explanation) -> None:
    """Draw where the vertex ends up."""
    imgui.separator()
    if one.skinning.method == "mix":
        imgui.text_unformatted(f"{one.skinning.share:.2f} of the way from LBS to DQS")
        _draw_rows("mixed", [("skinned", one.skinned)])
    if not np.array_equal(one.placement, np.eye(4)):
        factor = one.placement[0, :1]
        _draw_rows("placed", [("times", factor), ("plus", one.placement[:3, 3])])
    _draw_rows("end", [("position", one.position)])


def _draw_rows(name: str, rows: Sequence[tuple[str, Floats]]) -> None:
    """Draw rows of a label and some numbers; four numbers leave no room for labels."""
    count = max(len(values) for _, values in rows)
    has_labels, width = count < 4, imgui.get_font_size()
    padding = 2.0 * imgui.get_style().cell_padding.x
    room = (has_labels * (_LABEL * width + padding) + count * (_NUMBER * width + padding), 0.0)
    fixed = imgui.TableColumnFlags_.width_fixed
    imgui.begin_group()
    if imgui.begin_table(name, has_labels + count, imgui.TableFlags_.sizing_fixed_fit, room):
        for column in range(has_labels + count):
            is_label = has_labels and column == 0
            imgui.table_setup_column("", fixed, (_LABEL if is_label else _NUMBER) * width)
        for text, values in rows:
            imgui.table_next_row()
            if has_labels:
                imgui.table_next_column()
                imgui.text_unformatted(text)
            for value in values.tolist():
                _draw_number(value)
        imgui.end_table()
    imgui.end_group()


def _draw_number(value: float) -> None:
    """Draw a number at the right edge of the next cell."""
    imgui.table_next_column()
    # Adding 0 makes -0 a plain 0, also for what is rounded to it.
    text = f"{round(value, _DIGITS) + 0.0:.{_DIGITS}f}"
    room = imgui.get_content_region_avail().x - imgui.calc_text_size(text).x
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(room, 0.0))
    imgui.text_unformatted(text)
