"""Actions on a whole pose: copy, paste, save, mirror, random shape."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.saved_work import SavedPose
from viewer.app.core.state import AppState
from viewer.app.files.file_choice import FileDialog, folder_of
from viewer.app.files.saving import save_files, save_in_background
from viewer.app.files.state import Files
from viewer.app.posing.clip_pause import pause_for_edit
from viewer.app.posing.state import Posing
from viewer.errors import ViewerError
from viewer.export import export, files_written
from viewer.export.pose import export as export_pose
from viewer.formats import FORMATS, Source, file_stem
from viewer.rig.figure import Figure
from viewer.rig.motion.upright import upright_actor
from viewer.rig.pose import Pose, pose_key
from viewer.rig.posing.pose_record import PoseRecord, record_of
from viewer.rig.posing.pose_vector import write_vector
from viewer.rig.retargeting.mirror import mirror_pose
from viewer.rig.scene import Actor, figure_pose

__all__ = [
    "ask_for_pose",
    "copy_numbers",
    "copy_pose",
    "mirror",
    "paste_pose",
    "pose_of_file",
    "random_shape",
    "reset_actor",
    "reset_joint",
    "reset_pose",
    "reset_shape",
    "save_export",
    "save_pose",
]

_RANDOM = 10  # number of random coefficients: the first have the largest variance


def _record(state: AppState) -> PoseRecord | None:
    actor = state.actor
    return (
        None
        if actor.pose is None
        else record_of(actor.figure, actor.pose, actor.shape_space.gender)
    )


def copy_pose(state: AppState) -> None:
    """Copy the chosen actor's pose to the clipboard as JSON."""
    from viewer.formats.pose import pose_text

    record = _record(state)
    if record is not None:
        imgui.set_clipboard_text(pose_text(record))
        state.say_status("Pose copied as JSON")


def copy_numbers(state: AppState) -> None:
    """Copy the pose to the clipboard as the model's raw pose vector."""
    actor = state.actor
    if actor.pose is None or actor.figure.skeleton is None:
        return
    numbers = write_vector(actor.figure.pose_layout, actor.figure.skeleton, actor.pose)
    imgui.set_clipboard_text(" ".join(f"{number!r}" for number in numbers.tolist()))
    state.say_status(f"Pose copied as {len(numbers)} numbers")


def paste_pose(state: AppState) -> None:
    """Pose the chosen actor from the clipboard: JSON, or the model's raw pose vector.

    A pose copied from a figure with different DOFs is transferred joint by joint: JSON contains the
    joint rotations.
    """
    from viewer.formats import pose
    from viewer.loading.additions import apply_pose

    actor = state.actor
    if actor.pose is None:
        return
    text = imgui.get_clipboard_text() or ""
    try:
        # Numbers may be separated by commas, as in the list syntax of programming languages.
        cleaned = text if "{" in text else re.sub(r"[\[\],;]", " ", text)
        source = Source("clipboard", cleaned.encode("utf-8", "replace"))
        if not text.strip():
            raise source.fault("F002.pose-clipboard")
        record = pose.read(source)
        notes = apply_pose(source.path, record, actor, drop_excess=False)
    except ViewerError as problem:
        state.error = str(problem)
        return
    state.say(*source.diagnostics.warnings, *notes)
    state.say_status("Pose pasted")
    pause_for_edit(state)


def ask_for_pose(state: AppState) -> None:
    """Ask where to save the chosen actor's pose."""
    name = f"{file_stem(state.actor.name)}_pose.json"
    suffixes = FORMATS["pose"].suffixes
    state.of(Files).dialog = FileDialog(
        folder_of(state.paths),
        lambda state, paths: save_pose(state, paths[0]),
        "save",
        "Save pose: .json, .npz or .txt",
        suffixes,
        name,
    )


def save_pose(state: AppState, path: Path) -> None:
    """Write the chosen actor's pose; the suffix selects the format, and losses are shown."""
    actor, skinning = state.actor, state.options.skinning

    def act() -> None:
        state.say(*export_pose(actor, path, skinning)[1:])

    if actor.pose is not None:
        save_files(state, act, [path], _saved(actor))


def save_export(state: AppState, path: Path) -> None:
    """Write the chosen actor in its current pose for other programs, in the background."""
    try:
        files = files_written(path)
    except ViewerError as problem:
        state.error = str(problem)
        return
    # Edits made during the export must not change the written pose.
    actor = upright_actor(state.scene, state.actor).copy()
    skinning = replace(state.options.skinning)
    act, saved = lambda: export(actor, path, skinning), _saved(state.actor)
    save_in_background(state, act, files, saved=saved)


def _saved(actor: Actor) -> SavedPose | None:
    """Return the present pose of an actor, to record that a file contains it."""
    return None if actor.pose is None else SavedPose(actor, pose_key(actor.pose))


def mirror(state: AppState) -> None:
    """Swap left and right in the chosen actor's pose."""
    actor = state.actor
    if actor.pose is None:
        return
    try:
        actor.pose = mirror_pose(actor.figure, actor.pose)
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
    if actor.figure.skeleton is None or actor.pose is None:
        return False
    actor.pose = pose_of_file(actor.figure, actor.pose)
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
    pose, skeleton = state.actor.pose, state.actor.figure.skeleton
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
    if shapes is None or actor.pose is None:
        return
    weights = actor.pose.shape_weights.copy()
    rows = [row for row, group in enumerate(shapes.groups) if group == "shape"]
    chosen = rows[:_RANDOM]
    weights[rows] = 0.0
    generator = np.random.default_rng(posing.shape_seed)
    if shapes.ranges is None:
        weights[chosen] = generator.standard_normal(len(chosen))
    else:
        low, high = shapes.ranges[chosen].T
        weights[chosen] = generator.uniform(low, high) - [shapes.origin(row) for row in chosen]
    actor.pose.shape_weights = weights
    state.say_status(f"Random shape, seed {posing.shape_seed}")


def reset_shape(state: AppState) -> None:
    """Reset every shape coefficient of the chosen actor to the file's value."""
    actor = state.actor
    if actor.pose is not None:
        actor.pose.shape_weights = figure_pose(actor.figure).shape_weights
        state.say_status("Shape reset")
