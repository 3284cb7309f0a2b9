"""Every change of pose or display as an undoable edit; a slider drag is one."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field

from viewer.rendering.options import DisplayOptions
from viewer.rig.pose import Pose, pose_key
from viewer.rig.scene import Scene

__all__ = ["History"]

_MOST = 500  # steps kept


@dataclass(frozen=True, slots=True)
class _Snapshot:
    """All that can be undone: the pose of each actor, and what is shown how."""

    poses: tuple[Pose | None, ...]
    options: DisplayOptions


@dataclass(slots=True)
class History:
    """Notices changes instead of being told of them, so no panel or key can forget to.

    ``observe`` compares the state after each frame with the last one it kept. While a widget is
    held nothing is kept: the whole drag becomes one step.
    """

    _now: _Snapshot | None = None
    _undo: list[_Snapshot] = field(default_factory=list)
    _redo: list[_Snapshot] = field(default_factory=list)

    def start(self, scene: Scene, options: DisplayOptions) -> None:
        """Forget everything; the scene as it is becomes the first state."""
        self._now = _take(scene, options)
        self._undo.clear()
        self._redo.clear()

    def observe(self, scene: Scene, options: DisplayOptions, busy: bool) -> bool:
        """Keep a step if something changed and no widget is held; return whether it did."""
        if busy or self._now is None or _is_same(self._now, scene, options):
            return False
        self._undo.append(self._now)
        del self._undo[:-_MOST]
        self._redo.clear()
        self._now = _take(scene, options)
        return True

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to go back to."""
        return bool(self._undo)

    @property
    def can_redo(self) -> bool:
        """Whether a step was undone and can come back."""
        return bool(self._redo)

    def undo(self, scene: Scene, options: DisplayOptions) -> bool:
        """Go back one step; return whether there was one."""
        return self._move(self._undo, self._redo, scene, options)

    def redo(self, scene: Scene, options: DisplayOptions) -> bool:
        """Go forward one step; return whether there was one."""
        return self._move(self._redo, self._undo, scene, options)

    def _move(
        self,
        source: list[_Snapshot],
        destination: list[_Snapshot],
        scene: Scene,
        options: DisplayOptions,
    ) -> bool:
        self.observe(scene, options, busy=False)
        if not source or self._now is None:
            return False
        destination.append(self._now)
        self._now = source.pop()
        _restore(self._now, scene, options)
        return True


def _take(scene: Scene, options: DisplayOptions) -> _Snapshot:
    poses = tuple(actor.pose.copy() if actor.pose else None for actor in scene.actors)
    return _Snapshot(poses, copy.deepcopy(options))


def _restore(snapshot: _Snapshot, scene: Scene, options: DisplayOptions) -> None:
    for actor, pose in zip(scene.actors, snapshot.poses, strict=True):
        actor.pose = pose.copy() if pose else None
    kept = copy.deepcopy(snapshot.options)
    for name in DisplayOptions.__slots__:
        setattr(options, name, getattr(kept, name))


def _is_same(snapshot: _Snapshot, scene: Scene, options: DisplayOptions) -> bool:
    if snapshot.options != options:
        return False
    pairs = zip(snapshot.poses, (actor.pose for actor in scene.actors), strict=True)
    return all(_same_pose(old, new) for old, new in pairs)


def _same_pose(old: Pose | None, new: Pose | None) -> bool:
    if old is None or new is None:
        return old is new
    return pose_key(old) == pose_key(new)
