"""State of the editing of joints, its steps of the undo history, and the edited mesh at rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from weakref import WeakKeyDictionary, WeakSet

import numpy as np

from viewer.app.core.saved_work import SavedWork
from viewer.app.core.state import AppState
from viewer.app.core.view_frame import Place, ViewFrame
from viewer.app.posing.joint_tree import select_joint
from viewer.app.rigging.rigging import Template
from viewer.autorig.anatomy import sagittal_plane
from viewer.autorig.binding import enclosed
from viewer.data_classes import dataclass, setting
from viewer.errors import ViewerError
from viewer.phrases import capitalized, listed, printable
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.geometry.vectors import axis_vector
from viewer.rigs.inspection.front import guess_front
from viewer.rigs.joint_edits import Plane, prepared, rest_worlds
from viewer.rigs.memo import Memo
from viewer.rigs.mesh import Mesh, bounding_box, box_size
from viewer.rigs.pose import placement_matrix
from viewer.rigs.retargeting.joint_names import sided_words
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skeleton import Skeleton, joint_label
from viewer.rigs.skinning import posed_mesh

_WEIGHTS: dict[str, str] = {
    "heat": "heat: bind again",
    "voxel": "voxel: bind again",
    "keep": "keep the weights",
}
NOT_KEPT = "Not kept with other joints: {}"
LONGEST = 40  # maximum length of a name in messages


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


@dataclass(frozen=True, slots=True, eq=False)
class TemplateFit:
    """A template that was fitted to the mesh of an actor."""

    actor: Actor
    template: Template
    """As it was before."""
    figure: Figure
    """The figure that the actor got."""


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
    fit: TemplateFit | None = None
    """The last fit of a template."""
    placed: WeakKeyDictionary[Skeleton, frozenset[str]] = field(default_factory=WeakKeyDictionary)
    """Names of the joints that were placed by hand, which another fit of the template keeps."""


def edited(state: AppState) -> Actor | None:
    """Return the actor whose joints clicks and drags edit; None if they do not."""
    editing = state.of(JointEditing)
    return editing.actor if editing.is_on else None


def no_joint(state: AppState) -> str:
    """Return the reason why no joint is edited."""
    if edited(state) is None:
        return "turn on Edit skeleton in the Rig panel first"
    return "" if state.selected_joint >= 0 else "select a joint"


def stop_editing(state: AppState) -> bool:
    """Let the mouse select and orbit again; return whether it edited joints."""
    editing = state.of(JointEditing)
    was_on, editing.is_on, editing.drag = editing.is_on, False, None
    return was_on


def symmetry(state: AppState, figure: Figure) -> Plane | None:
    """Return the mirror plane if both sides are edited together."""
    if not state.of(JointEditing).choices.symmetric:
        return None
    return plane_of(figure, rest_mesh(figure))


def label(figure: Figure, joint: int) -> str:
    """Return the name of a joint for messages."""
    return printable(joint_label(figure.require_skeleton(), joint), LONGEST)


def tried(state: AppState, edit: Callable[[Actor], None]) -> None:
    """Apply an edit to the edited actor; show the reason if it cannot be done."""
    actor, why = edited(state), no_joint(state)
    if actor is None or why:
        state.say_status(f"Edit skeleton: {why}")
        return
    try:
        edit(actor)
    except ViewerError as problem:
        state.say_status(str(problem))


def commit(
    state: AppState,
    figure: Figure,
    name: str,
    selected: int | None = None,
    held: frozenset[str] = frozenset(),
) -> None:
    """Show an edited figure as a step of the undo history with a name; see ``put_joints``."""
    actor = edited(state)
    assert actor is not None  # checked by the callers
    put_joints(state, actor, figure, held)
    if selected is not None:
        state.selected_joint = -1
        select_joint(state, selected)
    state.history.name = name
    state.say_status(capitalized(name))


def put_joints(state: AppState, actor: Actor, figure: Figure, held: frozenset[str]) -> None:
    """Show an edited figure, and have its mesh bound unless its weights are kept.

    ``held``: names of the joints that were placed by hand.
    """
    editing, before = state.of(JointEditing), actor.figure.require_skeleton()
    figure, lost = prepared(figure)
    keep_rest_mesh(figure, rest_mesh(actor.figure))
    if lost:
        state.say(NOT_KEPT.format(listed(lost, 8)))
    show(actor, figure)
    state.of(SavedWork).edited.add(figure)
    if editing.choices.weights != "keep":
        editing.stale.add(figure)
    skeleton = figure.require_skeleton()
    placed = editing.placed.get(before, frozenset()) | held
    editing.placed[skeleton] = placed & frozenset(skeleton.names)


def show(actor: Actor, figure: Figure) -> None:
    """Give an actor another figure, at rest; it keeps its place and shape."""
    old, pose = actor.own_pose, figure_pose(figure)
    if old is not None:
        pose.figure_scale = old.figure_scale
        pose.figure_translation = old.figure_translation.copy()
        if len(old.shape_weights) <= figure.n_shapes:
            pose.shape_weights = old.shape_weights.copy()
    actor.figure, actor.pose = figure, pose


_SAME = 1e-9  # distance of the mesh at rest from the bind pose that is rounding, of its size
_rest_meshes: Memo[Figure, Mesh] = Memo()
_planes: Memo[Mesh, Plane] = Memo()


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


def keep_rest_mesh(figure: Figure, mesh: Mesh) -> None:
    """Record the mesh at rest of an edited figure, which stays the same object."""
    _rest_meshes.get(figure, None, lambda: mesh)


def plane_of(figure: Figure, mesh: Mesh) -> Plane:
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


def figure_place(actor: Actor) -> Floats:
    """Return the matrix (4, 4) from figure space to the scene."""
    return np.asarray(actor.placement @ placement_matrix(actor.pose))


def scene_place(actor: Actor) -> Floats:
    """Return the matrix (4, 4) from the scene to figure space."""
    return np.asarray(np.linalg.inv(figure_place(actor)), dtype=np.float64)


def middle_under(state: AppState, actor: Actor, frame: ViewFrame, at: Place) -> Floats | None:
    """Return the middle of the solid under a window position, in figure space."""
    origin, direction = frame.ray(at)
    back = scene_place(actor)
    solid = enclosed(rest_mesh(actor.figure))[1]
    return solid.middle(apply_transform(back, origin[None])[0], back[:3, :3] @ direction)
