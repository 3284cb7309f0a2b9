"""Poses and pictures, applied to an actor."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from viewer.errors import RigError, printable
from viewer.formats.pose import pose_error
from viewer.loading.contents import Contents
from viewer.loading.covering import with_texture
from viewer.rig.pose import Pose
from viewer.rig.posing.pose_record import PoseRecord, apply_record
from viewer.rig.scene import Actor

__all__ = ["add_to_actor", "apply_pose"]


def add_to_actor(contents: Contents, actor: Actor) -> tuple[Actor, list[str]]:
    """Apply poses and pictures to an actor that is open already.

    Parameters
    ----------
    contents : Contents
        Figures and clips in it are left alone.
    actor : Actor
        Its pose is changed; it stays itself unless it gets another texture.

    Returns
    -------
    actor : Actor
        A new one, with the same pose, if it has another texture.
    notes : list of str
        What could not be taken over exactly.

    Raises
    ------
    FormatError
        If a pose does not fit; the actor is then as it was.
    RigError
        If a picture does not, or there is nothing to pose.
    """
    notes: list[str] = []
    trial = actor.copy()
    for path, pixels in contents.pictures:
        trial.figure = with_texture(trial.figure, path, pixels)
    for path, record in contents.poses:
        if trial.pose is None:
            raise RigError(f"{printable(path, 300)} is a pose, {actor.figure.name} has no skeleton")
        notes += apply_pose(path, record, trial)
    # Nothing fails from here on.
    if actor.pose is not None and trial.pose is not None:
        for name in Pose.__slots__:
            setattr(actor.pose, name, getattr(trial.pose, name))
    is_same = trial.figure is actor.figure
    return actor if is_same else replace(actor, figure=trial.figure), notes


def apply_pose(path: Path, record: PoseRecord, actor: Actor) -> list[str]:
    """Pose an actor by a record that came from a file; return what could not be taken over.

    Raises
    ------
    FormatError
        If it does not fit; the actor is then as it was.
    """
    shown = printable(path, 300)
    try:
        notes = apply_record(record, actor.figure, actor.require_pose(), cut=True)
        return [f"{shown}: {note}" for note in notes]
    except RigError as problem:
        raise pose_error(path, record, problem) from None
