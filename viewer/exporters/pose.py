"""Exporter for poses, by joint names (``.json``) or as the model's pose vector (``.txt``)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase, note
from viewer.errors import RigError
from viewer.exporters._exporter import Selection
from viewer.exporters._left_out import not_held_note
from viewer.exporters._losses.pose_errors import PoseLosses
from viewer.exporters._options import ExportOptions
from viewer.formats import Source, all_or_none, keeping_written, write
from viewer.formats.pose import read
from viewer.phrases import counted
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import figure_pose
from viewer.rigs.pose import Pose, joint_rotations
from viewer.rigs.posing.pose_record import apply_record, record_of
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.skinning import deform, joint_matrices

_TURNED = 1e-6  # difference of rotation matrices, larger than the rounding of angles
_SAME = 1e-9  # difference of a number up to which it counts as stored


def export(selection: Selection, path: Path, options: ExportOptions) -> list[Diagnostic]:
    """Write a pose that ``--pose`` and the window read: all of it (``.json``) or its vector."""
    actor, skinning = selection.part.actor, options.skinning
    figure, pose = actor.figure, actor.own_pose
    if figure.skeleton is None or pose is None:
        raise RigError(f"figure {figure.name} has no skeleton and therefore no pose")
    again = figure_pose(figure)
    with keeping_written() as saved, all_or_none([path]):
        record = record_of(figure, pose, actor.shape_space.gender)
        write(record, path)
        stored = read(Source(path, saved[path]))
        apply_record(stored, figure, again)
    losses, how = PoseLosses(figure, skinning.unreduced()), skinning.unreduced()
    vertices = None if figure.mesh is None else deform(figure, again, how)[0]
    losses.look(pose, vertices, joint_matrices(figure, again)[:, :3, 3])
    notes = [note("X001.pose: {n}", path, n=counted(figure.skeleton.n_dofs, "DOF"))]
    notes += losses.notes(path)
    lost = _lost(figure.skeleton, pose, again)
    if stored.shape_space != record.shape_space:
        lost.append(Phrase("the body's model and gender ({space})", space=record.shape_space.title))
    return notes + not_held_note(path.suffix.lower(), lost)


def _lost(skeleton: Skeleton, pose: Pose, again: Pose) -> list[Phrase]:
    """Return the parts of a pose that another one, read from its file, does not have."""
    count = max(len(pose.shape_weights), len(again.shape_weights))
    shapes = np.zeros((2, count))  # missing weights are 0
    shapes[0, : len(pose.shape_weights)] = pose.shape_weights
    shapes[1, : len(again.shape_weights)] = again.shape_weights
    turned = np.abs(joint_rotations(skeleton, pose) - joint_rotations(skeleton, again))
    lost = {
        "rotations of joints that their DOFs cannot express": bool((turned > _TURNED).any()),
        "shape and expression": _differ(*shapes),
        "translations of joints": _differ(pose.translations, again.translations),
        "scales of joints": _differ(pose.scales, again.scales),
        "the figure's position": _differ(pose.figure_translation, again.figure_translation),
        "the figure's scale": abs(pose.figure_scale - again.figure_scale) > _SAME,
    }
    return [Phrase(key) for key, is_lost in lost.items() if is_lost]


def _differ(one: Floats, other: Floats) -> bool:
    return bool((np.abs(one - other) > _SAME).any())
