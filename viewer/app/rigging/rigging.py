"""State of the Rig panel: target, template and results; the choice of target and template."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, replace
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np

from viewer.app.core.jobs import ThreadJob
from viewer.app.core.state import AppState
from viewer.app.core.widgets import key_name
from viewer.autorig.alignment.orientation_search import AXES
from viewer.autorig.alignment.posed_alignment import FACING
from viewer.autorig.alignment.similarity import Similarity
from viewer.autorig.alignment.surface_alignment import Alignment, AlignmentSettings, TemplateScale
from viewer.autorig.correspondence import MAX_ANGLE
from viewer.autorig.decomposition import MOST_BONES, DecompositionSettings
from viewer.autorig.rigged import Rigged
from viewer.autorig.settings import (
    BINDING,
    JOINTS,
    METHODS,
    SYMMETRIES,
    JointPlaces,
    SkeletonSettings,
    TransferMethod,
    TransferSettings,
)
from viewer.data_classes import dataclass, setting
from viewer.diagnostics import Diagnostic
from viewer.errors import RigError
from viewer.formats import MESHES
from viewer.loading import bundled_body, bundled_files, load
from viewer.phrases import one_of, printable
from viewer.rendering.passes.ghost_pass import Ghost, GhostStyle
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.ray_hit import RayHit
from viewer.rigs.memo import Memo
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import Pose, pose_key
from viewer.rigs.scene import Actor, Motion, Scene
from viewer.rigs.skin import Skin
from viewer.rigs.skinning import posed_mesh

RigTool: TypeAlias = Literal["", "move", "rotate", "scale", "landmarks"]
TOOLS: dict[RigTool, tuple[str, str]] = {
    "": ("None", "the mouse orbits and selects as usual"),
    "move": ("Move", "drag the template by its arrows and squares"),
    "rotate": ("Rotate", "rotate the template with its rings"),
    "scale": ("Scale", "drag the ring outwards or inwards to scale the template uniformly"),
    "landmarks": ("Landmarks", "click a point of the template, then the same point of the target"),
}
"""Tools to align the template with the target by hand: label and tooltip."""
GHOSTS: dict[Literal[""] | GhostStyle, str] = {
    "": "hidden",
    "translucent": "translucent",
    "wireframe": "wireframe",
    "solid": "solid",
}
"""Styles in which the template is drawn, with their labels."""
_BUNDLED = {"body": "Bundled body", "fox": "Bundled fox"}
_FILE = "file"
SHAPE = "shape"
"""Key of the template that is a skeleton found in the target's shape."""
_USUAL, _FOUND = TransferSettings(), SkeletonSettings()
_OF_MOTION = DecompositionSettings()
_AXES = {"": "automatic", **{axis: axis for axis in AXES}}
_SCALES: dict[TemplateScale, str] = {"uniform": "uniform", "axes": "one per axis", "none": "none"}
_posed: Memo[Skin, Mesh] = Memo()


@dataclass(frozen=True, slots=True, eq=False)
class Template:
    """A rigged figure whose rig is transferred, or a skeleton to which the target is bound."""

    key: str
    """Key in the list of templates."""
    figure: Figure
    """Figure with mesh, skeleton and skin, or with a skeleton only."""
    pose: Pose
    """Pose of the figure; for an actor of the scene, its current pose."""
    clip: Motion | None = None
    """Motion of the figure."""
    actor: Actor | None = None
    """Actor of the scene; None if the template was read from files."""
    paths: tuple[Path, ...] = ()
    """The files of the template; empty for an actor."""
    lines: tuple[Diagnostic, ...] = ()
    """Messages about a skeleton that was found in the target's shape."""

    @property
    def methods(self) -> tuple[TransferMethod, ...]:
        """Methods that it can be used with."""
        return tuple(METHODS) if self.figure.is_attached else BINDING


@dataclass(frozen=True, slots=True, eq=False)
class Placing:
    """Placement of the posed template in the target's frame."""

    similarity: Similarity
    """Transform from template to target."""
    alignment: Alignment | None
    """Alignment with its errors; None until they have been measured."""
    settings: AlignmentSettings
    """Settings that reproduce the placement."""
    fitted: Template | None
    """The template with rotated joints and resized limbs; None if it fits unchanged."""
    lines: tuple[Diagnostic, ...]
    """Messages about the fit."""
    meshes: tuple[object, object]
    """Target mesh and template figure for which the placement is valid."""
    pose: tuple[object, ...]
    """Key of the template's pose for which the placement was found."""
    front: str = ""
    """The axis that the target faces; empty if front and back do not look alike."""
    other: Placing | None = None
    """The placement that faces the other way, if front and back look alike."""

    @property
    def asks(self) -> bool:
        """Whether a person still has to tell front and back."""
        return any(line.key == FACING for line in self.lines)

    @property
    def answered(self) -> Placing:
        """The same placement without that question."""
        return replace(self, lines=tuple(line for line in self.lines if line.key != FACING))


@dataclass(frozen=True, slots=True, eq=False)
class Landmark:
    """A pair of corresponding points on both surfaces."""

    template: RayHit
    target: RayHit


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """A target that was rigged."""

    method: TransferMethod
    """Method of the transfer."""
    rigged: Rigged
    """Result of the transfer."""
    actor: Actor
    """Actor that shows the rigged figure."""
    target: Actor
    """Actor whose mesh was rigged."""
    template: Template
    """Template whose rig was transferred."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """Differences between two results for one target."""

    weights: float
    """Mean over vertices of sum_j |w - w'|; 2 if no joint is common to both results at any
    vertex."""
    dominant: float
    """Fraction of vertices with the same dominant joint."""


@dataclass(slots=True, eq=False)
class Running:
    """A job in a thread, and the function that applies its result in the frame loop."""

    source: Scene
    target: Actor | None = None
    """Actor in whose mesh joints are found."""
    job: ThreadJob | None = None
    finish: Callable[[AppState], None] | None = None


@dataclass(slots=True)
class RigChoices:
    """Settings of the panel's controls."""

    up: str = setting("", choices=_AXES)
    facing: str = setting("", choices=_AXES)
    """Up and forward axes of the target; empty for those of its file and its feet."""
    scale: TemplateScale = setting(_USUAL.alignment.scale, choices=_SCALES)
    refines: bool = setting(_USUAL.alignment.refines)
    fits: bool = setting(_USUAL.fits)
    method: TransferMethod = setting(_USUAL.method, choices={name: name for name in METHODS})
    joints: JointPlaces = setting(_USUAL.joints, choices={name: name for name in JOINTS})
    max_distance: float = _USUAL.weights.match.max_distance
    max_angle: float = MAX_ANGLE
    """In degrees; the others are those of ``TransferSettings``."""
    smoothing: int = _USUAL.weights.smoothing_rounds
    max_influences: int = 0
    """Maximum number of influences per vertex; 0 for all."""
    correctives: bool = setting(_USUAL.correctives)
    symmetry: str = setting(_FOUND.symmetry, choices=SYMMETRIES)
    joint_spacing: float = setting(
        _FOUND.joint_spacing, limits=(0.1, 10.0), unit="%.2f", logarithmic=True
    )
    """Symmetry and distance of joints of a skeleton that is found in the target's shape."""
    bones: int = setting(_OF_MOTION.bones, limits=(0, MOST_BONES))
    tolerance: float = setting(
        _OF_MOTION.tolerance,
        limits=DecompositionSettings.__dataclass_fields__["tolerance"].metadata["limits"],
        unit="%.3f %%",
        logarithmic=True,
    )
    """Number of bones that are found in the motion of a mesh, 0 for as many as the tolerance needs;
    and the tolerance in percent of its size."""


@dataclass(slots=True)
class Rigging:
    """State of the Rig panel."""

    scene: Scene | None = None
    """Scene for which the state is valid."""
    target: Actor | None = None
    """Actor whose mesh is to be rigged."""
    template_key: str = ""
    """Chosen entry in the list of templates."""
    template: Template | None = None
    """Template that was read from files; the template of an actor is built on each use."""
    choices: RigChoices = field(default_factory=RigChoices)
    """Settings of the controls."""
    placing: Placing | None = None
    """Placement of the template; None until it has been aligned or moved."""
    ghost: Literal[""] | GhostStyle = "translucent"
    tool: RigTool = ""
    holds_mouse: bool = False
    """Whether the pointer is on a handle of the gizmo, or holds one."""
    scaling: tuple[float, float] | None = None
    """While the scaling ring is dragged: the pointer's distance from the centre and the template's
    scale at the start of the drag."""
    was_dragged: bool = False
    """Whether the gizmo has moved the template since its error was measured."""
    landmarks: list[Landmark] = field(default_factory=list)
    """Pairs of clicked points."""
    pending: RayHit | None = None
    """Point of the template whose counterpart on the target has not been clicked yet."""
    aside: Floats = field(default_factory=lambda: np.zeros(3))
    """Offset of the template from the target while landmarks are clicked: (3,)."""
    match_fraction: float | None = None
    """Fraction of matched vertices, as shown by the target's colours."""
    running: Running | None = None
    """Job that is running."""
    results: dict[str, Result] = field(default_factory=dict)
    """Latest result of each method, all for the same target."""
    comparison: Comparison | None = None
    """Comparison of the results of both methods."""
    accepted: list[Rigged] = field(default_factory=list)
    """Results that are probably wrong, but that the user keeps."""
    scrolls: int = 0
    """Number of frames in which the panel still scrolls to the result."""
    ghost_key: object = None
    ghost_figure: Figure | None = None
    """Key of the template's pose, and its mesh in that pose."""
    shown: Ghost | None = None
    """Template that is drawn over the scene; the same object as long as it looks the same."""

    def kept(self) -> object | None:
        """Return the template's placement, which is undone with the scene."""
        return self.placing

    def restore(self, kept: object | None) -> None:
        """Restore the template's placement."""
        self.placing = kept if isinstance(kept, Placing) else None


def targets(state: AppState) -> list[Actor]:
    """Return the actors of the scene whose mesh has no rig."""
    return [
        actor
        for actor in state.scene.actors
        if not actor.figure.is_rigged
        and actor.figure.mesh is not None
        and actor.figure.mesh.n_triangles > 0
    ]


def templates(state: AppState) -> list[Actor]:
    """Return the actors of the scene that are already rigged, or that are skeletons only."""
    made = {id(result.actor) for result in state.of(Rigging).results.values()}
    return [
        actor
        for actor in state.scene.actors
        if (actor.figure.is_rigged or _is_skeleton(actor.figure)) and id(actor) not in made
    ]


def _is_skeleton(figure: Figure) -> bool:
    return figure.mesh is None and figure.skeleton is not None and figure.points is None


def refresh(state: AppState) -> None:
    """Discard the state of another scene, and choose target and template; called in each frame."""
    view = state.of(Rigging)
    if view.scene is not state.scene:
        view = state.put(Rigging(scene=state.scene, choices=view.choices))
    state.history.feature = view
    found = targets(state)
    if view.target not in found:
        choose_target(state, found[0] if found else None)
    known = template_texts(state)
    if view.template_key not in known:
        choose_template(state, next(iter(known)))


def target_mesh(state: AppState) -> Mesh:
    """Return the mesh of the target, which must exist, in its current pose."""
    target = state.of(Rigging).target
    assert target is not None  # checked by the callers
    figure, pose = target.figure, target.own_pose
    if pose is None or figure.skin is None:
        return figure.require_mesh()
    # Placements are valid for one mesh, so the same pose must return the same object.
    key = id(figure.mesh), pose_key(pose)
    return _posed.get(figure.skin, key, lambda: posed_mesh(figure, pose))


def choose_target(state: AppState, target: Actor | None) -> None:
    """Choose the mesh to rig, and discard the placement and results of the previous one."""
    view = state.of(Rigging)
    if target is not view.target:
        view.target, view.placing, view.match_fraction = target, None, None
        view.landmarks, view.pending, view.tool = [], None, ""
        if target is not None:  # an undone run keeps its results, because it may be redone
            view.results, view.comparison = {}, None


def template_texts(state: AppState) -> dict[str, str]:
    """Return the entries of the list of templates: keys and labels."""
    texts = {_actor_key(actor): printable(actor.name, 60) for actor in templates(state)}
    texts |= _BUNDLED
    read = state.of(Rigging).template
    if read is not None and read.key == _FILE:
        texts[_FILE] = printable(read.paths[0].name, 60)
    return texts | {SHAPE: "From shape"}


def _actor_key(actor: Actor) -> str:
    return f"actor {id(actor)}"


def choose_template(state: AppState, key: str) -> None:
    """Choose a template, a key of ``template_texts``."""
    view = state.of(Rigging)
    if key != view.template_key:
        view.template_key, view.placing = key, None
        view.landmarks, view.pending, view.tool = [], None, ""


def current_template(state: AppState) -> Template | None:
    """Return the chosen template in its current pose; None if it has not been read yet."""
    view = state.of(Rigging)
    for actor in templates(state):
        if _actor_key(actor) == view.template_key and actor.own_pose is not None:
            return Template(view.template_key, actor.figure, actor.own_pose, actor.clip, actor)
    read = view.template
    return read if read is not None and read.key == view.template_key else None


def methods_now(state: AppState) -> tuple[TransferMethod, ...]:
    """Return the methods that can use the chosen template."""
    if state.of(Rigging).template_key == SHAPE:
        return BINDING
    template = current_template(state)
    return tuple(METHODS) if template is None else template.methods


def method_now(state: AppState) -> TransferMethod:
    """Return the chosen method, or the first one that can use the chosen template."""
    chosen, known = state.of(Rigging).choices.method, methods_now(state)
    return chosen if chosen in known else known[0]


def compared_methods(method: TransferMethod) -> tuple[TransferMethod, ...]:
    """Return the methods that are compared with a chosen one: those of the same kind."""
    return BINDING if method in BINDING else tuple(name for name in METHODS if name not in BINDING)


def no_placing(state: AppState) -> str:
    """Return the reason why the template cannot be aligned with the target."""
    template = current_template(state)
    if template is None or template.figure.is_attached:
        return ""
    return "a skeleton without a mesh is used where it is, or where it fits inside the target"


def template_files(key: str) -> tuple[Path, ...]:
    """Return the files of a bundled template."""
    return (bundled_body(),) if key == "body" else bundled_files()


def read_template(paths: tuple[Path, ...], key: str = _FILE) -> Template:
    """Read a template; ``ViewerError`` if a file cannot be read, or contains no rigged mesh."""
    scene = load(*paths)
    found = [actor for actor in scene.actors if actor.figure.is_attached]
    found = found or [actor for actor in scene.actors if _is_skeleton(actor.figure)]
    if not found:
        names = ", ".join(printable(path.name, 60) for path in paths)
        raise RigError(f"{names}: expected a rigged figure or a skeleton, found none")
    actor = found[0]
    return Template(key, actor.figure, actor.pose, actor.clip, None, paths)


def no_target(state: AppState) -> str:
    """Return the reason why there is nothing to rig."""
    if state.of(Rigging).target is not None:
        return ""
    return (
        "every mesh in the scene has a rig: change it with Edit skeleton, or add a mesh without "
        f"one, {one_of(MESHES)}"
    )


def is_intact(result: Result) -> bool:
    """Return whether an actor still shows a result: its rig may have been edited since."""
    return result.actor.figure is result.rigged.figure


def no_results(state: AppState) -> str:
    """Return the reason why there is no rigged mesh to show."""
    there = {id(actor) for actor in state.scene.actors}
    results = state.of(Rigging).results.values()
    if any(id(result.actor) in there and is_intact(result) for result in results):
        return ""
    if not all(map(is_intact, results)):
        return "the rig was edited: File > Export saves it"
    if results:
        return f"the rig was undone: {key_name(state, 'Ctrl+Shift+Z')} restores it"
    return "nothing is rigged yet: press Run"
