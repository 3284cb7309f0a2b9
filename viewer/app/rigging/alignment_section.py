"""Section of the Rig panel that aligns the template with the target."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.fields import begin_field, in_row
from viewer.app.core.ink import WARNING, ink
from viewer.app.core.reasons import no_job_room
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
from viewer.app.rigging.placing import (
    aligned_template,
    box_fit,
    is_posed_since,
    move_by_hand,
    placing_now,
    posed_template,
    similarity_now,
)
from viewer.app.rigging.sources import target_mesh
from viewer.app.rigging.state import GHOSTS, TOOLS, Placing, Rigging, Template
from viewer.app.rigging.tools import choose_rig_tool
from viewer.app.rigging.work import landmark_settings, start_align
from viewer.autorig.alignment.orientation_search import AXES
from viewer.autorig.alignment.similarity import Similarity
from viewer.autorig.alignment.surface_alignment import SCALES, Alignment, AlignmentSettings
from viewer.errors import ViewerError
from viewer.rig.arrays import Floats
from viewer.rig.geometry.rotation import axis_rotations, matrix_to_euler

__all__ = ["draw_alignment"]

_FEWEST = 3  # minimum number of landmarks
_DOUBTFUL = 0.03  # error relative to the target's size, as in the report
_STRETCHED = "stretched, pose kept"
_METHODS = {
    "in place": "about the shared origin",
    "search": "by closest points",
    "fit": "pose and limbs fitted",
    "landmarks": "by landmarks",
    "given": "by hand",
}
"""Labels of the alignment methods, the values of ``Alignment.how``."""
_POSES = "; joints are rotated and limbs resized if that fits much better"
_FITS = (
    "; joints are rotated and limbs resized, or the whole template is stretched, if that fits much "
    "better"
)
_SCALE_TEXTS = {"uniform": "uniform", "axes": "one per axis", "none": "none"}


def draw_alignment(state: AppState) -> None:
    """Draw the settings of the alignment, its error, and the tools to move the template by hand."""
    rigging, why = state.of(Rigging), no_job_room(state)
    choices = rigging.choices
    axes = {"": "automatic", **{axis: axis for axis in AXES}}
    choices.up = choice(state, "Up", choices.up, axes)
    explain("up axis of the target")
    choices.facing = choice(state, "Facing", choices.facing, axes)
    explain("forward axis of the target")
    choices.scale = choice(state, "Scale", choices.scale, {s: _SCALE_TEXTS[s] for s in SCALES})
    choices.fits = checkbox(state, "Fit pose and proportions", choices.fits)
    explain("rotate the template's joints and resize its limbs where the target differs")
    if button(state, "Align", why):
        start_align(state)
    if not why:
        explain(f"find the best placement by closest points{_FITS if choices.fits else ''}")
    same_line_if_room("Refine")
    refuses = why or ("" if placing_now(state) else "align the template first")
    if button(state, "Refine", refuses):
        _refine(state)
    if not refuses:
        explain(f"from its current placement, by closest points{_POSES if choices.fits else ''}")
    _draw_placing(placing_now(state))
    rigging.ghost = choice(state, "Template shown", rigging.ghost, GHOSTS)
    _draw_tools(state)
    template = aligned_template(state)
    if template is not None and rigging.tool not in ("", "landmarks"):
        _draw_numbers(state, template)
    if template is not None and (rigging.tool == "landmarks" or rigging.landmarks):
        _draw_landmarks(state, template)
    placing = placing_now(state)
    # Lines that appear and disappear are placed below the controls, which must not move.
    for line in placing.lines if placing is not None else ():
        imgui.text_wrapped(line.labelled)
    if is_posed_since(state):
        imgui.text_wrapped("the template was posed after the alignment: align it again")


def _draw_placing(placing: Placing | None) -> None:
    """Draw the distance between the aligned template and the target."""
    if placing is None:
        imgui.text_disabled("not aligned yet")
        return
    _draw_error(placing.alignment)


def _draw_error(found: Alignment | None) -> None:
    """Draw the error, a trimmed RMS as in the report."""
    if found is None:
        imgui.text_disabled("error: not measured at this placement")
        return
    text = f"error {100.0 * found.error:.2f} % ({_method_text(found)})"
    if found.error > _DOUBTFUL:
        imgui.push_style_color(imgui.Col_.text, ink(WARNING))
        imgui.text_wrapped(f"{text}: doubtful")
        imgui.pop_style_color()
    else:
        imgui.text_wrapped(text)
    explain(
        "RMS distance of the best 90 % of the target from the template, relative to the target's "
        f"size; distance of the template from the target: {100.0 * found.away:.2f} %"
    )


def _method_text(found: Alignment) -> str:
    """Return the label of an alignment method; with fitted limbs, there is only one scale."""
    scales = found.similarity.factors, found.similarity.own_factors
    is_even = all((factors == 1.0).all() for factors in scales)
    return _METHODS[found.how] if found.how != "fit" or is_even else _STRETCHED


def _refine(state: AppState) -> None:
    """Refine the current alignment by closest points; box corners as landmarks represent it."""
    rigging = state.of(Rigging)
    template = aligned_template(state)
    if template is None:
        return
    low, high = (f(posed_template(rigging, template).positions, axis=0) for f in (np.min, np.max))
    corners = np.array([low, *(np.where(np.eye(3)[axis] > 0, high, low) for axis in range(3))])
    corners[1:] += (high == low) * np.eye(3)  # keeps the four corners of flat meshes distinct
    pairs = np.stack([corners, similarity_now(state, template).apply(corners)], axis=1)
    start_align(state, AlignmentSettings(landmarks=pairs, scale=rigging.choices.scale))


def _draw_tools(state: AppState) -> None:
    """Draw the choice of a tool to move the template in the view."""
    imgui.text_disabled("By hand")
    for number, (tool, (name, text)) in enumerate(TOOLS.items()):
        if number:
            same_line_if_room(name)
        if imgui.radio_button(f"{name}###rig tool {tool}", state.of(Rigging).tool == tool):
            choose_rig_tool(state, tool)
        note_item(state, f"rig tool {tool}")
        explain(text)


def _draw_numbers(state: AppState, template: Template) -> None:
    """Draw input fields of the template's placement: translation, Euler angles, scale."""
    now = similarity_now(state, template)
    angles = np.degrees(matrix_to_euler(now.rotation[None])[0])
    shift, angle, scale = _inputs(state, now.shift, angles, now.scale)
    if shift is None and angle is None and scale is None:
        if button(state, "Align boxes"):
            fit = box_fit(posed_template(state.of(Rigging), template), target_mesh(state))
            _move(state, template, fit)
        return
    rotation = now.rotation
    if angle is not None:
        x, y, z = (axis_rotations(axis, np.radians(angle[axis])) for axis in range(3))
        rotation = z @ y @ x
    moved = replace(
        now,
        scale=now.scale if scale is None else scale,
        rotation=rotation,
        shift=now.shift if shift is None else shift,
    )
    _move(state, template, moved)


def _inputs(
    state: AppState, shift: Floats, angles: Floats, scale: float
) -> tuple[Floats | None, Floats | None, float | None]:
    """Draw the input fields; return the values that were typed, None for unchanged fields."""
    moved = _vector_field(state, "Translation", shift, "%.4g")
    rotated = _vector_field(state, "Rotation", angles, "%.2f\N{DEGREE SIGN}")
    size = number_field(state, begin_field("Scale factor"), scale)
    note_item(state, "Scale factor")
    return moved, rotated, size if size is not None and size > 0.0 else None


def _vector_field(state: AppState, label: str, values: Floats, text: str) -> Floats | None:
    """Draw three number fields; return the vector with the number that was entered, if any."""
    entered = values.copy()
    found = []

    def draw(hidden: str, axis: int) -> None:
        number = number_field(state, hidden, plain_zero(float(values[axis]), text), text)
        if number is not None:
            entered[axis] = number
            found.append(axis)

    in_row(begin_field(label), range(3), draw)
    note_item(state, label)
    return entered if found else None


def _move(state: AppState, template: Template, similarity: Similarity) -> None:
    move_by_hand(state, template, similarity)
    state.of(Rigging).was_dragged = True


def _draw_landmarks(state: AppState, template: Template) -> None:
    """Draw the list of landmarks, and the button to align by them."""
    view = state.of(Rigging)
    if view.tool == "landmarks":
        side = "the same point of the target" if view.pending else "a point of the blue template"
        imgui.text_wrapped(f"Click {side}.")
    removed = -1
    for row in range(len(view.landmarks)):
        if imgui.small_button(f"x##landmark {row}"):
            removed = row
        note_item(state, f"delete landmark {row}")
        explain("delete this pair")
        imgui.same_line()
        imgui.text_unformatted(f"Pair {row + 1}")
        if row % 3 != 2 and row + 1 < len(view.landmarks):
            imgui.same_line()
    if removed >= 0:
        del view.landmarks[removed]
    view.choices.refines = checkbox(state, "Refine by closest points", view.choices.refines)
    missing = _FEWEST - len(view.landmarks)
    why = f"{missing} more pair{'s' * (missing != 1)} needed" if missing > 0 else ""
    if button(state, "Align by landmarks", why or no_job_room(state)):
        mesh = posed_template(view, template)
        try:
            start_align(state, landmark_settings(state, mesh, view.choices.refines))
        except ViewerError as problem:
            state.error = str(problem)
    with disabled(state, "" if view.landmarks else "there are no landmarks"):
        same_line_if_room("Delete all")
        if button(state, "Delete all"):
            view.landmarks, view.pending = [], None
