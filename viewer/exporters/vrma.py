"""Exporter for humanoid motions, ``VRMC_vrm_animation`` 1.0 (``.vrma``).

The file has a node for each human bone in a T-pose, without rest rotations, in metres, y up, facing
+z. With the rotation W(f) of a joint in the world of the motion, its rotation T in the T-pose, and
the rotations A and B from the axes of the motion's world and of the figure to those of VRM, the
node has the world rotation A W(f) T^-1 B^-1. Lengths are the figure's; other characters scale the
path.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, note
from viewer.errors import RigError
from viewer.exporters._exporter import Selection
from viewer.exporters._gaps import filled, frames_phrase, gaps_note
from viewer.exporters._losses.largest_distances import Apart, Farthest, apart_notes, negligible
from viewer.exporters._options import ExportOptions
from viewer.exporters.gltf.document import Document, text_of
from viewer.exporters.gltf.keyed import AnimationParts
from viewer.exporters.vrm.canonical_pose import in_t_pose, standing, unit_rotation, vrm_axes
from viewer.exporters.vrm.humanoid import human_bones
from viewer.exporters.vrm.new_extension import PRESETS
from viewer.formats import Source, read, save_bytes
from viewer.phrases import agree, counted, file_size
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.file_record import Json
from viewer.rigs.geometry.quaternion import align_signs
from viewer.rigs.geometry.rotation import axis_rotations, matrix_to_quaternion
from viewer.rigs.humanoid import ancestors_of, parent_bone
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.motion.evaluation import Frames, frames_of, world_frames
from viewer.rigs.motion.sampled_animation import SampledAnimation
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.units import METRES

_EXTENSION = "VRMC_vrm_animation"


def export(selection: Selection, path: Path, options: ExportOptions) -> list[Diagnostic]:
    """Write the motion of a humanoid; see ``viewer.exporters.export``.

    Raises ``RigError`` if the figure lacks a required bone, no frame is present, or gaps are to be
    split. Raises ``OutputError`` if the file cannot be written.
    """
    animation = selection.part.animation
    if options.closing == "split":
        raise RigError("gaps of .vrma: expected hold or interpolate, found split")
    bones = human_bones(animation.figure)
    figure, frames = _unhidden(
        animation.figure, filled(animation.frames, options.closing == "interpolate")
    )
    animation = replace(animation, figure=figure)
    document = Document(animation.name)
    weights = _fill(document, animation, frames, options.world_up, bones)
    data = document.glb()
    errors = _losses(Source(path, data), animation, frames, options.world_up, bones)
    save_bytes(path, data)
    values = {
        "bones": counted(len(bones), "human bone"),
        "expressions": counted(sum(len(group) for group in weights.values()), "expression"),
        "frames": frames_phrase(animation.first_frame, frames.n_frames),
        "rate": animation.frame_rate,
        "size": file_size(len(data)),
    }
    notes = [
        note("X001.vrma: {bones}, {expressions}, {frames} at {rate:g} fps, {size}", path, **values),
        *errors,
    ]
    notes += gaps_note(animation.frames.present, animation.first_frame, options.closing)
    others = animation.figure.require_skeleton().n_joints - len(bones)
    if others:
        notes.append(
            note(
                "X003.vrma-joints: {n} without a human bone {are} omitted",
                n=counted(others, "joint"),
                are=agree(others, "is", "are"),
            )
        )
    return notes


def require(figure: Figure) -> None:
    """Raise RigError for a figure that lacks a required human bone."""
    human_bones(figure)


def _unhidden(figure: Figure, frames: Frames) -> tuple[Figure, Frames]:
    """Return joints without scales of 0, which hide them, so that they have world rotations."""
    skeleton = figure.require_skeleton()
    shown = replace(skeleton, rest_scales=_without_zeros(skeleton.rest_scales))
    sizes, scales = _without_zeros(frames.figure_scales), _without_zeros(frames.scales)
    return replace(figure, skeleton=shown), replace(frames, scales=scales, figure_scales=sizes)


def _without_zeros(scales: Floats) -> Floats:
    return np.where(scales == 0.0, 1.0, scales)


def _fill(
    document: Document,
    animation: SampledAnimation,
    frames: Frames,
    world_up: str,
    bones: dict[str, int],
) -> dict[str, Json]:
    """Add nodes, keys and the extension; return the expressions."""
    figure = animation.figure
    above = {bone: parent_bone(bone, bones) for bone in bones}
    order = sorted(bones, key=lambda bone: len(ancestors_of(bone)))
    # The bones are those of a T-pose in VRM's axes, on the ground.
    still, _ = in_t_pose(standing(figure, figure_pose(figure), bones), bones)
    world = world_matrices(still.require_skeleton(), figure_pose(still))
    places = {bone: world[joint, :3, 3] for bone, joint in bones.items()}
    rotations = {bone: unit_rotation(world[joint]) for bone, joint in bones.items()}
    nodes: dict[str, int] = {}
    for bone in order:
        start = places[above[bone]] if above[bone] else np.zeros(3)
        item = {"name": bone, "translation": (places[bone] - start).tolist()}
        nodes[bone] = document.add("nodes", item)
        if above[bone]:
            parent = document.root["nodes"][nodes[above[bone]]]
            parent.setdefault("children", []).append(nodes[bone])
    document.root["scene"] = document.add("scenes", {"nodes": [nodes["hips"]]})
    turns, hips = _moved(figure, frames, world_up, bones, rotations)
    seconds = np.arange(frames.n_frames) / animation.frame_rate
    keys, at = AnimationParts(), document.array(seconds, "SCALAR", bounds=True)
    for bone in order:
        local = turns[bone]
        if above[bone]:
            local = np.swapaxes(turns[above[bone]], -1, -2) @ local
        quaternions = matrix_to_quaternion(local)
        align_signs(quaternions)
        keys.add(nodes[bone], "rotation", at, document.array(quaternions, "VEC4"))
    keys.add(nodes["hips"], "translation", at, document.array(hips, "VEC3"))
    extension: Json = {
        "specVersion": "1.0",
        "humanoid": {"humanBones": {bone: {"node": nodes[bone]} for bone in order}},
    }
    weights = _add_expressions(document, keys, at, figure, frames)
    if weights:
        extension["expressions"] = weights
    keys.put(document, {"name": text_of(animation.motion.name or animation.name)})
    document.root["extensions"] = {_EXTENSION: extension}
    document.declare(_EXTENSION)
    return weights


def _moved(
    figure: Figure,
    frames: Frames,
    world_up: str,
    bones: dict[str, int],
    rotations: dict[str, Floats],
) -> tuple[dict[str, Floats], Floats]:
    """Return the world rotations of the nodes (F, 3, 3), and the positions of the hips (F, 3)."""
    axes = _axes(figure, world_up, bones)
    world = world_frames(figure, frames)
    turns = {}
    for bone, joint in bones.items():
        linear = world[:, joint, :3, :3]
        turned = linear / np.linalg.norm(linear, axis=1, keepdims=True)
        # The T-pose is in VRM's axes already: its rotation is B T.
        turns[bone] = axes @ turned @ rotations[bone].T
    scale = METRES.get(figure.unit, 1.0)
    return turns, scale * world[:, bones["hips"], :3, 3] @ axes.T


def _axes(figure: Figure, world_up: str, bones: dict[str, int]) -> Floats:
    """Return the rotation from the axes of the motion's world to those of VRM."""
    if world_up == figure.up:
        return vrm_axes(figure, figure_pose(figure), bones)
    return axis_rotations(0, np.asarray(-np.pi / 2 if world_up == "z" else 0.0))


def _losses(
    source: Source,
    animation: SampledAnimation,
    frames: Frames,
    world_up: str,
    bones: dict[str, int],
) -> list[Diagnostic]:
    """Read a file back, and return a note with the largest error of a human bone's position."""
    motion, figure = read(source), animation.figure
    assert isinstance(motion, SkeletonMotion)
    rate = motion.clip.timing.frame_rate
    again = frames_of(motion.figure, motion.clip, np.arange(frames.n_frames) / rate)
    found = world_frames(motion.figure, again)[..., :3, 3] / METRES.get(figure.unit, 1.0)
    found = found @ _axes(figure, world_up, bones)
    joints = [bones[name] for name in motion.figure.require_skeleton().names]
    there = np.flatnonzero(animation.frames.present)
    off = found[there] - world_frames(figure, frames)[there[:, None], joints, :3, 3]
    distances = np.linalg.norm(off, axis=2)
    row, bone = np.unravel_index(int(distances.argmax()), distances.shape)
    worst = Farthest(float(distances[row, bone]), joints[int(bone)], int(there[row]))
    is_exact = worst.distance <= negligible(figure, frames, there)
    apart = Apart(None if is_exact else worst, None, len(there), len(there))
    return apart_notes(source.path, figure, apart, animation.first_frame)


def _add_expressions(
    document: Document, keys: AnimationParts, at: int, figure: Figure, frames: Frames
) -> dict[str, Json]:
    """Add a node for each expression that is used; return the members of the extension."""
    shapes, weights = figure.blend_shapes, frames.shape_weights
    found: dict[str, Json] = {}
    rules = None if shapes is None else shapes.rules
    # Expressions of VRM 0.x have names of their own.
    pairs = () if rules is None else zip(rules.rows.tolist(), rules.presets, strict=False)
    presets = {row: preset for row, preset in pairs if preset}
    for row, name in enumerate(shapes.names if shapes is not None else ()):
        is_used = row < weights.shape[1] and weights[:, row].any()
        if shapes is None or not shapes.is_expression(row) or not is_used:
            continue
        node = document.add("nodes", {"name": text_of(name)})
        document.root["scenes"][0]["nodes"].append(node)
        places = np.zeros((frames.n_frames, 3))
        places[:, 0] = np.clip(weights[:, row], 0.0, 1.0)
        keys.add(node, "translation", at, document.array(places, "VEC3"))
        preset = presets.get(row, name)
        is_preset = preset in PRESETS and preset not in found.get("preset", {})
        kind, key = ("preset", preset) if is_preset else ("custom", text_of(name))
        found.setdefault(kind, {})[key] = {"node": node}
    return found
