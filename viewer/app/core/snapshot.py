"""Snapshots of the scene and its display, which undo stores and restores."""

from __future__ import annotations

import copy

import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.options import DisplayOptions
from viewer.rig.pose import Pose, PoseKey, pose_key, pose_of
from viewer.rig.retargeting.drive import Drive
from viewer.rig.scene import Actor, Motion, Scene, Swinging

__all__ = [
    "Look",
    "Snapshot",
    "have_same_motion",
    "is_current",
    "is_same",
    "key_of",
    "look_of",
    "restore_display",
    "restore_motion",
    "restored_pose",
]


@dataclass(frozen=True, slots=True)
class Look:
    """Motion and display settings of an actor, without its pose."""

    clip: Motion | None
    offset: float
    visible: bool
    color: tuple[float, float, float] | None
    placement: bytes
    hidden_parts: frozenset[int]
    animation: int
    springs: Swinging | None
    drive: Drive | None


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Everything that undo covers.

    Attributes
    ----------
    actors : tuple of Actor
        Actors of the scene.
    poses : tuple of PoseKey or None
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
        Value of a feature that undo restores with the scene; compared by identity.
    """

    actors: tuple[Actor, ...]
    poses: tuple[PoseKey | None, ...]
    by_hand: tuple[bool, ...]
    looks: tuple[Look, ...]
    options: DisplayOptions
    time: float
    kept: object | None = None


def key_of(actor: Actor) -> PoseKey | None:
    """Return the values of an actor's pose; None if it has none."""
    return None if actor.pose is None else pose_key(actor.pose)


def restored_pose(key: PoseKey | None) -> Pose | None:
    """Return a new pose with the values of a key."""
    return None if key is None else pose_of(key)


def look_of(actor: Actor) -> Look:
    """Return an actor's motion and display settings."""
    placement = actor.placement.tobytes()
    hidden, number = actor.hidden_parts, actor.animation
    look = actor.clip, actor.offset, actor.visible, actor.color, placement, hidden, number
    return Look(*look, actor.springs, actor.drive)


def _looks(actor: Actor, look: Look) -> bool:
    """Return whether ``look_of`` would return an equal look, without creating objects."""
    # Clips are compared by identity: they are replaced and never mutated.
    return (
        actor.clip is look.clip
        and actor.visible == look.visible
        and actor.offset == look.offset
        and actor.color == look.color
        and actor.hidden_parts == look.hidden_parts
        and actor.animation == look.animation
        and actor.springs is look.springs
        and actor.drive is look.drive
        and actor.placement.tobytes() == look.placement
    )


def is_current(snapshot: Snapshot, scene: Scene, options: DisplayOptions) -> bool:
    """Return whether the scene and its display are unchanged, ignoring the feature's value."""
    if snapshot.options != options:
        return False
    if [*map(id, snapshot.actors)] != [*map(id, scene.actors)]:
        return False
    if not all(map(_looks, scene.actors, snapshot.looks)):
        return False
    return all(
        key == key_of(actor) for key, actor in zip(snapshot.poses, scene.actors, strict=True)
    )


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
    return one.poses == other.poses


def restore_motion(snapshot: Snapshot, scene: Scene) -> None:
    """Restore the actors of a scene with their poses and clips."""
    scene.actors[:] = snapshot.actors
    for actor, pose, look in zip(scene.actors, snapshot.poses, snapshot.looks, strict=True):
        actor.pose = restored_pose(pose)
        actor.clip, actor.offset, actor.animation = look.clip, look.offset, look.animation
        actor.drive = look.drive


def restore_display(snapshot: Snapshot, options: DisplayOptions) -> None:
    """Restore the display settings and placements of a snapshot's actors and scene."""
    for actor, look in zip(snapshot.actors, snapshot.looks, strict=True):
        actor.visible, actor.color = look.visible, look.color
        actor.hidden_parts, actor.springs = look.hidden_parts, look.springs
        actor.placement = np.frombuffer(look.placement).reshape(4, 4).copy()
    kept = copy.deepcopy(snapshot.options)
    for name in DisplayOptions.__slots__:
        setattr(options, name, getattr(kept, name))
