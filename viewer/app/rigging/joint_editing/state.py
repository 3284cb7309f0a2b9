"""State of the editing of joints, and edits shown as steps of the undo history."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from weakref import WeakKeyDictionary, WeakSet

from viewer.app.core.saved_work import SavedWork
from viewer.app.core.state import AppState
from viewer.app.core.view_frame import Place
from viewer.app.posing.joint_tree import select_joint
from viewer.app.rigging.joint_editing.rest_meshes import keep_rest_mesh, plane_of, rest_mesh
from viewer.app.rigging.rigging import Template
from viewer.data_classes import dataclass, setting
from viewer.errors import ViewerError
from viewer.phrases import capitalized, listed, printable
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.joint_edits import Plane, prepared
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skeleton import Skeleton, joint_label

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
