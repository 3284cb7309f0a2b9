"""Undo and redo: every change of pose, clip or display is one step, as is a slider drag."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import field, replace
from typing import Protocol

import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.options import DisplayOptions
from viewer.rig.captures.points import PointClip
from viewer.rig.motion.sampled_clip import SampledClip, with_rate
from viewer.rig.pose import Pose, PoseKey, pose_key, pose_of
from viewer.rig.retargeting.drive import Drive
from viewer.rig.scene import Actor, Motion, Scene, Swinging

_MOST = 500  # maximum number of steps
_PoseAt = Callable[[float], None]
"""Function that goes to a time and poses the scene for it."""


class _Undoable(Protocol):
    """State of a feature, with one value that undo restores together with the scene."""

    def kept(self) -> object | None:
        """Return the value, which is replaced but never mutated; None if there is none."""

    def restore(self, kept: object | None) -> None:
        """Restore a value."""


@dataclass(frozen=True, slots=True)
class _Step:
    """One edit: the states before and after it, both at the time of the edit."""

    before: _Snapshot
    after: _Snapshot


@dataclass(slots=True)
class History:
    """Undo history that detects changes itself, so that no panel or key can forget to report one.

    ``observe`` compares the state of each frame with that of the previous frame. An edit lasts as
    long as a widget is held, so a whole drag becomes one step. Poses set by the scene's clock are
    not edits: see ``follow``.

    Undo and redo of an edit of actors, poses or clips go to the time of the edit. The clock then
    poses all actors by their restored clips, and poses edited by hand are restored on top of that.
    Undoing a change of the display alone changes neither time nor poses.
    """

    feature: _Undoable | None = None
    """State of the feature whose value is undone with the scene."""
    first_poses: dict[Actor, PoseKey] = field(default_factory=dict)
    """Poses of actors before their first edit by hand; actors that were not posed are omitted."""
    _seen: _Snapshot | None = None  # state of the last frame
    _before: _Snapshot | None = None  # state before an edit in progress
    _clocked: dict[Actor, tuple[Motion, float, PoseKey | None]] = field(default_factory=dict)
    _undo: list[_Step] = field(default_factory=list)
    _redo: list[_Step] = field(default_factory=list)

    def start(self, scene: Scene, options: DisplayOptions) -> None:
        """Clear the history; the current scene becomes the first state."""
        self.feature = None  # it belonged to another scene
        self._clocked.clear()
        self.first_poses.clear()
        self._seen = self._before = None
        self._seen = self._take(scene, options)
        self._undo.clear()
        self._redo.clear()

    def observe(self, scene: Scene, options: DisplayOptions, busy: bool) -> bool:
        """Record a step if something changed and no widget is held; return whether it did."""
        if self._seen is None:
            return False
        if not _is_current(self._seen, scene, options) or self._has_another_value():
            self._before = self._before or self._seen
            self._seen = self._take(scene, options)
        if busy or self._before is None:
            return False
        before, self._before = self._before, None
        if _is_same(before, self._seen):  # dragged back to the initial value
            return False
        self._undo.append(_Step(before, self._seen))
        del self._undo[:-_MOST]
        self._redo.clear()
        self._note_poses(before, self._seen)
        return True

    def _note_poses(self, before: _Snapshot, after: _Snapshot) -> None:
        """Record the first poses of actors whose pose alone was edited, not their motion."""
        new = {id(actor): row for row, actor in enumerate(after.actors)}
        for row, actor in enumerate(before.actors):
            other, pose = new.get(id(actor)), before.poses[row]
            if other is None or pose is None or pose == after.poses[other]:
                continue
            if before.looks[row].clip is after.looks[other].clip:
                self.first_poses.setdefault(actor, pose)

    def exchange_actor(self, old: Actor, new: Actor) -> None:
        """Keep the first pose of an actor that is replaced in the scene."""
        if old in self.first_poses:
            self.first_poses.setdefault(new, self.first_poses[old])

    def accept(self, scene: Scene, options: DisplayOptions) -> None:
        """Adopt a change of the display without recording a step."""
        if self._seen is not None:
            self._seen = self._take(scene, options)

    def exchange(self, old: object, new: object) -> None:
        """Replace a feature's value by one with more information, without recording a step."""

        def exchanged(one: _Snapshot) -> _Snapshot:
            return replace(one, kept=new) if one.kept is old else one

        self._replace(exchanged)

    def follow(self, time: float) -> None:
        """Adopt poses set by the clock without recording a step; edits keep their steps.

        Edits made in the same frame must be observed before the clock poses the scene.
        """
        if self._seen is None:
            return
        actors = self._seen.actors  # other actors may have been added since
        poses = tuple(map(key_of, actors))
        self._seen = replace(self._seen, poses=poses, by_hand=(False,) * len(poses), time=time)
        self._clocked = {
            actor: (actor.clip, actor.offset, pose)
            for actor, pose in zip(actors, poses, strict=True)
            if actor.clip is not None
        }

    def add_actors(self, scene: Scene, options: DisplayOptions) -> None:
        """Extend all states by actors that were appended to the scene while captures are read."""
        whole = self._take(scene, options)
        known = {
            id(actor)
            for step in (*self._undo, *self._redo)
            for one in (step.before, step.after)
            for actor in one.actors
        }
        known |= {id(actor) for one in (self._seen, self._before) if one for actor in one.actors}
        rows = [row for row, actor in enumerate(whole.actors) if id(actor) not in known]
        grown = {id(actor): actor for actor in whole.actors}

        def extended(one: _Snapshot) -> _Snapshot:
            looks = (
                _extended(look, grown.get(id(actor)))
                for actor, look in zip(one.actors, one.looks, strict=True)
            )
            return replace(
                one,
                actors=(*one.actors, *(whole.actors[row] for row in rows)),
                poses=(*one.poses, *(whole.poses[row] for row in rows)),
                by_hand=(*one.by_hand, *(False for _ in rows)),
                looks=(*looks, *(whole.looks[row] for row in rows)),
            )

        self._replace(extended)

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to undo."""
        return bool(self._undo)

    @property
    def can_redo(self) -> bool:
        """Whether there is a step to redo."""
        return bool(self._redo)

    def undo(self, scene: Scene, options: DisplayOptions, pose_at: _PoseAt) -> bool:
        """Undo one step; return whether there was one."""
        self.observe(scene, options, busy=False)
        if not self._undo:
            return False
        step = self._undo.pop()
        self._redo.append(step)
        self._go(step.after, step.before, scene, options, pose_at)
        return True

    def redo(self, scene: Scene, options: DisplayOptions, pose_at: _PoseAt) -> bool:
        """Redo one step; return whether there was one. Parameters are those of ``undo``."""
        self.observe(scene, options, busy=False)
        if not self._redo:
            return False
        step = self._redo.pop()
        self._undo.append(step)
        self._go(step.before, step.after, scene, options, pose_at)
        return True

    def _go(
        self,
        here: _Snapshot,
        there: _Snapshot,
        scene: Scene,
        options: DisplayOptions,
        pose_at: _PoseAt,
    ) -> None:
        """Switch from one state of a step to the other."""
        _restore_display(there, options)
        if self.feature is not None:
            self.feature.restore(there.kept)
        if not _have_same_motion(here, there):
            _restore_motion(there, scene)
            pose_at(there.time)
            self._settle(there, there.time if scene.time is None else scene.time)
        elif self._seen is not None:
            looks = tuple(map(_look_of, scene.actors))
            shown = copy.deepcopy(options)
            self._seen = replace(self._seen, looks=looks, options=shown, kept=self._kept())

    def _settle(self, restored: _Snapshot, time: float) -> None:
        """Restore the poses that were edited by hand in place of those set by the clock."""
        self._seen = restored
        self.follow(time)
        rows = zip(restored.actors, restored.poses, restored.by_hand, strict=True)
        for actor, pose, is_own in rows:
            if is_own and pose is not None:
                actor.pose = _restored_pose(pose)
        poses = tuple(map(key_of, restored.actors))
        self._seen = replace(restored, poses=poses, time=time)

    def _replace(self, change: Callable[[_Snapshot], _Snapshot]) -> None:
        """Replace every stored state."""
        for steps in (self._undo, self._redo):
            steps[:] = [_Step(change(step.before), change(step.after)) for step in steps]
        self._seen, self._before = (
            None if one is None else change(one) for one in (self._seen, self._before)
        )

    def _take(self, scene: Scene, options: DisplayOptions) -> _Snapshot:
        actors = tuple(scene.actors)
        poses = tuple(map(key_of, actors))
        by_hand = tuple(map(self._is_by_hand, actors, poses))
        looks, shown = tuple(map(_look_of, actors)), copy.deepcopy(options)
        # An edit belongs to the time of the poses: the clock may have advanced already.
        time = (scene.time or 0.0) if self._seen is None else self._seen.time
        return _Snapshot(actors, poses, by_hand, looks, shown, time, self._kept())

    def _is_by_hand(self, actor: Actor, now: PoseKey | None) -> bool:
        """Return whether an actor's pose differs from the one that the clock set from its clip.

        A new clip overrides the pose in the same frame.
        """
        clip, offset, pose = self._clocked.get(actor, (None, 0.0, None))
        if clip is None or clip is not actor.clip or offset != actor.offset:
            return False
        return pose != now

    def _kept(self) -> object | None:
        return None if self.feature is None else self.feature.kept()

    def _has_another_value(self) -> bool:
        """Return whether a feature's value has changed; losing its value is not an edit."""
        kept = self._kept()
        return kept is not None and (self._seen is None or kept is not self._seen.kept)


@dataclass(frozen=True, slots=True)
class _Look:
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
class _Snapshot:
    """Everything that undo covers."""

    actors: tuple[Actor, ...]
    """Actors of the scene."""
    poses: tuple[PoseKey | None, ...]
    """One per actor."""
    by_hand: tuple[bool, ...]
    """Whether an actor's pose differs from that of its clip at ``time``."""
    looks: tuple[_Look, ...]
    """One per actor."""
    options: DisplayOptions
    """Display settings of the scene."""
    time: float
    """Time of the scene's clock, seconds."""
    kept: object | None = None
    """Value of a feature that undo restores with the scene; compared by identity."""


def _extended(look: _Look, actor: Actor | None) -> _Look:
    """Return the state of an earlier step with the clip and drive that have grown since then."""
    if actor is None:
        return look
    # Joints cannot be matched by hand while the motion grows.
    return replace(look, clip=_grown(look.clip, actor.clip), drive=actor.drive)


def _grown(old: Motion | None, new: Motion | None) -> Motion | None:
    """Return an earlier step's clip, extended by the frames read since then."""
    if isinstance(old, SampledClip) and isinstance(new, SampledClip):
        return with_rate(new, old.timing.frame_rate)
    if isinstance(old, PointClip) and isinstance(new, PointClip):
        return with_rate(new, old.timing.frame_rate)
    return old


def key_of(actor: Actor) -> PoseKey | None:
    """Return the values of an actor's pose; None if it has none."""
    return None if actor.pose is None else pose_key(actor.pose)


def _restored_pose(key: PoseKey | None) -> Pose | None:
    """Return a new pose with the values of a key."""
    return None if key is None else pose_of(key)


def _look_of(actor: Actor) -> _Look:
    """Return an actor's motion and display settings."""
    placement = actor.placement.tobytes()
    hidden, number = actor.hidden_parts, actor.animation
    look = actor.clip, actor.offset, actor.visible, actor.color, placement, hidden, number
    return _Look(*look, actor.springs, actor.drive)


def _looks(actor: Actor, look: _Look) -> bool:
    """Return whether ``_look_of`` would return an equal look, without creating objects."""
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


def _is_current(snapshot: _Snapshot, scene: Scene, options: DisplayOptions) -> bool:
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


def _is_same(one: _Snapshot, other: _Snapshot) -> bool:
    """Return whether two states are equal in everything that undo restores."""
    if (one.options, one.looks) != (other.options, other.looks):
        return False
    return one.kept is other.kept and _have_same_motion(one, other)


def _have_same_motion(one: _Snapshot, other: _Snapshot) -> bool:
    """Return whether two states have the same actors, clips and poses."""
    if [*map(id, one.actors)] != [*map(id, other.actors)]:
        return False
    looks = zip(one.looks, other.looks, strict=True)
    if any((a.clip, a.offset) != (b.clip, b.offset) for a, b in looks):
        return False
    return one.poses == other.poses


def _restore_motion(snapshot: _Snapshot, scene: Scene) -> None:
    """Restore the actors of a scene with their poses and clips."""
    scene.actors[:] = snapshot.actors
    for actor, pose, look in zip(scene.actors, snapshot.poses, snapshot.looks, strict=True):
        actor.pose = _restored_pose(pose)
        actor.clip, actor.offset, actor.animation = look.clip, look.offset, look.animation
        actor.drive = look.drive


def _restore_display(snapshot: _Snapshot, options: DisplayOptions) -> None:
    """Restore the display settings and placements of a snapshot's actors and scene."""
    for actor, look in zip(snapshot.actors, snapshot.looks, strict=True):
        actor.visible, actor.color = look.visible, look.color
        actor.hidden_parts, actor.springs = look.hidden_parts, look.springs
        actor.placement = np.frombuffer(look.placement).reshape(4, 4).copy()
    kept = copy.deepcopy(snapshot.options)
    for name in DisplayOptions.__slots__:
        setattr(options, name, getattr(kept, name))
