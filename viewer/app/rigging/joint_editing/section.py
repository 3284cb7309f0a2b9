"""Section "Edit skeleton" of the Rig panel: its controls, starts, and further fits of a template.

Joints start with those of the figure, a fitted template, or a single joint.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import TypeAlias

import numpy as np
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
from viewer.app.posing.joint_tree import select_joint
from viewer.app.posing.posing import Posing
from viewer.app.rigging.joint_editing.binding import bind_again, weight_settings
from viewer.app.rigging.joint_editing.commands import delete_joint, mirror, rename_joint
from viewer.app.rigging.joint_editing.state import (
    NOT_KEPT,
    JointEditing,
    TemplateFit,
    commit,
    edited,
    no_joint,
    plane_of,
    rest_mesh,
    show,
    stop_editing,
)
from viewer.app.rigging.placing import target_place
from viewer.app.rigging.rigging import (
    SHAPE,
    Rigging,
    Template,
    choose_target,
    target_mesh,
    targets,
)
from viewer.app.rigging.work import AlignedStart, aligned_start, begin_work, fit_again, put_question
from viewer.autorig.alignment.surface_alignment import AlignmentSettings
from viewer.autorig.binding import enclosed
from viewer.autorig.pipeline import transfer
from viewer.autorig.settings import TransferSettings
from viewer.data_classes import dataclass
from viewer.phrases import capitalized, counted, listed, printable
from viewer.progress import report
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.quaternion import between
from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.geometry.transform import apply_transform, translation_matrix
from viewer.rigs.hierarchy import descendants
from viewer.rigs.joint_edits import moved, no_edit, prepared, rest_worlds
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.pose import placement_matrix, rest_pose
from viewer.rigs.retargeting.joint_names import LIMBS, joint_meanings
from viewer.rigs.scene import Actor
from viewer.rigs.shape import shaped_skeleton
from viewer.rigs.skeleton import Skeleton, ball_skeleton
from viewer.rigs.skin import Skin


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


_AS_WIDE = 0.9  # distance from the surface relative to the largest


@dataclass(frozen=True, slots=True, eq=False)
class _Begun:
    """A figure to edit."""

    figure: Figure
    place: Floats | None = None
    """Its placement in the scene; None to keep the former one."""
    lost: tuple[str, ...] = ()
    """Names of what it lacks of the former figure."""
    template: Template | None = None
    """The template that was fitted, as it was before."""


_Start: TypeAlias = Callable[[], _Begun | AlignedStart]
"""Computes the figure to edit, in a thread; or a template whose front is doubtful."""


def subject(state: AppState) -> Actor:
    """Return the actor whose joints would be edited: the target of the panel, or the chosen one."""
    editing, target = state.of(JointEditing), state.of(Rigging).target
    if editing.is_on and editing.actor is not None:
        return editing.actor
    return state.actor if target is None or state.actor.figure.is_attached else target


def no_subject(state: AppState) -> str:
    """Return the reason why the joints of no figure can be edited."""
    figure = subject(state).figure
    if figure.mesh is None or figure.mesh.n_triangles == 0:
        return "this figure has no mesh: choose one in the Actors panel, or add a mesh"
    return ""


def starts(state: AppState) -> dict[str, str]:
    """Return the possible starts of the subject, with their labels."""
    actor = subject(state)
    found = {}
    if actor.figure.is_attached and not no_edit(actor.figure):
        found["own"] = "own joints"
    if any(actor is one for one in targets(state)):
        is_shape = state.of(Rigging).template_key == SHAPE
        found["template"] = "joints from shape" if is_shape else "template, fitted"
    if actor.figure.mesh is not None:
        found["root"] = "one joint"
    return found


def start_editing(state: AppState) -> None:
    """Edit the joints of the subject, beginning with those that are chosen."""
    editing, actor = state.of(JointEditing), subject(state)
    known, why = starts(state), no_subject(state) or no_job_room(state)
    if why or not known:
        state.say_status(why or no_edit(actor.figure))
        return
    start = editing.start if editing.start in known else next(iter(known))
    take = _STARTS[start](state, actor)

    def act() -> Callable[[AppState], None]:
        begun = take()
        if isinstance(begun, AlignedStart):
            placing = begun.placing
            assert placing is not None  # it asks
            return lambda state: put_question(state, begun.template, placing, start_editing)
        mesh = rest_mesh(begun.figure)
        report(90, 100, "", "Looking for the plane of symmetry")
        plane_of(begun.figure, mesh)  # so that no click has to wait for it
        return lambda state: _enter(state, actor, begun)

    begin_work(state, "Finding joints", act)


def _own_joints(_state: AppState, actor: Actor) -> _Start:
    return lambda: _Begun(actor.figure)


def _fitted_template(state: AppState, actor: Actor) -> _Start:
    """Fit the template to the anatomy of the mesh, and take its joints."""
    choose_target(state, actor)
    mesh, place, name = target_mesh(state), target_place(actor), actor.figure.name
    how = weight_settings(state)
    start = aligned_start(state)

    def act() -> _Begun | AlignedStart:
        found = start()
        if found.placing is not None and found.placing.asks:
            return found
        template, similarity = found.fitted, found.similarity
        pose, settings = template.pose, AlignmentSettings()
        skeleton = shaped_skeleton(template.figure, pose.shape_weights)
        if similarity is not None and not similarity.is_plain:
            # A stretched skeleton has oblique axes: only its places can be used.
            places = apply_transform(placement_matrix(pose), world_matrices(skeleton, pose))
            places = similarity.apply(places[:, :3, 3])
            skeleton = ball_skeleton(skeleton.names, skeleton.parents, places)
            pose, similarity = rest_pose(skeleton), None
            settings = AlignmentSettings(matrix=np.eye(4))
        elif similarity is not None:
            settings = AlignmentSettings(matrix=similarity.matrix)
        # Without the template's mesh, as in all later bindings: every joint may have weights.
        joints = Figure(
            template.figure.name, None, skeleton, up=template.figure.up, unit=template.figure.unit
        )
        plain = replace(pose, shape_weights=np.zeros(0))
        rigged = transfer(joints, plain, mesh, TransferSettings("heat", settings, how), name)
        figure = replace(rigged.figure, hands=(), pose_layout=None, fields=())
        fits = found.template.figure.is_attached
        matrix = place @ rigged.placement
        return _Begun(figure, matrix, template=found.template if fits else None)

    return act


def _single_root(state: AppState, actor: Actor) -> _Start:
    """Put one joint where the solid is widest, near its plane of symmetry."""
    figure = actor.figure

    def act() -> _Begun:
        report(0, 100, "", "Looking for the middle")
        mesh = rest_mesh(figure)
        plane, solid = plane_of(figure, mesh), enclosed(mesh)[1]
        centers = solid.centers(solid.voxels)
        near = np.abs(centers @ plane.normal - plane.offset) <= solid.spacing
        rows = np.flatnonzero(near) if near.any() else np.arange(len(centers))
        radii = solid.radii()[rows]
        # In the middle of the places that are about as wide.
        wide = centers[rows[radii >= _AS_WIDE * radii.max()]]
        place = wide[np.linalg.norm(wide - wide.mean(axis=0), axis=1).argmin()]
        skeleton = ball_skeleton(("root",), np.array([-1], dtype=np.int32), place[None])
        count = mesh.n_vertices
        inverse = translation_matrix(-place)[None]  # the joint has no rotation
        skin = Skin(
            np.arange(count + 1, dtype=np.int32),
            np.zeros(count, dtype=np.int32),
            np.ones(count),
            inverse,
        )
        bare, lost = prepared(replace(figure, skin=None, skeleton=None))
        shapes = figure.blend_shapes
        is_model = figure.joint_regressor is not None or figure.parameters is not None
        # Shapes of a body model move its joints; others fit the mesh that they were made for.
        if shapes is not None and (is_model or shapes.space or mesh is not figure.mesh):
            lost.append(counted(shapes.n_shapes, "blend shape"))
            bare = replace(bare, blend_shapes=None)
        bare = replace(bare, joint_regressor=None, parameters=None)
        found = replace(bare, mesh=mesh, skeleton=skeleton, skin=skin)
        return _Begun(found, lost=tuple(lost))

    return act


_STARTS: dict[str, Callable[[AppState, Actor], _Start]] = {
    "own": _own_joints,
    "template": _fitted_template,
    "root": _single_root,
}


def _enter(state: AppState, actor: Actor, begun: _Begun) -> None:
    """Show a figure in place of an actor's own, at rest, and let the mouse edit its joints."""
    editing, figure = state.of(JointEditing), begun.figure
    row = next((row for row, one in enumerate(state.scene.actors) if one is actor), -1)
    if row < 0:
        state.say("The figure to edit no longer exists")
        return
    if actor.clip is not None:
        state.say("The motion was stopped: joints are edited at rest")
    if begun.lost:
        state.say(NOT_KEPT.format(listed(begun.lost, 8)))
    actor.clip, actor.animation, actor.drive, actor.springs = None, -1, None, None
    if figure is not actor.figure:
        state.of(SavedWork).edited.add(figure)
        state.history.name = "find joints"
    if begun.place is not None:
        actor.placement, actor.own_pose = begun.place, None
    if begun.template is not None:
        editing.fit = TemplateFit(actor, begun.template, figure)
    show(actor, figure)
    if row != state.chosen_actor:
        state.choose_actor(row)
    rigging = state.of(Rigging)
    rigging.tool, rigging.ghost, state.of(Posing).tool = "", "", "select"
    state.options.xray, state.options.path_joints = True, ()
    if state.options.show == "binding":
        state.options.show = "skin"
    editing.actor, editing.is_on, editing.refused = actor, True, None
    if state.selected_joint < 0:
        select_joint(state, 0)
    n_joints = counted(figure.require_skeleton().n_joints, "joint")
    state.say_status(f"Editing {n_joints}: click the mesh to add one, drag to move one")


def template_fit(state: AppState) -> TemplateFit | None:
    """Return the fit of a template to the edited mesh, None if there is none."""
    fit = state.of(JointEditing).fit
    return fit if fit is not None and fit.actor is edited(state) else None


def no_refit(state: AppState) -> str:
    """Return the reason why the template cannot be fitted to joints placed by hand."""
    fit, actor = template_fit(state), edited(state)
    if fit is None or actor is None:
        return 'start from "template, fitted"'
    skeleton = actor.figure.require_skeleton()
    placed = state.of(JointEditing).placed.get(skeleton, frozenset())
    if not placed & frozenset(fit.template.figure.require_skeleton().names):
        return "move a joint first"
    return no_job_room(state)


def refit(state: AppState) -> None:
    """Fit the template again, with the joints where they were placed by hand, as one step."""
    fit, actor, why = template_fit(state), edited(state), no_refit(state)
    if why or fit is None or actor is None:
        state.say_status(f"Edit skeleton: {why}")
        return
    figure, skeleton = actor.figure, actor.figure.require_skeleton()
    known = frozenset(fit.template.figure.require_skeleton().names)
    placed = state.of(JointEditing).placed[skeleton] & known
    places, first = _places(figure), _places(fit.figure)
    mesh = rest_mesh(figure)

    def act() -> Callable[[AppState], None]:
        found = fit_again(fit.template, mesh, places, placed)

        def finish(state: AppState) -> None:
            if edited(state) is not actor:
                state.say("Not fitted: Edit skeleton was turned off meanwhile")
                return
            if actor.figure.skeleton is not skeleton:
                state.say("Not fitted: the joints were edited meanwhile")
                return
            known = found | {name: places[name] for name in placed}
            new = _followed(skeleton, places, _with_limbs(skeleton, known, first, placed))
            commit(state, moved(figure, dict(enumerate(new))), "fit the other joints")

        return finish

    begin_work(state, "Fitting the template", act, target=actor)


def _places(figure: Figure) -> dict[str, Floats]:
    """Return the places (3,) of the joints at rest by name, in figure space."""
    names = figure.require_skeleton().names
    return dict(zip(names, rest_worlds(figure)[:, :3, 3], strict=True))


def _with_limbs(
    skeleton: Skeleton,
    places: Mapping[str, Floats],
    first: Mapping[str, Floats],
    placed: Collection[str],
) -> dict[str, Floats]:
    """Return places (3,) by name, with limbs whose ends were placed bent as in the first fit."""
    names, meanings, new = skeleton.names, joint_meanings(skeleton), dict(places)
    for limb in LIMBS:
        if not set(limb) <= set(meanings):
            continue
        joints = [meanings.index(joint) for joint in limb]
        upper, middle, end = (names[joint] for joint in joints)
        if end not in placed or not {upper, middle, end} <= first.keys():
            continue
        # The fit reaches a wrist by rotating the whole arm and hand, which says little about elbow
        # and fingers.
        if middle not in placed:
            new[middle] = _bent([first[upper], first[middle], first[end]], new[upper], new[end])
        for joint in np.flatnonzero(descendants(skeleton.parents, joints[-1])).tolist():
            name = names[joint]
            if name in first and name not in placed:
                new[name] = new[end] + first[name] - first[end]
    return new


def _followed(
    skeleton: Skeleton, places: Mapping[str, Floats], known: Mapping[str, Floats]
) -> Floats:
    """Return new places (J, 3): the known ones; all other joints move with those above them."""
    new = np.zeros((skeleton.n_joints, 3))
    for joint, name in enumerate(skeleton.names):
        above = int(skeleton.parents[joint])
        along = new[above] - places[skeleton.names[above]] if above >= 0 else 0.0
        new[joint] = known.get(name, places[name] + along)
    return new


def _bent(limb: list[Floats], new_upper: Floats, new_end: Floats) -> Floats:
    """Return the middle joint (3,) of a limb of three joints, rotated and scaled to other ends."""
    upper, middle, end = limb
    before, after = end - upper, new_end - new_upper
    length = float(np.linalg.norm(before))
    scale = float(np.linalg.norm(after)) / length if length > 0.0 else 1.0
    return new_upper + scale * quaternion_to_matrix(between(before, after)) @ (middle - upper)
