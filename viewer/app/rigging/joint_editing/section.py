"""Section "Edit skeleton" of the Rig panel."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.reasons import no_job_room
from viewer.app.core.saved_work import SavedWork
from viewer.app.core.state import AppState
from viewer.app.core.text_fields import text_field
from viewer.app.core.widgets import (
    button,
    choice,
    disabled,
    draw_setting,
    explain,
    note_item,
    same_line_if_room,
    warning,
    with_key,
)
from viewer.app.rigging.joint_editing.binding import bind_again
from viewer.app.rigging.joint_editing.commands import delete_joint, mirror, rename_joint
from viewer.app.rigging.joint_editing.starts import no_subject, start_editing, starts, subject
from viewer.app.rigging.joint_editing.state import (
    JointEditing,
    edited,
    no_joint,
    stop_editing,
)
from viewer.app.rigging.joint_editing.template_fit import no_refit, refit, template_fit
from viewer.phrases import capitalized, counted, printable
from viewer.rigs.joint_edits import no_edit
from viewer.rigs.scene import Actor


def draw_section(state: AppState) -> None:
    """Draw the controls of the section "Edit skeleton" of the Rig panel."""
    editing, actor = state.of(JointEditing), subject(state)
    why = no_subject(state)
    imgui.text_wrapped(printable(actor.name, 60) if not why else f"{capitalized(why)}.")
    if edited(state) is None:
        known = starts(state) or {"": "none"}
        if editing.start not in known:
            editing.start = next(iter(known))
        with disabled(state, why):
            editing.start = choice(state, "Start from", editing.start, known)
            explain(no_edit(actor.figure) if actor.figure.is_attached else "")
            if button(state, "Edit skeleton", no_job_room(state)):
                start_editing(state)
            explain("place, drag, remove and mirror joints in the view; the weights follow")
        return
    text = "heat and voxel: new weights after every edit; keep: only removed joints change them"
    before = editing.choices.weights
    draw_setting(state, "Weights##edit", editing.choices, "weights", text)
    if editing.choices.weights != before and editing.choices.weights != "keep":
        bind_again(state)
    text = "edits apply to both sides; joints in the middle stay in the plane of symmetry"
    draw_setting(state, "Symmetric", editing.choices, "symmetric", text)
    _draw_joint(state, actor)
    if template_fit(state) is not None:
        if button(state, "Fit the other joints", no_refit(state)):
            refit(state)
        explain("fit the template again; the joints that were moved by hand stay", no_refit(state))
    if button(state, "Done###edit done"):
        stop_editing(state)
    explain(with_key(state, "pose the figure with the tools; File > Export saves it", "Esc"))
    imgui.text_disabled(f"{counted(actor.figure.require_skeleton().n_joints, 'joint')}")
    imgui.push_text_wrap_pos(0.0)
    imgui.text_disabled(
        "Click the mesh: new joint below the selected one. Drag a joint: those below move along, "
        "unless Ctrl is held. Shift: in the middle of the mesh."
    )
    imgui.pop_text_wrap_pos()
    _draw_weights(state, actor)


def _draw_joint(state: AppState, actor: Actor) -> None:
    """Draw name and buttons of the selected joint."""
    editing, why = state.of(JointEditing), no_joint(state)
    joint, skeleton = state.selected_joint, actor.figure.require_skeleton()
    present = skeleton.names[joint] if 0 <= joint < skeleton.n_joints else ""
    key = (skeleton, joint)
    if editing.name[0] != key:
        editing.name = key, present
    with disabled(state, why):
        imgui.set_next_item_width(-1.0)
        flags = imgui.InputTextFlags_.enter_returns_true
        entered, name = text_field("##joint name", editing.name[1], "name of the joint", flags)
        note_item(state, "joint name")
        explain("name of the selected joint; Enter renames it", why)
        editing.name = key, name
        if (entered or imgui.is_item_deactivated_after_edit()) and name not in ("", present):
            rename_joint(state, name)
        if button(state, "Remove###edit remove", why):
            delete_joint(state)
        explain(with_key(state, "its children and weights go to the joint above", "Delete"), why)
        same_line_if_room("Mirror")
        if button(state, "Mirror###edit mirror", why):
            mirror(state)
        explain(with_key(state, "mirror it and the joints below it to the other side", "M"), why)


def _draw_weights(state: AppState, actor: Actor) -> None:
    """Draw whether the weights fit the joints."""
    editing, figure = state.of(JointEditing), actor.figure
    if figure is editing.refused and editing.problem:
        warning(capitalized(editing.problem))
    if figure not in editing.stale or editing.choices.weights == "keep":
        is_edited = figure in state.of(SavedWork).edited
        imgui.text_disabled("weights: up to date" if is_edited else "weights: as read")
        return
    imgui.text_disabled("weights: out of date")
    if figure is editing.refused:
        same_line_if_room("Bind now")
        if button(state, "Bind now", no_job_room(state)):
            editing.refused = None
