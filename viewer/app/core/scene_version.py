"""Version of the scene: a snapshot that undo, the picture and the checks of the rig compare."""

from __future__ import annotations

import copy
from operator import is_
from typing import NamedTuple

from viewer.data_classes import dataclass
from viewer.rendering.options import DisplayOptions
from viewer.rigs.figure import Figure
from viewer.rigs.memo import NumberKey
from viewer.rigs.pose import PoseKey, pose_key
from viewer.rigs.retargeting.drive import Drive
from viewer.rigs.scene import Actor, Motion, Scene, Swinging
from viewer.rigs.watched_arrays import unwatched


class ActorVersion(NamedTuple):  # a tuple is compared quickly, also for hundreds of actors
    """What can change about an actor; figures and motions are replaced and never mutated."""

    actor: Actor
    figure: Figure
    pose: PoseKey | None
    clip: Motion | None
    offset: float
    visible: bool
    is_present: bool
    color: tuple[float, float, float] | None
    opacity: float
    hidden_parts: frozenset[int]
    animation: int
    springs: Swinging | None
    drive: Drive | None
    placement: NumberKey
    points: NumberKey | None

    @property
    def look(self) -> tuple[object, ...]:
        """What undo restores besides the pose."""
        shown = self.visible, self.color, self.hidden_parts, self.placement
        return (self.clip, self.offset, self.animation, self.springs, self.drive, *shown)


@dataclass(frozen=True, slots=True)
class SceneVersion:
    """Actors and display of a scene."""

    actors: tuple[ActorVersion, ...]
    options: DisplayOptions


def version_of(
    scene: Scene, options: DisplayOptions, last: SceneVersion | None = None
) -> SceneVersion:
    """Return a scene's version, reusing what has not changed since the last one."""
    before = () if last is None else last.actors
    known = {id(one.actor): one for one in before}
    actors = tuple(_version_of(actor, known.get(id(actor))) for actor in scene.actors)
    if last is None or last.options != options:
        return SceneVersion(actors, copy.deepcopy(options))
    if len(actors) == len(before) and all(map(is_, actors, before)):
        return last
    return SceneVersion(actors, last.options)


def _version_of(actor: Actor, last: ActorVersion | None) -> ActorVersion:
    placement = NumberKey() if last is None else last.placement
    points = None
    if actor.points is not None:
        points = ((last and last.points) or NumberKey()).updated(actor.points)
    now = ActorVersion(
        actor,
        actor.figure,
        None if actor.own_pose is None else pose_key(actor.own_pose),
        actor.clip,
        actor.offset,
        actor.visible,
        actor.is_present,
        actor.color,
        actor.opacity,
        actor.hidden_parts,
        actor.animation,
        actor.springs,
        actor.drive,
        placement.updated(unwatched("placement")(actor)),
        points,
    )
    return last if last is not None and last == now else now
