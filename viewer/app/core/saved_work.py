"""Record of the edited objects that files contain, by identity."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field

from viewer.data_classes import dataclass
from viewer.rig.pose import PoseKey
from viewer.rig.scene import Actor


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

    def add(self, *objects: object) -> None:
        """Record objects whose content is saved."""
        self._objects += [one for one in objects if one is not None and one not in self]

    def add_actors(self, actors: Iterable[Actor]) -> None:
        """Record the keys and the joint maps of actors that were read from files."""
        for actor in actors:
            self.add(actor.keyed)
            if actor.drive is not None:
                self.add(actor.drive.joint_map)

    def poses_of(self, actor: Actor) -> list[PoseKey]:
        """Return the poses of an actor that files contain."""
        poses = (one for one in self._objects if isinstance(one, SavedPose))
        return [pose.key for pose in poses if pose.actor is actor]

    def exchange_actor(self, old: Actor, new: Actor) -> None:
        """Keep the poses of an actor that is replaced in the scene."""
        self.add(*(SavedPose(new, key) for key in self.poses_of(old)))

    def __contains__(self, one: object) -> bool:
        return any(one is other for other in self._objects)
