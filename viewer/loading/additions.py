"""Application of poses and texture images to an actor."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from viewer.diagnostics import Diagnostic, wording
from viewer.errors import RigError
from viewer.formats.pose import pose_error
from viewer.loading.contents import Contents, with_texture
from viewer.rigs.coefficients import space_misfit
from viewer.rigs.pose import Pose
from viewer.rigs.posing.pose_record import PoseRecord, apply_record
from viewer.rigs.scene import Actor


def add_to_actor(contents: Contents, actor: Actor) -> tuple[Actor, list[Diagnostic]]:
    """Apply poses and images to an open actor; return it, or a new one with another texture."""
    # Figures and clips in the contents are ignored. If a pose does not match, the actor is
    # unchanged.
    notes: list[Diagnostic] = []
    trial = actor.copy()
    for path, pixels in contents.pictures:
        trial.figure = with_texture(trial.figure, path, pixels)
    for path, record in contents.poses:
        if trial.own_pose is None:
            raise RigError.fault(wording.POSE, path, figure=actor.figure.name)
        notes += apply_pose(path, record, trial)
    # Nothing after this line can fail.
    if actor.own_pose is not None and trial.own_pose is not None:
        for name in Pose.__slots__:
            setattr(actor.own_pose, name, getattr(trial.own_pose, name))
    is_same = trial.figure is actor.figure
    return actor if is_same else replace(actor, figure=trial.figure), notes


def apply_pose(
    path: Path, record: PoseRecord, actor: Actor, drop_excess: bool = True
) -> list[Diagnostic]:
    """Apply a file's pose record, if it matches, to an actor; return messages on inexact data."""
    try:
        misfit = space_misfit(record.shape_space, actor.figure)
        if misfit is not None and misfit.key == "C019.model":
            has_shape = record.shape is not None and record.shape.any()
            misfit = misfit if has_shape else None
            record = replace(record, shape=None, expression=None)
        notes = apply_record(record, actor.figure, actor.pose, drop_excess)
        notes += [] if misfit is None else [misfit]
        return [replace(note, path=path) for note in notes]
    except RigError as problem:
        raise pose_error(path, record, problem) from None
