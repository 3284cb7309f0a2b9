"""Start of the editing of joints: with those of the figure, a fitted template, or one joint."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from viewer.app.core.reasons import no_job_room
from viewer.app.core.saved_work import SavedWork
from viewer.app.core.state import AppState
from viewer.app.posing.joint_tree import select_joint
from viewer.app.posing.posing import Posing
from viewer.app.rigging.joint_editing.binding import weight_settings
from viewer.app.rigging.joint_editing.rest_meshes import plane_of, rest_mesh
from viewer.app.rigging.joint_editing.state import NOT_KEPT, JointEditing, TemplateFit, show
from viewer.app.rigging.placing import target_place
from viewer.app.rigging.rigging import (
    SHAPE,
    Rigging,
    Template,
    choose_target,
    target_mesh,
    targets,
)
from viewer.app.rigging.work import AlignedStart, aligned_start, begin_work, put_question
from viewer.autorig.alignment.surface_alignment import AlignmentSettings
from viewer.autorig.binding import enclosed
from viewer.autorig.pipeline import transfer
from viewer.autorig.settings import TransferSettings
from viewer.data_classes import dataclass
from viewer.phrases import counted, listed
from viewer.progress import report
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import apply_transform, translation_matrix
from viewer.rigs.joint_edits import at_rest, no_edit, prepared
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.pose import placement_matrix, rest_pose
from viewer.rigs.scene import Actor
from viewer.rigs.shape import shaped_skeleton
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skin import Skin

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
        rest = at_rest(rigged.figure.require_skeleton(), rigged.pose)
        figure = replace(rigged.figure, skeleton=rest, hands=(), pose_layout=None, fields=())
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
