"""Edited objects: those that files contain, by identity, and keys that are not being played."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field, replace
from functools import partial
from pathlib import Path
from weakref import WeakSet

from viewer.data_classes import dataclass
from viewer.rigs.figure import Figure
from viewer.rigs.motion.transform_clip import Animation, TransformClip
from viewer.rigs.pose import PoseKey
from viewer.rigs.scene import Actor, Motion


@dataclass(frozen=True, slots=True, eq=False)
class SavedPose:
    """A pose of an actor that a file contains."""

    actor: Actor
    key: PoseKey


@dataclass(slots=True)
class SavedWork:
    """Clips, joint maps, rigs and poses that were read from a file or saved."""

    # Edits replace an object by a new one, and undo restores the old one, so an object that is not
    # recorded contains unsaved edits. Poses are edited in place, so they are recorded by value.
    _objects: list[object] = field(default_factory=list)
    edited: WeakSet[Figure | Motion] = field(default_factory=WeakSet)
    """Figures whose rig or mesh was edited, and fixed motions, saved or not."""
    made: WeakSet[Figure] = field(default_factory=WeakSet)
    """Figures that the Rig panel made."""
    rig: tuple[Path, ...] = ()
    """Files of the rig that was made for the scene's mesh and saved last: motions drive these."""

    def add(self, *objects: object) -> None:
        """Record objects whose content is saved."""
        self._objects += [one for one in objects if one is not None and one not in self]

    def add_actors(self, actors: Iterable[Actor]) -> None:
        """Record the keys and the joint maps of actors that were read from files."""
        for actor in actors:
            self.add(actor.keyed)
            if actor.drive is not None:
                self.add(actor.drive.joint_map)

    def lacks_rig(self, figure: Figure) -> bool:
        """Return whether a figure has a rig of the window that no file contains."""
        return figure in self.made | self.edited and figure not in self and figure.is_attached

    def poses_of(self, actor: Actor) -> list[PoseKey]:
        """Return the poses of an actor that files contain."""
        poses = (one for one in self._objects if isinstance(one, SavedPose))
        return [pose.key for pose in poses if pose.actor is actor]

    def exchange_actor(self, old: Actor, new: Actor) -> None:
        """Keep the poses of an actor that is replaced in the scene."""
        self.add(*(SavedPose(new, key) for key in self.poses_of(old)))

    def __contains__(self, one: object) -> bool:
        return any(one is other for other in self._objects)


@dataclass(slots=True)
class Animations:
    """Edited keys of animations of the scene that are not being played."""

    edited: dict[tuple[Actor, int], TransformClip] = field(default_factory=dict)
    """Clips by actor and index of the animation; clips without edits are omitted."""


def edited_aside(animations: Animations, actor: Actor) -> dict[int, TransformClip]:
    """Return the edited keys of the animations that an actor does not play now, by index."""
    playing = -1 if actor.transforms is None else actor.animation
    found = animations.edited.items()
    return {index: clip for (owner, index), clip in found if owner is actor and index != playing}


def keep_edited(animations: Animations, old: Actor, new: Actor) -> None:
    """Keep the edited keys of an actor that is replaced in the scene; undo restores the old one."""
    edited = animations.edited
    edited |= {(new, index): clip for (owner, index), clip in edited.items() if owner is old}


def with_edited_keys(animations: Animations, actor: Actor) -> Figure:
    """Return an actor's figure whose animations have the keys edited before another was played."""
    aside = edited_aside(animations, actor)
    if not aside:
        return actor.figure
    found = list(actor.figure.animations)
    for index, clip in aside.items():
        old, read = found[index], partial(_same, clip)
        found[index] = Animation(old.name, clip.start, clip.end, read, old.place, old.number)
    return replace(actor.figure, animations=tuple(found))


def _same(clip: TransformClip) -> TransformClip:
    return clip
