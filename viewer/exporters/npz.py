"""Exporter for ``.npz`` files: posed figures, motions and points as named arrays.

::

    vertices (V, 3)   normals (V, 3)   triangles (T, 3)   uvs (U, 2)   uv_triangles (T, 3)
    joints (J, 3)     world (J, 4, 4)  joint_names (J,)   parents (J,)
    own_numbers (N,)  shape_weights (S,)   up   unit   name

For a motion of F frames: ``vertices`` (F, V, 3), ``joints`` (F, J, 3), ``world`` (F, J, 4, 4),
``rotations`` (F, J, 4) relative to the parents, in the order that ``quaternions`` states,
``"xyzw"`` or ``"wxyz"``; ``shape_weights`` (F, S) or (1, S), ``times`` (F,), ``frames`` (F,),
``present`` (F,), ``frame_rate``. Rows of missing frames are NaN. Another up axis rotates the whole
motion about x.
If gaps are held or interpolated, ``present`` is true for all frames.

For K captured points: ``points`` (K, 3) or (F, K, 3), NaN where they are not visible,
``confidences`` (K,) or (F, K), ``joint_names`` (K,), ``limbs`` (L, 2), ``sides`` (K,) -1 for right,
1 for left, ``layout``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase, note
from viewer.errors import RigError
from viewer.exporters._exporter import Selection
from viewer.exporters._gaps import kept_gaps
from viewer.exporters._left_out import (
    animation_parts,
    not_held_note,
    shape_parts,
    surface_parts,
)
from viewer.exporters._losses.pose_errors import PoseLosses
from viewer.exporters._options import QUATERNIONS, ExportOptions
from viewer.formats import Source, all_or_none, keeping_written, save_arrays
from viewer.formats._archive.opening import open_archive
from viewer.formats._archive.values import Archive
from viewer.phrases import all_of, counted, optional
from viewer.rigs.arrays import Arrays, Bools, Deferred, Floats
from viewer.rigs.captures.points import PointLayout
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import up_rotation
from viewer.rigs.motion.evaluation import pose_of, world_frames
from viewer.rigs.motion.sampled_animation import SampledAnimation, SampledPoints, rotated_frames
from viewer.rigs.posing.pose_vector import write_vector
from viewer.rigs.skinning import deform, joint_matrices


def export(selection: Selection, path: Path, options: ExportOptions) -> list[Diagnostic]:
    """Write float64 arrays in the figure's own space and unit; see ``viewer.exporters.export``."""
    if isinstance(selection.part.frames, SampledPoints):
        return _export_points(selection.part.frames, path, options)
    if selection.part.frames is not None:
        return _export_frames(selection.part.animation, path, options)
    actor, skinning = selection.part.actor, options.skinning
    figure, pose, mesh = actor.figure, actor.own_pose, actor.figure.mesh
    arrays = {
        "name": np.array(figure.name),
        "up": np.array(figure.up),
        "unit": np.array(figure.unit),
    }
    if mesh is not None:
        arrays["vertices"], arrays["normals"] = deform(figure, pose, skinning)
        arrays["triangles"] = mesh.triangles
        if mesh.uvs is not None:
            corners = mesh.triangles if mesh.uv_triangles is None else mesh.uv_triangles
            arrays["uvs"], arrays["uv_triangles"] = mesh.uvs, corners
    if figure.skeleton is not None and pose is not None:
        world = joint_matrices(figure, pose)
        arrays |= {
            "joints": world[:, :3, 3],
            "world": world,
            "joint_names": np.array(figure.skeleton.names),
            "parents": figure.skeleton.parents,
            "own_numbers": write_vector(figure.pose_layout, figure.skeleton, pose),
            "shape_weights": pose.shape_weights,
        }
    if figure.points is not None and actor.points is not None:
        confidences = actor.points[:, 3]
        places = np.where(confidences[:, None] > 0.0, actor.points[:, :3], np.nan)
        arrays |= _point_arrays(figure.points, places, confidences)
    with keeping_written() as saved, all_or_none([path]):
        save_arrays(path, arrays)
        again = open_archive(Source(path, saved[path]))
        losses = PoseLosses(figure, skinning)
        losses.look(pose, _read(again, "vertices"), _read(again, "joints"))
    notes = losses.notes(path)
    return [
        note("X001.arrays: arrays {names}", path, names=all_of([*arrays])),
        *notes,
        *not_held_note(".npz", [*_lost(figure), *animation_parts(figure)]),
    ]


def _lost(figure: Figure) -> list[Phrase]:
    """Return the parts of a figure that have no array."""
    lost = [Phrase("the skin")] if figure.skin is not None else []
    lost += shape_parts(figure)
    if figure.mesh is not None:
        lost += [Phrase("materials and textures")] if figure.mesh.materials else []
        lost += surface_parts(figure.mesh)
    return lost


def _export_frames(
    animation: SampledAnimation, path: Path, options: ExportOptions
) -> list[Diagnostic]:
    """Write float64 arrays of all frames; see ``viewer.exporters.export``."""
    figure = animation.figure
    _check(figure.unit, options)
    up = options.up or options.world_up
    if options.gaps == "split":
        raise RigError('gaps of arrays: expected hold or interpolate, found "split"')
    frames, filling = kept_gaps(animation.frames, options.gaps, animation.first_frame)
    skeleton = figure.require_skeleton()
    if up != options.world_up:
        frames = rotated_frames(figure, frames, up_rotation(options.world_up, up))
    world = world_frames(figure, frames)
    world[~frames.present] = np.nan
    order = [options.quaternions.index(part) for part in "xyzw"]
    rotations = np.empty_like(frames.rotations)
    rotations[..., order] = frames.rotations
    rotations[~frames.present] = np.nan
    arrays = {
        "name": np.array(animation.name),
        "up": np.array(up),
        "unit": np.array(figure.unit),
        "frame_rate": np.array(animation.frame_rate),
        "times": frames.times,
        "frames": animation.first_frame + np.arange(frames.n_frames),
        "present": frames.present,
        "joints": world[:, :, :3, 3],
        "world": world,
        "rotations": rotations,
        "quaternions": np.array(options.quaternions),
        "joint_names": np.array(skeleton.names),
        "parents": skeleton.parents,
        "shape_weights": frames.shape_weights,
    }
    if figure.mesh is not None:
        arrays["triangles"] = figure.mesh.triangles
        vertices = np.full((frames.n_frames, figure.mesh.n_vertices, 3), np.nan)
        for frame in np.flatnonzero(frames.present):
            pose = pose_of(figure, frames, int(frame))
            vertices[frame] = deform(figure, pose, options.skinning)[0]
        arrays["vertices"] = vertices
    with keeping_written() as saved, all_or_none([path]):
        save_arrays(path, arrays)
        errors = _motion_losses(animation, open_archive(Source(path, saved[path])), path, options)
    counts = _counts(frames.present, animation.frame_rate)
    sentence = "X001.motion-arrays: {n} at {rate:g} fps{missing}: {names}"
    written = note(sentence, path, **counts, names=all_of([*arrays]))
    return [written, *filling, *errors, *not_held_note(".npz", _lost(figure))]


def _motion_losses(
    animation: SampledAnimation, again: Archive, path: Path, options: ExportOptions
) -> list[Diagnostic]:
    """Return a note with the largest errors of a file that was read back, in its own frames."""
    figure, frames = animation.figure, animation.frames
    turned = up_rotation(options.world_up, options.up or options.world_up)
    vertices, joints = _read(again, "vertices"), _read(again, "joints")
    losses = PoseLosses(figure, options.skinning)
    for frame in np.flatnonzero(frames.present).tolist():
        own = None if vertices is None else vertices[frame] @ turned
        places = None if joints is None else joints[frame] @ turned
        losses.look(pose_of(figure, frames, frame), own, places, frame=frame)
    return losses.notes(path, animation.first_frame)


def _read(archive: Archive, key: str) -> Floats | None:
    """Return an array that was read back; None if the file does not have it."""
    if key not in archive.keys:
        return None
    values = archive.get(key)
    assert isinstance(values, Deferred)  # every value of the file is an array
    return np.asarray(values.values(), dtype=np.float64)


def _export_points(
    animation: SampledPoints, path: Path, options: ExportOptions
) -> list[Diagnostic]:
    """Write captured points of all frames as float64 arrays, with their up axis."""
    _check("", options)
    up = options.up or options.world_up
    points = animation.points @ up_rotation(options.world_up, up).T
    arrays: Arrays = {
        "name": np.array(animation.name),
        "up": np.array(up),
        "frame_rate": np.array(animation.frame_rate),
        "times": animation.times,
        "frames": animation.first_frame + np.arange(len(animation.times)),
        "present": animation.present,
    }
    arrays |= _point_arrays(animation.layout, points, animation.confidences)
    save_arrays(path, arrays)
    return [
        note(
            "X001.point-arrays: {n} at {rate:g} fps{missing}, {up} up: {names}",
            path,
            **_counts(animation.present, animation.frame_rate),
            up=up,
            names=all_of([*arrays]),
        )
    ]


def _check(unit: str, options: ExportOptions) -> None:
    """Raise RigError if another unit, or an unknown axis or order, is requested."""
    if options.unit not in ("", unit):
        raise RigError(
            f'unit of arrays: expected {unit or "none"}, as in the scene, found "{options.unit}"'
        )
    if options.up not in ("", "y", "z"):
        raise RigError(f'up axis of arrays: expected y or z, found "{options.up}"')
    if options.quaternions not in QUATERNIONS:
        known = " or ".join(QUATERNIONS)
        raise RigError(f'quaternions: expected {known}, found "{options.quaternions}"')


def _point_arrays(layout: PointLayout, places: Floats, confidences: Floats) -> Arrays:
    return {
        "points": places,
        "confidences": confidences,
        "joint_names": np.array(layout.names),
        "limbs": layout.limbs,
        "sides": layout.sides,
        "layout": np.array(layout.title),
    }


def _counts(present: Bools, rate: float) -> dict[str, object]:
    missing = int((~present).sum())
    return {
        "n": counted(len(present), "frame"),
        "rate": rate,
        "missing": optional("; {} of them missing, NaN", missing),
    }
