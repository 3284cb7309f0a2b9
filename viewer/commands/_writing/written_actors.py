"""Actors that an export writes, and notes about the others."""

from __future__ import annotations

from pathlib import Path

from viewer.commands._frames import Frames
from viewer.commands._one_pose import asks_one_pose, posed_actors
from viewer.diagnostics import Diagnostic
from viewer.errors import RigError
from viewer.phrases import all_of
from viewer.rig.captures.points import PointClip
from viewer.rig.scene import Actor, Scene


def left_out_notes(scene: Scene, written: list[Actor]) -> list[Diagnostic]:
    """Return notes about omitted data: still figures, and keypoints of people with bodies."""
    left = [actor for actor in scene.actors if actor not in written]
    still = [actor.name for actor in left if actor.clip is None]
    points = [actor.name for actor in left if isinstance(actor.clip, PointClip)]
    moves = any(actor.clip is not None for actor in written)
    key = (
        "X003.no-motion: {figure}: no motion, not written"
        if moves
        else "X003.no-joints: {figure}: no joints, not written"
    )
    notes = [Diagnostic(key, values={"figure": name}) for name in still]
    if points:
        notes.append(
            Diagnostic(
                "X003.keypoints: keypoints next to bodies are not written ({names}): to write "
                "them, open only the keypoints3d folder",
                values={"names": all_of(points)},
            )
        )
    return notes


def pose_or_point_actors(scene: Scene) -> list[Actor]:
    """Return the actors whose current pose is written: captured points only if there is no body."""
    figures = [actor for actor in scene.actors if not isinstance(actor.clip, PointClip)]
    return figures or list(scene.actors)


def written_actors(frames: Frames, output: Path, scene: Scene) -> list[Actor]:
    """Return the actors whose motion is written, or whose pose is written as a one-frame motion.

    Raises RigError if there are none.
    """
    if asks_one_pose(frames, output, scene):
        return posed_actors(scene)
    return moving_actors(scene)


def moving_actors(scene: Scene) -> list[Actor]:
    """Return the actors whose motions are written: bodies, or captured points if there are none.

    Raises RigError if nothing moves.
    """
    moving = [actor for actor in scene.actors if actor.clip is not None]
    bodies = [actor for actor in moving if not isinstance(actor.clip, PointClip)]
    if not moving:
        raise RigError("no file has a motion: a motion cannot be written")
    return bodies or moving
