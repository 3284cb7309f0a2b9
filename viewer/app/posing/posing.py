"""Posing: the state of the tools and of a drag, and actions on the pose and shape of an actor."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal, Protocol, TypeAlias

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.saved_work import SavedPose, SavedWork
from viewer.app.core.state import AppState, shows_errors
from viewer.app.core.view_frame import ViewFrame
from viewer.app.files.files import ask_where_to_write
from viewer.app.files.motion_export import (
    N_ROWS,
    Chosen,
    draw_pose_formats,
    figures,
    is_one_file,
    options_for,
    points_note,
    pose_formats,
    scene_now,
)
from viewer.app.files.saving import save_files, save_in_background
from viewer.app.posing.posed_joint import Orientation
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.errors import ViewerError
from viewer.exporters import ExportOptions, Part, Selection, export, files_written
from viewer.exporters.pose import export as export_pose
from viewer.formats import FORMATS, Source, file_stem
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.motion.upright import upright_actor
from viewer.rigs.pose import Pose, pose_key
from viewer.rigs.posing.pose_record import record_of
from viewer.rigs.posing.pose_vector import write_vector
from viewer.rigs.retargeting.mirror import mirror_pose
from viewer.rigs.scene import Actor

PoseTool: TypeAlias = Literal["select", "rotate", "move"]
TOOLS: dict[PoseTool, tuple[str, str, str]] = {
    "select": ("Select", "Q", "click selects, drag orbits"),
    "rotate": ("Rotate", "E", "rotate the selected joint with its rings"),
    "move": (
        "Move",
        "D",
        "drag a joint, and the joints above it follow (IK); drag the root to move the figure",
    ),
}
"""Tools: label of the button, key, tooltip."""
ORIENTATIONS: dict[Orientation, str] = {
    "local": "Local axes",
    "parent": "Parent axes",
    "world": "World axes",
}
"""Orientations of rings and arrows, for joints that can rotate about or move along all axes."""
_RIGS = (".glb", ".gltf", ".vrm", ".skel", ".skin")  # suffixes of files with joints and weights
_RANDOM = 10  # number of random coefficients: the first have the largest variance


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """Result of a drag."""

    pose: Pose
    """Pose within the joint limits."""
    text: str
    """Description of the change, shown next to the handle."""
    limited: tuple[int, ...] = ()
    """DOFs whose limits restrict the drag."""
    target: Floats | None = None
    """Position of the pointer in scene space, if the joint could not reach it: (3,)."""
    angle: float | None = None
    """Angle of rotation by a ring, radians."""
    is_settled: bool = True
    """Whether the pose stays while the pointer rests."""


class Handle(Protocol):
    """Interface of a handle in the view, which changes a pose while it is dragged."""

    joint: int
    start: Pose
    place: tuple[float, float]

    def follow(self, frame: ViewFrame, place: tuple[float, float], snaps: bool) -> Outcome:
        """Return the result for a position of the pointer; snapped angles are whole steps."""
        ...


@dataclass(slots=True, eq=False)
class Drag:
    """A drag in progress."""

    actor: Actor
    """Actor whose pose changes."""
    handle: Handle
    """The handle that is held."""
    outcome: Outcome
    """Latest result."""
    asked: tuple[object, ...] = ()
    """Key of the pointer's position, the modifier and the camera for which the result was
    computed."""
    has_moved: bool = False
    """Whether the pointer has moved; a click on a handle changes nothing."""
    is_over: bool = False
    """Whether the drag was cancelled and only waits for the release of the button."""

    @property
    def goes_on(self) -> bool:
        """Whether the pose changes although the pointer rests."""
        return not self.is_over and not self.outcome.is_settled


@dataclass(slots=True)
class HeldVector:
    """A joint's rotation vector as edited; beyond pi, the rotation does not determine it."""

    joint: int
    """Joint of the actor that was chosen at that time."""
    vector: Floats
    """The vector as edited: (3,)."""
    rotation: Floats
    """Rotation of the joint: (3, 3)."""
    n_choices: int
    """The state's ``n_choices``: for another actor the joint is invalid."""


@dataclass(slots=True)
class Posing:
    """State of the tools and panels for posing."""

    tool: PoseTool = "select"
    orientation: Orientation = "local"
    chain_length: int = 0
    """Number of joints above a dragged joint that may rotate; 0 for the default of two, excluding
    the root."""
    drag: Drag | None = None
    """The handle that is held."""
    has_missed: bool = False
    """Whether a press narrowly missed a handle and its button is still down."""
    as_vectors: bool = False
    """Whether ball joints are edited as rotation vectors instead of angles about x, y, z."""
    held_vector: HeldVector | None = None
    """The rotation vector being edited."""
    shape_filter: str = ""
    """Text that the names of listed shapes must contain, for figures with many shapes."""
    shape_seed: int = 0
    """Seed of the last random shape."""
    n_hand_components: int = 6
    """Number of principal components of the hands that have sliders."""

    @property
    def is_on(self) -> bool:
        """Whether a tool other than Select is chosen."""
        return self.tool != "select"


def pause_for_edit(state: AppState) -> None:
    """Pause a clip that would overwrite the chosen actor's pose in the next frame; say so."""
    clip, clock = state.actor.clip, state.clock
    if clip is None:
        return
    stopped = "Paused: the" if clock.playing else "The"
    clock.playing = False
    kept = "press Key to keep it" if clip.timing is None else "sampled motions cannot be keyed"
    state.say_status(f"{stopped} clip overwrites this pose when the time changes; {kept}")


def copy_pose(state: AppState) -> None:
    """Copy the chosen actor's pose to the clipboard as JSON."""
    from viewer.formats.pose import pose_text

    actor = state.actor
    if actor.own_pose is not None:
        record = record_of(actor.figure, actor.own_pose, actor.shape_space.gender)
        imgui.set_clipboard_text(pose_text(record))
        state.say_status("Pose copied as JSON")


def copy_numbers(state: AppState) -> None:
    """Copy the pose to the clipboard as the model's raw pose vector."""
    actor = state.actor
    if actor.own_pose is None or actor.figure.skeleton is None:
        return
    numbers = write_vector(actor.figure.pose_layout, actor.figure.skeleton, actor.own_pose)
    imgui.set_clipboard_text(" ".join(f"{number!r}" for number in numbers.tolist()))
    state.say_status(f"Pose copied as {len(numbers)} numbers")


@shows_errors
def paste_pose(state: AppState) -> None:
    """Pose the chosen actor from the clipboard: JSON, or the model's raw pose vector."""
    from viewer.formats import pose
    from viewer.loading.additions import apply_pose

    actor = state.actor
    if actor.own_pose is None:
        return
    text = imgui.get_clipboard_text() or ""
    # Numbers may be separated by commas, as in the list syntax of programming languages.
    cleaned = text if "{" in text else re.sub(r"[\[\],;]", " ", text)
    source = Source("clipboard", cleaned.encode("utf-8", "replace"))
    if not text.strip():
        raise source.fault("F002.pose-clipboard: expected a pose, found no text")
    # A pose copied from a figure with different DOFs is transferred joint by joint: JSON
    # contains the joint rotations.
    record = pose.read(source)
    notes = apply_pose(source.path, record, actor, drop_excess=False)
    state.say(*source.diagnostics.warnings, *notes)
    state.say_status("Pose pasted")
    pause_for_edit(state)


def ask_for_pose(state: AppState) -> None:
    """Ask where to save the chosen actor's pose."""
    name, title = f"{file_stem(state.actor.name)}_pose.json", "Save pose: .json, .npz or .txt"
    ask_where_to_write(state, save_pose, title, FORMATS["pose"].suffixes, name)


def save_pose(state: AppState, path: Path) -> None:
    """Write the chosen actor's pose; the suffix selects the format, and losses are shown."""
    actor, skinning = state.actor, state.options.skinning

    def act() -> None:
        options = ExportOptions(skinning=skinning)
        state.say(*export_pose(Selection([Part(actor)]), path, options)[1:])

    if actor.own_pose is not None:
        save_files(state, act, [path], _saved(actor))


def ask_for_export(state: AppState) -> None:
    """Ask where to export actors in their current poses, by default with an edited rig."""
    suffixes = tuple(pose_formats())
    suffix = ".glb" if state.actor.figure in state.of(SavedWork).edited else ".obj"
    chosen = Chosen()
    ask_where_to_write(
        state,
        lambda state, path: save_export(state, path, chosen.options, chosen.everyone),
        "Export",
        suffixes,
        f"{file_stem(state.actor.name)}{suffix}",
        more=lambda state, dialog: draw_pose_formats(state, dialog, chosen),
        more_rows=N_ROWS + (3.0 if len(figures(state.scene)) > 1 else 1.5),
        written=lambda path: files_written(path) if path.suffix.lower() in suffixes else [path],
    )


@shows_errors
def save_export(
    state: AppState, path: Path, options: ExportOptions | None = None, everyone: bool = False
) -> None:
    """Write the chosen actor in its current pose for other programs, in the background.

    Formats that hold several figures may contain ``everyone``, placed as in the scene.
    """
    files, how = files_written(path), options_for(state, path, options)
    actors, notes = [state.actor], list[Diagnostic]()
    # Edits made during the export must not change the written poses.
    if everyone and is_one_file(path):
        scene = scene_now(state)
        actors, notes = figures(state.scene), points_note(scene)
        selection: Actor | Selection = Selection([*map(Part, figures(scene))], scene)
    else:
        selection = upright_actor(state.scene, state.actor).copy()

    def act() -> list[Diagnostic]:
        return export(selection, path, options=how) + notes

    saved = [each for actor in actors for each in _saved(actor)]
    has_rig = path.suffix.lower() in _RIGS
    if has_rig:
        saved += [actor.figure for actor in actors]
    is_rig = has_rig and state.actor.figure in state.of(SavedWork).edited
    save_in_background(state, act, files, saved=saved, is_rig=is_rig)


def _saved(actor: Actor) -> list[object]:
    """Return the present pose of an actor, to record that a file contains it."""
    return [] if actor.own_pose is None else [SavedPose(actor, pose_key(actor.own_pose))]


def mirror(state: AppState) -> None:
    """Swap left and right in the chosen actor's pose."""
    actor = state.actor
    if actor.own_pose is None:
        return
    try:
        actor.pose = mirror_pose(actor.figure, actor.own_pose)
        state.say_status("Pose mirrored")
        pause_for_edit(state)
    except ViewerError as problem:
        state.say(str(problem))


def reset_pose(state: AppState) -> None:
    """Reset every actor to the pose of its file, morph targets included, but not its shape."""
    for actor in state.scene.actors:
        _reset(actor)
    state.say_status("Pose reset")


def reset_actor(state: AppState) -> None:
    """Reset the chosen actor to the file's pose, morph targets included; its shape is kept."""
    if _reset(state.actor):
        pause_for_edit(state)


def _reset(actor: Actor) -> bool:
    """Reset an actor to the pose of its file, and return whether it has one."""
    if actor.figure.skeleton is None or actor.own_pose is None:
        return False
    actor.pose = pose_of_file(actor.figure, actor.own_pose)
    return True


def pose_of_file(figure: Figure, old: Pose) -> Pose:
    """Return the pose of a figure's file with the shape of another pose."""
    pose = figure_pose(figure)
    groups = () if figure.blend_shapes is None else figure.blend_shapes.groups
    # Shape coefficients belong to the person, morph targets to the pose.
    is_kept = np.array([group != "morph" for group in groups[: len(old.shape_weights)]], bool)
    rows = np.flatnonzero(is_kept)
    pose.shape_weights[rows] = old.shape_weights[rows]
    return pose


def reset_joint(state: AppState, joint: int) -> None:
    """Reset one joint of the chosen actor to the file's pose."""
    pose, skeleton = state.actor.own_pose, state.actor.figure.skeleton
    if pose is not None and skeleton is not None:
        dofs = np.flatnonzero(skeleton.dof_joints == joint)
        pose.dofs[dofs] = skeleton.rest_dofs[dofs]
        pose.translations[joint] = 0.0
        pose.rotations[joint] = skeleton.rest_rotations[joint]
        pose.scales[joint] = skeleton.rest_scales[joint]
        pause_for_edit(state)


def random_shape(state: AppState) -> None:
    """Sample the first shape coefficients from a normal distribution, but not the expressions."""
    posing = state.of(Posing)
    actor = state.actor
    shapes = actor.figure.blend_shapes
    if shapes is None or actor.own_pose is None:
        return
    weights = actor.own_pose.shape_weights.copy()
    rows = [row for row, group in enumerate(shapes.groups) if group == "shape"]
    chosen = rows[:_RANDOM]
    weights[rows] = 0.0
    generator = np.random.default_rng(posing.shape_seed)
    if shapes.ranges is None:
        weights[chosen] = generator.standard_normal(len(chosen))
    else:
        low, high = shapes.ranges[chosen].T
        weights[chosen] = generator.uniform(low, high) - [shapes.origin(row) for row in chosen]
    actor.own_pose.shape_weights = weights
    state.say_status(f"Random shape, seed {posing.shape_seed}")


def reset_shape(state: AppState) -> None:
    """Reset every shape coefficient of the chosen actor to the file's value."""
    actor = state.actor
    if actor.own_pose is not None:
        actor.own_pose.shape_weights = figure_pose(actor.figure).shape_weights
        state.say_status("Shape reset")
