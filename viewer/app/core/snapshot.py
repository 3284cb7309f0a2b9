"""Snapshots of the scene and its display, which undo stores and restores."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from viewer.rendering.options import DisplayOptions
from viewer.rig.pose import Pose
from viewer.rig.scene import Actor, Motion, Scene

__all__ = [
    "Look",
    "Snapshot",
    "copied_poses",
    "have_same_motion",
    "is_current",
    "is_same",
    "look_of",
    "restore_display",
    "restore_motion",
    "same_pose",
]


@dataclass(frozen=True, slots=True)
class Look:
    """Motion and display settings of an actor, without its pose."""

    clip: Motion | None
    offset: float
    visible: bool
    color: tuple[float, float, float] | None
    placement: bytes


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Everything that undo covers.

    Attributes
    ----------
    actors : tuple of Actor
        Actors of the scene.
    poses : tuple of Pose or None
        One per actor.
    by_hand : tuple of bool
        Whether an actor's pose differs from that of its clip at ``time``.
    looks : tuple of Look
        One per actor.
    options : DisplayOptions
        Display settings of the scene.
    time : float
        Time of the scene's clock, seconds.
    kept : object or None
        A feature's value that is undone with the scene; compared by identity.
    """

    actors: tuple[Actor, ...]
    poses: tuple[Pose | None, ...]
    by_hand: tuple[bool, ...]
    looks: tuple[Look, ...]
    options: DisplayOptions
    time: float
    kept: object | None = None


def copied_poses(actors: Sequence[Actor]) -> tuple[Pose | None, ...]:
    """Return copies of the actors' poses."""
    return tuple(actor.pose.copy() if actor.pose else None for actor in actors)


def look_of(actor: Actor) -> Look:
    """Return an actor's motion and display settings."""
    placement = actor.placement.tobytes()
    return Look(actor.clip, actor.offset, actor.visible, actor.color, placement)


def same_pose(old: Pose | None, new: Pose | None) -> bool:
    """Return whether two poses have the same numbers."""
    if old is None or new is None:
        return old is new
    return new.is_like(old)


def is_current(snapshot: Snapshot, scene: Scene, options: DisplayOptions) -> bool:
    """Return whether the scene and its display are unchanged, ignoring the feature's value."""
    if snapshot.options != options:
        return False
    if [*map(id, snapshot.actors)] != [*map(id, scene.actors)]:
        return False
    # Clips are compared by identity: they are replaced and never mutated.
    pairs = zip(scene.actors, snapshot.looks, strict=True)
    if any(look_of(actor) != look for actor, look in pairs):
        return False
    poses = zip(snapshot.poses, (actor.pose for actor in scene.actors), strict=True)
    return all(same_pose(old, new) for old, new in poses)


def is_same(one: Snapshot, other: Snapshot) -> bool:
    """Return whether two states are equal in everything that undo restores."""
    if (one.options, one.looks) != (other.options, other.looks):
        return False
    return one.kept is other.kept and have_same_motion(one, other)


def have_same_motion(one: Snapshot, other: Snapshot) -> bool:
    """Return whether two states have the same actors, clips and poses."""
    if [*map(id, one.actors)] != [*map(id, other.actors)]:
        return False
    looks = zip(one.looks, other.looks, strict=True)
    if any((a.clip, a.offset) != (b.clip, b.offset) for a, b in looks):
        return False
    return all(same_pose(a, b) for a, b in zip(one.poses, other.poses, strict=True))


def restore_motion(snapshot: Snapshot, scene: Scene) -> None:
    """Restore the actors of a scene with their poses and clips."""
    scene.actors[:] = snapshot.actors
    for actor, pose, look in zip(scene.actors, snapshot.poses, snapshot.looks, strict=True):
        actor.pose = pose.copy() if pose else None
        actor.clip, actor.offset = look.clip, look.offset


def restore_display(snapshot: Snapshot, options: DisplayOptions) -> None:
    """Restore the display settings and placements of a snapshot's actors and scene."""
    for actor, look in zip(snapshot.actors, snapshot.looks, strict=True):
        actor.visible, actor.color = look.visible, look.color
        actor.placement = np.frombuffer(look.placement).reshape(4, 4).copy()
    kept = copy.deepcopy(snapshot.options)
    for name in DisplayOptions.__slots__:
        setattr(options, name, getattr(kept, name))
