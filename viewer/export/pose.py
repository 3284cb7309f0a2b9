"""Exporter for poses, by joint names (``.json``) or as the model's pose vector (``.txt``)."""

from __future__ import annotations

from pathlib import Path

from viewer.diagnostics import Diagnostic
from viewer.errors import RigError
from viewer.formats import write
from viewer.rig.posing.pose_record import record_of
from viewer.rig.scene import Actor
from viewer.rig.skinning import Skinning

__all__ = ["export"]


def export(actor: Actor, path: Path, skinning: Skinning) -> list[Diagnostic]:
    """Write a pose that ``--pose`` and the window read; see ``viewer.export.export``."""
    figure, pose = actor.figure, actor.pose
    if figure.skeleton is None or pose is None:
        raise RigError(f"figure {figure.name} has no skeleton and therefore no pose")
    write(record_of(figure, pose), path)
    return [Diagnostic("X001.pose", path, values={"n": figure.skeleton.n_dofs})]
