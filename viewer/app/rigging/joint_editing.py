"""Editing of joints in the view: placed, dragged, removed, mirrored; weights follow.

The edited actor shows a figure that every edit replaces: its mesh stays, its joints change
(``viewer/rigs/joint_edits.py``). A job then binds the mesh to the new joints, which takes a
fraction of a second: what depends on the mesh alone is kept (``viewer/autorig/binding.py``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, replace
from typing import TypeAlias
from weakref import WeakKeyDictionary, WeakSet

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.reasons import no_job_room
from viewer.app.core.saved_work import SavedWork
from viewer.app.core.state import AppState
from viewer.app.core.text_fields import text_field
from viewer.app.core.view_frame import Place, ViewFrame, view_frame
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
from viewer.app.posing import posing
from viewer.app.posing.gizmo import Pen, joint_at, text_box
from viewer.app.posing.joint_tree import select_joint
from viewer.app.posing.move_tool import dragged
from viewer.app.posing.posed_joint import posed_joint
from viewer.app.posing.posing import Posing
from viewer.app.rigging.placing import target_place
from viewer.app.rigging.rigging import (
    Rigging,
    Template,
    choose_target,
    target_mesh,
    targets,
)
from viewer.app.rigging.work import aligned_start, begin_work, fit_again
from viewer.app.view.hovering import Picking
from viewer.autorig.alignment.surface_alignment import AlignmentSettings
from viewer.autorig.anatomy import sagittal_plane
from viewer.autorig.binding import enclosed
from viewer.autorig.pipeline import transfer
from viewer.autorig.settings import BINDING, TransferSettings
from viewer.autorig.weights.weight_transfer import WeightSettings
from viewer.data_classes import dataclass, setting
from viewer.diagnostics import Diagnostic
from viewer.errors import ViewerError
from viewer.exporters._rigged_files import USUAL_INFLUENCES
from viewer.phrases import capitalized, counted, listed, printable
from viewer.progress import report
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.transform import apply_transform, translation_matrix
from viewer.rigs.geometry.vectors import axis_vector
from viewer.rigs.hierarchy import descendants
from viewer.rigs.inspection.front import guess_front
from viewer.rigs.joint_edits import (
    Plane,
    added,
    at_rest,
    free_name,
    is_central,
    mirrored,
    moved,
    no_edit,
    partners,
    prepared,
    removed,
    renamed,
    rest_worlds,
    with_below,
)
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.memo import Memo
from viewer.rigs.mesh import Mesh, bounding_box, box_size
from viewer.rigs.pose import Pose, placement_matrix, rest_pose
from viewer.rigs.retargeting.joint_names import other_side, sided_words
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.shape import shaped_skeleton
from viewer.rigs.skeleton import Skeleton, ball_skeleton, joint_label
from viewer.rigs.skin import Skin
from viewer.rigs.skinning import posed_mesh

_WEIGHTS: dict[str, str] = {
    "heat": "heat: bind again",
    "voxel": "voxel: bind again",
    "keep": "keep the weights",
}
_NOT_KEPT = "Not kept with other joints: {}"
_STILL = 2.0  # maximum movement of the pointer during a click, window coordinates
_LONGEST = 40  # maximum length of a name in messages
_HOT, _BONE, _DOT = (1.0, 0.92, 0.55, 1.0), (0.45, 0.90, 0.95, 0.9), (1.0, 1.0, 1.0, 0.9)
_LEFT, _RIGHT = imgui.MouseButton_.left, imgui.MouseButton_.right
_AS_WIDE = 0.9  # distance from the surface relative to the largest
_SAME = 1e-9  # distance of the mesh at rest from the bind pose that is rounding, of its size
_rest_meshes: Memo[Figure, Mesh] = Memo()
_planes: Memo[Mesh, Plane] = Memo()


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


_Start: TypeAlias = Callable[[], _Begun]
"""Computes the figure to edit, in a thread."""


@dataclass(slots=True)
class EditChoices:
    """Settings of the section."""

    weights: str = setting("heat", choices=_WEIGHTS)
    symmetric: bool = setting(False)


@dataclass(slots=True, eq=False)
class JointDrag:
    """A joint that is held."""

    joint: int
    figure: Figure
    """The figure before the drag."""
    skeleton: Skeleton
    """The joints that are shown; undo may replace them."""
    place: Place
    """Position of the pointer at the start, window coordinates."""
    held: frozenset[str] = frozenset()
    """Names of the joint and, in symmetric editing, of its counterpart."""
    places: dict[int, Floats] = field(default_factory=dict)
    """New places (3,) of joints, figure space."""
    bound: dict[int, Floats] = field(default_factory=dict)
    """Those of the shown joints, for which the mesh is bound."""
    has_moved: bool = False
    is_over: bool = False
    """Whether it was cancelled and only waits for the release of the button."""


@dataclass(slots=True)
class JointEditing:
    """State of the section "Edit skeleton" of the Rig panel."""

    scene: Scene | None = None
    """Scene for which the state is valid."""
    actor: Actor | None = None
    """Actor whose joints are edited, or were."""
    is_on: bool = False
    """Whether clicks and drags in the view edit joints."""
    start: str = ""
    """Chosen entry of the list of starts."""
    choices: EditChoices = field(default_factory=EditChoices)
    drag: JointDrag | None = None
    stale: WeakSet[Figure] = field(default_factory=WeakSet)
    """Figures made by edits whose weights do not fit their joints yet."""
    binding: Figure | None = None
    """The one that is being bound."""
    refused: Figure | None = None
    """The last one that could not be bound, or whose binding was cancelled."""
    problem: str = ""
    """The reason why."""
    name: tuple[object, str] = (None, "")
    """Name that is being typed, and the joint that gets it."""
    fit: tuple[Actor, Template] | None = None
    """The last actor that got a fitted template, and the template as it was before."""
    placed: WeakKeyDictionary[Skeleton, frozenset[str]] = field(default_factory=WeakKeyDictionary)
    """Names of the joints that were placed by hand, which another fit of the template keeps."""


# Conditions


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
        found["template"] = "template, fitted"
    if actor.figure.mesh is not None:
        found["root"] = "one joint"
    return found


def edited(state: AppState) -> Actor | None:
    """Return the actor whose joints clicks and drags edit; None if they do not."""
    editing = state.of(JointEditing)
    return editing.actor if editing.is_on else None


def no_joint(state: AppState) -> str:
    """Return the reason why no joint is edited."""
    if edited(state) is None:
        return "turn on Edit skeleton in the Rig panel first"
    return "" if state.selected_joint >= 0 else "select a joint"


# What the mesh alone determines


def rest_mesh(figure: Figure) -> Mesh:
    """Return the mesh at rest: the mesh itself if it was bound so."""
    mesh = figure.require_mesh()
    if not figure.is_attached:
        return mesh

    def make() -> Mesh:
        posed = posed_mesh(figure, figure_pose(figure))
        apart = np.abs(posed.positions - mesh.positions).max(initial=0.0)
        return mesh if apart <= _SAME * box_size(bounding_box(mesh.positions)) else posed

    return _rest_meshes.get(figure, None, make)


def _keep_rest_mesh(figure: Figure, mesh: Mesh) -> None:
    """Record the mesh at rest of an edited figure, which stays the same object."""
    _rest_meshes.get(figure, None, lambda: mesh)


def _plane_of(figure: Figure, mesh: Mesh) -> Plane:
    """Return the plane in which the solid of a mesh mirrors itself best."""

    def make() -> Plane:
        up = axis_vector(figure.up)
        normal, offset, _ = sagittal_plane(enclosed(mesh)[1], up)
        left = _left_of(figure, mesh)
        return Plane(normal, offset) if normal @ left >= 0.0 else Plane(-normal, -offset)

    return _planes.get(mesh, None, make)


def _left_of(figure: Figure, mesh: Mesh) -> Floats:
    """Return the direction (3,) to a figure's left, by the names of its joints or by its feet."""
    if figure.skeleton is not None:
        sides = np.array([side for side, _ in sided_words(figure.skeleton.names)])
        places = rest_worlds(figure)[:, :3, 3]
        if (sides == "left").any() and (sides == "right").any():
            apart = places[sides == "left"].mean(axis=0) - places[sides == "right"].mean(axis=0)
            if np.linalg.norm(apart) > 0.0:
                return np.asarray(apart)
    plain = Figure(figure.name, mesh, up=figure.up)
    front = guess_front(Scene([Actor(plain)]))
    left = np.cross(axis_vector(figure.up), axis_vector(front[1]))
    return left if front[0] == "+" else -left


# Start and end


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
        mesh = rest_mesh(begun.figure)
        report(90, 100, "", "Looking for the plane of symmetry")
        _plane_of(begun.figure, mesh)  # so that no click has to wait for it
        return lambda state: _enter(state, actor, begun)

    begin_work(state, "Finding joints", act)


def _own_joints(_state: AppState, actor: Actor) -> _Start:
    return lambda: _Begun(actor.figure)


def _fitted_template(state: AppState, actor: Actor) -> _Start:
    """Fit the template to the anatomy of the mesh, and take its joints."""
    choose_target(state, actor)
    mesh, place, name = target_mesh(state), target_place(actor), actor.figure.name
    how = _weight_settings(state)
    start = aligned_start(state)

    def act() -> _Begun:
        found = start()
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
        plane, solid = _plane_of(figure, mesh), enclosed(mesh)[1]
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
        state.say(_NOT_KEPT.format(listed(begun.lost, 8)))
    actor.clip, actor.animation, actor.drive, actor.springs = None, -1, None, None
    if figure is not actor.figure:
        state.of(SavedWork).edited.add(figure)
        state.history.name = "find joints"
    if begun.place is not None:
        actor.placement, actor.own_pose = begun.place, None
    if begun.template is not None:
        editing.fit = actor, begun.template
    _show(actor, figure)
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


def _show(actor: Actor, figure: Figure) -> None:
    """Give an actor another figure, at rest; it keeps its place and shape."""
    old, pose = actor.own_pose, figure_pose(figure)
    if old is not None:
        pose.figure_scale = old.figure_scale
        pose.figure_translation = old.figure_translation.copy()
        if len(old.shape_weights) <= figure.n_shapes:
            pose.shape_weights = old.shape_weights.copy()
    actor.figure, actor.pose = figure, pose


def stop_editing(state: AppState) -> bool:
    """Let the mouse select and orbit again; return whether it edited joints."""
    editing = state.of(JointEditing)
    was_on, editing.is_on, editing.drag = editing.is_on, False, None
    return was_on


# Edits


def _commit(
    state: AppState,
    figure: Figure,
    name: str,
    selected: int | None = None,
    held: frozenset[str] = frozenset(),
) -> None:
    """Show an edited figure as a step of the undo history with a name; see ``_put_joints``."""
    actor = edited(state)
    assert actor is not None  # checked by the callers
    _put_joints(state, actor, figure, held)
    if selected is not None:
        state.selected_joint = -1
        select_joint(state, selected)
    state.history.name = name
    state.say_status(capitalized(name))


def _put_joints(state: AppState, actor: Actor, figure: Figure, held: frozenset[str]) -> None:
    """Show an edited figure, and have its mesh bound unless its weights are kept.

    ``held``: names of the joints that were placed by hand.
    """
    editing, before = state.of(JointEditing), actor.figure.require_skeleton()
    figure, lost = prepared(figure)
    _keep_rest_mesh(figure, rest_mesh(actor.figure))
    if lost:
        state.say(_NOT_KEPT.format(listed(lost, 8)))
    _show(actor, figure)
    state.of(SavedWork).edited.add(figure)
    if editing.choices.weights != "keep":
        editing.stale.add(figure)
    skeleton = figure.require_skeleton()
    placed = editing.placed.get(before, frozenset()) | held
    editing.placed[skeleton] = placed & frozenset(skeleton.names)


def _label(figure: Figure, joint: int) -> str:
    return printable(joint_label(figure.require_skeleton(), joint), _LONGEST)


def _tried(state: AppState, edit: Callable[[Actor], None]) -> None:
    """Apply an edit to the edited actor; show the reason if it cannot be done."""
    actor, why = edited(state), no_joint(state)
    if actor is None or why:
        state.say_status(f"Edit skeleton: {why}")
        return
    try:
        edit(actor)
    except ViewerError as problem:
        state.say_status(str(problem))


def _symmetry(state: AppState, figure: Figure) -> Plane | None:
    """Return the mirror plane if both sides are edited together."""
    if not state.of(JointEditing).choices.symmetric:
        return None
    return _plane_of(figure, rest_mesh(figure))


def delete_joint(state: AppState) -> None:
    """Remove the selected joint of the edited skeleton; its children and weights go up."""
    if edited(state) is None:
        return  # the key also deletes keys of curves

    def edit(actor: Actor) -> None:
        figure, joint = actor.figure, state.selected_joint
        chosen, plane = {joint}, _symmetry(state, figure)
        if plane is not None:
            chosen |= {partners(figure, plane)[joint]} - {-1}
        above = int(figure.require_skeleton().parents[joint])
        above = next((one for one in (above, 0) if one >= 0 and one not in chosen), -1)
        left = removed(figure, chosen)
        names = " and ".join(_label(figure, one) for one in sorted(chosen))
        row = above - sum(one < above for one in chosen)
        _commit(state, left, f"remove joint {names}", max(row, 0))

    _tried(state, edit)


def mirror(state: AppState) -> None:
    """Mirror the selected chain while joints are edited, or else the pose."""
    if edited(state) is not state.actor:
        posing.mirror(state)
        return

    def edit(actor: Actor) -> None:
        figure, joint = actor.figure, state.selected_joint
        plane, skeleton = _plane_of(figure, rest_mesh(figure)), figure.require_skeleton()
        placed = state.of(JointEditing).placed.get(skeleton, frozenset())
        chain = np.flatnonzero(descendants(skeleton.parents, joint)).tolist()
        images = {other_side(skeleton.names[one]) for one in chain if skeleton.names[one] in placed}
        new, name = mirrored(figure, joint, plane), f"mirror joint {_label(figure, joint)}"
        _commit(state, new, name, held=frozenset(images))

    _tried(state, edit)


def fitted_template(state: AppState) -> Template | None:
    """Return the template that was fitted to the edited mesh, None if there is none."""
    fit = state.of(JointEditing).fit
    return fit[1] if fit is not None and fit[0] is edited(state) else None


def no_refit(state: AppState) -> str:
    """Return the reason why the template cannot be fitted to joints placed by hand."""
    template, actor = fitted_template(state), edited(state)
    if template is None or actor is None:
        return 'start from "template, fitted"'
    skeleton = actor.figure.require_skeleton()
    placed = state.of(JointEditing).placed.get(skeleton, frozenset())
    if not placed & frozenset(template.figure.require_skeleton().names):
        return "move a joint first"
    return no_job_room(state)


def refit(state: AppState) -> None:
    """Fit the template again, with the joints where they were placed by hand, as one step."""
    template, actor, why = fitted_template(state), edited(state), no_refit(state)
    if why or template is None or actor is None:
        state.say_status(f"Edit skeleton: {why}")
        return
    figure, skeleton = actor.figure, actor.figure.require_skeleton()
    known = frozenset(template.figure.require_skeleton().names)
    placed = state.of(JointEditing).placed[skeleton] & known
    places = dict(zip(skeleton.names, rest_worlds(figure)[:, :3, 3], strict=True))
    mesh = rest_mesh(figure)

    def act() -> Callable[[AppState], None]:
        found = fit_again(template, mesh, places, placed)

        def finish(state: AppState) -> None:
            if edited(state) is not actor or actor.figure.skeleton is not skeleton:
                state.say("Not fitted: the joints were edited meanwhile")
                return
            new = dict[int, Floats]()
            for joint, (name, above) in enumerate(
                zip(skeleton.names, skeleton.parents.tolist(), strict=True)
            ):
                place = places[name]
                # Joints that the template does not have move with those above them.
                along = new[above] - places[skeleton.names[above]] if above >= 0 else 0.0
                new[joint] = place if name in placed else found.get(name, place + along)
            _commit(state, moved(figure, new), "fit the other joints")

        return finish

    begin_work(state, "Fitting the template", act, target=actor)


def rename_joint(state: AppState, name: str) -> None:
    """Give the selected joint another name; in symmetric editing, its counterpart follows."""

    def edit(actor: Actor) -> None:
        figure, joint = actor.figure, state.selected_joint
        plane, old = _symmetry(state, figure), _label(figure, joint)
        other = -1 if plane is None else partners(figure, plane)[joint]
        new = renamed(figure, joint, name)
        if other >= 0 and other != joint and other_side(name):
            new = renamed(new, other, other_side(name))
        is_stale = figure in state.of(JointEditing).stale
        _commit(state, new, f"rename joint {old} to {printable(name, _LONGEST)}")
        if not is_stale:
            state.of(JointEditing).stale.discard(actor.figure)  # the weights are the same

    _tried(state, edit)


def _add_at(state: AppState, actor: Actor, place: Floats) -> None:
    """Add a joint at a place (3,) in figure space, below the selected one."""
    figure, parent = actor.figure, state.selected_joint
    plane = _symmetry(state, figure)
    if plane is None or is_central(figure, plane, place):
        if plane is not None:
            place = place - plane.distance(place) * plane.normal
        new = added(figure, parent, place)
    else:
        base = free_name(figure.require_skeleton().names)
        sides = ("left", "right") if plane.distance(place) > 0.0 else ("right", "left")
        other = partners(figure, plane)[parent]
        # The joint that is selected afterwards is the last.
        new = added(
            figure, other if other >= 0 else parent, plane.image(place), f"{base}_{sides[1]}"
        )
        new = added(new, parent, place, f"{base}_{sides[0]}")
    last = new.require_skeleton().n_joints - 1
    _commit(state, new, f"add joint {_label(new, last)} below {_label(figure, parent)}", last)


def _take_click(state: AppState, actor: Actor) -> None:
    """Use a click: it selects the joint there, or adds one in the middle of the solid."""
    picking = state.of(Picking)
    wanted = picking.wanted
    if wanted is None or wanted[2]:
        return
    picking.wanted = None
    x, y, _, _ = state.view_rect
    at = (wanted[0] + x, wanted[1] + y)
    joint = joint_at(state, at)
    if joint >= 0:
        select_joint(state, joint)
        return
    place = _middle_under(state, actor, view_frame(state), at)
    if place is None:
        state.say_status("Edit skeleton: click on the mesh to add a joint")
    elif state.selected_joint < 0:
        state.say_status("Edit skeleton: first select the joint above the new one")
    else:
        _tried(state, lambda actor: _add_at(state, actor, place))


def _middle_under(state: AppState, actor: Actor, frame: ViewFrame, at: Place) -> Floats | None:
    """Return the middle of the solid under a window position, in figure space."""
    origin, direction = frame.ray(at)
    back = _scene_place(actor)
    solid = enclosed(rest_mesh(actor.figure))[1]
    return solid.middle(apply_transform(back, origin[None])[0], back[:3, :3] @ direction)


def _figure_place(actor: Actor) -> Floats:
    """Return the matrix (4, 4) from figure space to the scene."""
    return np.asarray(actor.placement @ placement_matrix(actor.pose))


def _scene_place(actor: Actor) -> Floats:
    """Return the matrix (4, 4) from the scene to figure space."""
    return np.asarray(np.linalg.inv(_figure_place(actor)), dtype=np.float64)


# Drags


def hold_joint(state: AppState) -> bool:
    """Begin, continue or end a drag of a joint; return whether it uses the mouse."""
    editing, actor, io = state.of(JointEditing), edited(state), imgui.get_io()
    place = (io.mouse_pos.x, io.mouse_pos.y)
    if editing.drag is not None:
        _go_on(state, editing.drag, place)
        return True
    if actor is None or state.actor is not actor or io.want_capture_mouse or io.key_alt:
        return False
    if not imgui.is_mouse_clicked(_LEFT) or not imgui.is_mouse_pos_valid():
        return False
    joint = joint_at(state, place)
    if joint < 0:
        return False
    figure, plane = actor.figure, _symmetry(state, actor.figure)
    skeleton = figure.require_skeleton()
    other = -1 if plane is None else partners(figure, plane)[joint]
    held = frozenset(skeleton.names[one] for one in (joint, other) if one >= 0)
    editing.drag = JointDrag(joint, figure, skeleton, place, held)
    return True


def _go_on(state: AppState, drag: JointDrag, at: Place) -> None:
    """Move the held joint with the pointer; a release applies it, the right button cancels it."""
    editing, actor, io = state.of(JointEditing), edited(state), imgui.get_io()
    if imgui.is_mouse_clicked(_RIGHT):
        cancel_joint_drag(state)
    if actor is None or actor.figure.skeleton is not drag.skeleton:
        drag.is_over = True  # undone, or closed
    if drag.is_over or actor is None:
        editing.drag = drag if imgui.is_mouse_down(_LEFT) else None
        return
    drag.has_moved |= float(np.hypot(at[0] - drag.place[0], at[1] - drag.place[1])) > _STILL
    if drag.has_moved and imgui.is_mouse_pos_valid():
        drag.places = _dragged_places(state, actor, drag, at, io.key_shift, io.key_ctrl)
    if imgui.is_mouse_down(_LEFT):
        return
    editing.drag = None
    if state.selected_joint != drag.joint:
        select_joint(state, drag.joint)
    if drag.places:
        if not _is_bound_there(drag):
            _stop_binding(state)  # the last places count
            _tried(state, lambda actor: _show_dragged(state, actor, drag))
        name = f"move joint {_label(actor.figure, drag.joint)}"
        state.history.name = name
        state.say_status(capitalized(name))


def _is_bound_there(drag: JointDrag) -> bool:
    """Return whether the joints are shown where they are dragged to."""
    places, bound = drag.places, drag.bound
    is_same = places.keys() == bound.keys()
    return is_same and all(np.array_equal(places[one], bound[one]) for one in places)


def _show_dragged(state: AppState, actor: Actor, drag: JointDrag) -> None:
    """Show the joints where they are dragged to; the mesh is then bound to them."""
    # All others where they were, for the modifiers may have moved them meanwhile.
    places = dict(enumerate(rest_worlds(drag.figure)[:, :3, 3])) | drag.places
    _put_joints(state, actor, moved(actor.figure, places), drag.held)
    drag.skeleton, drag.bound = actor.figure.require_skeleton(), drag.places


def _stop_binding(state: AppState) -> None:
    """Cancel the job that binds the mesh, if there is one."""
    if state.of(JointEditing).binding is not None and state.job is not None:
        state.job.cancel()


def _dragged_places(
    state: AppState, actor: Actor, drag: JointDrag, at: Place, snaps: bool, alone: bool
) -> dict[int, Floats]:
    """Return the new places of the held joint and of those that move with it, figure space."""
    figure, frame = drag.figure, view_frame(state)
    matrix = _figure_place(actor)
    start = apply_transform(matrix, rest_worlds(figure)[drag.joint, :3, 3])
    wanted = dragged(start, drag.place, frame, at)
    place = apply_transform(_scene_place(actor), wanted)
    seen = frame.place(wanted)
    if snaps and seen is not None:
        middle = _middle_under(state, actor, frame, seen)
        place = place if middle is None else middle
    plane = _symmetry(state, figure)
    other = -1 if plane is None else partners(figure, plane)[drag.joint]
    if plane is not None and other == drag.joint:
        place = place - plane.distance(place) * plane.normal
    places = {drag.joint: place} if alone else with_below(figure, drag.joint, place)
    if plane is not None and other >= 0 and other != drag.joint:
        image = plane.image(place)
        places |= {other: image} if alone else with_below(figure, other, image)
    return places


def cancel_joint_drag(state: AppState) -> bool:
    """Cancel a drag; return whether there was one."""
    drag, actor = state.of(JointEditing).drag, edited(state)
    if drag is None or drag.is_over:
        return False
    if drag.bound and actor is not None and actor.figure.skeleton is drag.skeleton:
        _stop_binding(state)
        _show(actor, drag.figure)
    drag.is_over, drag.places = True, {}
    state.say_status("Drag cancelled")
    return True


# Frames


def update_joints(state: AppState) -> None:
    """Take clicks, keep the edited figure at rest, and have it bound; called in each frame."""
    editing = state.of(JointEditing)
    if editing.scene is not state.scene:
        choices = editing.choices
        editing = state.put(JointEditing(scene=state.scene, choices=choices))
    actor = editing.actor
    if actor is None:
        return
    skeleton, pose = actor.figure.skeleton, actor.own_pose
    is_there = any(actor is one for one in state.scene.actors)
    if not is_there or skeleton is None or pose is None or not actor.figure.is_attached:
        stop_editing(state)  # undone
        return
    if state.actor is actor and state.selected_joint >= skeleton.n_joints:
        state.selected_joint = -1
    poses = state.of(Posing).is_on or state.actor is not actor or _is_posed(actor, pose)
    if editing.is_on and poses:
        stop_editing(state)
        state.say_status("Edit skeleton is off: it edits the chosen figure at rest")
    if editing.is_on:
        _take_click(state, actor)
    _bind(state, actor)


def _is_posed(actor: Actor, pose: Pose) -> bool:
    """Return whether an actor is not at rest, apart from its shape and place."""
    rest = rest_pose(actor.figure.require_skeleton())
    parts = ("dofs", "translations", "rotations", "scales")
    return any(not np.array_equal(getattr(pose, part), getattr(rest, part)) for part in parts)


def _weight_settings(state: AppState) -> WeightSettings:
    """Return the panel's settings for weights; by default, files can hold all influences."""
    choices = state.of(Rigging).choices
    return WeightSettings(
        smoothing_rounds=choices.smoothing,
        max_influences=choices.max_influences or USUAL_INFLUENCES,
    )


def _bind(state: AppState, actor: Actor) -> None:
    """Start a job that binds the mesh to its joints, if they were edited since."""
    editing, drag = state.of(JointEditing), state.of(JointEditing).drag
    if editing.binding is not None and state.of(Rigging).running is None:
        # The job has ended without a result.
        editing.refused, editing.binding = editing.binding, None
        editing.problem = "binding was cancelled"
    is_free = editing.choices.weights != "keep" and not no_job_room(state)
    if drag is not None and drag.places and is_free and not _is_bound_there(drag):
        _show_dragged(state, actor, drag)  # one binding at a time, for the newest places
    figure = actor.figure
    if figure not in editing.stale or figure is editing.refused or no_job_room(state):
        return
    method = next((name for name in BINDING if name == editing.choices.weights), None)
    if method is None:
        return
    mesh, skeleton = rest_mesh(figure), figure.require_skeleton()
    here = AlignmentSettings(matrix=np.eye(4))
    settings = TransferSettings(method, here, _weight_settings(state))
    name = printable(figure.name, _LONGEST)

    def act() -> Callable[[AppState], None]:
        report(0, 100, "", f"Binding {name}")
        bare = Figure(figure.name, skeleton=skeleton, up=figure.up, unit=figure.unit)
        try:
            rigged = transfer(bare, rest_pose(skeleton), mesh, settings, figure.name)
        except ViewerError as problem:
            text = str(problem)
            return lambda state: _refuse(state, figure, text)
        skin = rigged.figure.require_skin()
        lines = [line for line in rigged.lines if line.severity == "warning"]
        return lambda state: _put_weights(state, actor, figure, mesh, skin, lines)

    editing.binding = figure
    begin_work(state, f"Binding {name}", act)


def _refuse(state: AppState, figure: Figure, problem: str) -> None:
    """Say why a mesh could not be bound."""
    editing = state.of(JointEditing)
    editing.binding, editing.refused, editing.problem = None, figure, problem
    state.say_status(problem)


def _put_weights(
    state: AppState, actor: Actor, figure: Figure, mesh: Mesh, skin: Skin, lines: list[Diagnostic]
) -> None:
    """Give a figure its new weights; no undo step of its own."""
    editing = state.of(JointEditing)
    editing.binding = None
    if actor.figure is not figure:
        return  # edited or undone meanwhile: the present figure is bound next
    new = replace(figure, mesh=mesh, skin=skin)
    if mesh is not figure.mesh and figure.blend_shapes is not None:
        new = replace(new, blend_shapes=None)
        state.say("Not kept: blend shapes, as the mesh at rest differs from the bind pose")
    _keep_rest_mesh(new, mesh)
    state.of(SavedWork).edited.add(new)
    editing.problem = ""
    state.observe(busy=editing.drag is not None)
    state.history.exchange_figure(figure, new)
    actor.figure = new
    state.update_version()
    state.say(*lines)


# Drawing


def draw_joint_edits(state: AppState) -> None:
    """Draw the joints of the edited figure over the view, with the held ones where they will be."""
    editing, actor = state.of(JointEditing), edited(state)
    posed = None if actor is None or state.actor is not actor else posed_joint(actor, 0)
    if actor is None or posed is None:
        return
    places, skeleton, drag = posed.world[:, :3, 3].copy(), posed.skeleton, editing.drag
    if drag is not None:
        for joint, place in drag.places.items():
            places[joint] = apply_transform(posed.placement, place)
    pen, io = Pen(view_frame(state)), imgui.get_io()
    x, y, width, height = state.view_rect
    pen.list.push_clip_rect((x, y), (x + width, y + height), True)
    for joint, parent in enumerate(skeleton.parents.tolist()):
        if parent >= 0:
            is_held = drag is not None and bool({joint, parent} & drag.places.keys())
            pen.line(places[[parent, joint]], _HOT if is_held else _BONE, 1.5)
    for place in places:
        pen.dot(place, 4.0, (0.0, 0.0, 0.0, 0.6))
        pen.dot(place, 3.0, _DOT)
    if 0 <= state.selected_joint < len(places):
        pen.dot(places[state.selected_joint], 6.5, _HOT, filled=False)
    free = not io.want_capture_mouse and drag is None and imgui.is_mouse_pos_valid()
    under = joint_at(state, (io.mouse_pos.x, io.mouse_pos.y)) if free else -1
    named = drag.joint if drag is not None else under
    seen = pen.frame.place(places[named]) if named >= 0 else None
    if seen is not None:
        pen.dot(places[named], 7.5, _HOT, filled=False)
        at = (seen[0] + 12.0 * pen.scale, seen[1] - 8.0 * pen.scale)
        text_box(state, pen, at, [(_label(actor.figure, named), _DOT)])
    pen.list.pop_clip_rect()


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
        _bind_again(state)
    text = "edits apply to both sides; joints in the middle stay in the plane of symmetry"
    draw_setting(state, "Symmetric", editing.choices, "symmetric", text)
    _draw_joint(state, actor)
    if fitted_template(state) is not None:
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


def _bind_again(state: AppState) -> None:
    """Bind the edited figure as it is, by another method."""
    editing, actor = state.of(JointEditing), edited(state)
    if actor is not None:
        editing.refused = None
        _commit(state, actor.figure, f"bind by {editing.choices.weights}")
