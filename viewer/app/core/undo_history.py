"""Undo and redo: every change of rig, pose, clip or display is one step, as is a slider drag."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import field, replace
from typing import Protocol

from viewer.app.core.scene_version import ActorVersion, SceneVersion, version_of
from viewer.data_classes import dataclass
from viewer.rendering.options import DisplayOptions
from viewer.rigs.figure import Figure
from viewer.rigs.motion.sampled_clip import with_rate
from viewer.rigs.pose import PoseKey, pose_of
from viewer.rigs.scene import Actor, Motion, Scene

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
class Step:
    """One edit: the states before and after it, both at the time of the edit."""

    before: _Snapshot
    after: _Snapshot
    name: str = ""
    """What was done, as "move joint left_wrist"; empty if it has no name."""


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
    name: str = ""
    """Name of the step that the changes of this frame, or of a drag, become; see ``Step``."""
    _seen: _Snapshot | None = None  # state of the last frame
    _before: _Snapshot | None = None  # state before an edit in progress
    _clocked: dict[Actor, ActorVersion] = field(default_factory=dict)  # as posed by the clock
    _undo: list[Step] = field(default_factory=list)
    _redo: list[Step] = field(default_factory=list)

    def start(self, version: SceneVersion, time: float) -> None:
        """Clear the history; the current scene becomes the first state."""
        self.feature = None  # it belonged to another scene
        self._clocked.clear()
        self.first_poses.clear()
        self._before = None
        self._seen = self._take(version, time)
        self._undo.clear()
        self._redo.clear()

    def observe(self, version: SceneVersion, busy: bool) -> bool:
        """Record a step if something changed and no widget is held; return whether it did."""
        if self._seen is None:
            return False
        if self._seen.version != version or self._has_another_value():
            self._before = self._before or self._seen
            # An edit belongs to the time of the poses: the clock may have advanced already.
            self._seen = self._take(version, self._seen.time)
        if busy:
            return False
        name, self.name = self.name, ""
        if self._before is None:
            return False
        before, self._before = self._before, None
        if _is_same(before, self._seen):  # dragged back to the initial value
            return False
        self._undo.append(Step(before, self._seen, name))
        del self._undo[:-_MOST]
        self._redo.clear()
        self._note_poses(before, self._seen)
        return True

    def _note_poses(self, before: _Snapshot, after: _Snapshot) -> None:
        """Record the first poses of actors whose pose alone was edited, not their motion."""
        new = {id(one.actor): one for one in after.version.actors}
        for one in before.version.actors:
            other = new.get(id(one.actor))
            if other is None or one.pose is None or one.pose == other.pose:
                continue
            if _rig(one) != _rig(other):
                self.first_poses.pop(one.actor, None)  # it may have other joints
            elif one.clip is other.clip:
                self.first_poses.setdefault(one.actor, one.pose)

    def exchange_actor(self, old: Actor, new: Actor) -> None:
        """Keep the first pose of an actor that is replaced in the scene."""
        if old in self.first_poses:
            self.first_poses.setdefault(new, self.first_poses[old])

    def accept(self, version: SceneVersion) -> None:
        """Adopt a change of the display without recording a step."""
        if self._seen is not None:
            self._seen = self._take(version, self._seen.time)

    def exchange(self, old: object, new: object) -> None:
        """Replace a feature's value by one with more information, without recording a step."""

        def exchanged(one: _Snapshot) -> _Snapshot:
            return replace(one, kept=new) if one.kept is old else one

        self._replace(exchanged)

    def exchange_figure(self, old: Figure, new: Figure) -> None:
        """Replace a figure by one with more information, without recording a step."""

        def exchanged(state: _Snapshot) -> _Snapshot:
            actors = (
                one._replace(figure=new) if one.figure is old else one
                for one in state.version.actors
            )
            return replace(state, version=replace(state.version, actors=tuple(actors)))

        self._replace(exchanged)

    def follow(self, version: SceneVersion, time: float) -> None:
        """Adopt poses set by the clock; edits of the same frame must have been observed before."""
        if self._seen is None:
            return
        self._clocked = {one.actor: one for one in version.actors if one.clip is not None}
        by_hand = (False,) * len(version.actors)
        self._seen = replace(self._seen, version=version, by_hand=by_hand, time=time)

    def add_actors(self, version: SceneVersion) -> None:
        """Extend all states by actors that were appended to the scene while captures are read."""
        known = {
            id(one.actor)
            for step in (*self._undo, *self._redo)
            for state in (step.before, step.after)
            for one in state.version.actors
        }
        known |= {
            id(one.actor)
            for state in (self._seen, self._before)
            if state is not None
            for one in state.version.actors
        }
        new = tuple(one for one in version.actors if id(one.actor) not in known)
        grown = {id(one.actor): one for one in version.actors}

        def extended(state: _Snapshot) -> _Snapshot:
            old = (_extended(one, grown.get(id(one.actor))) for one in state.version.actors)
            by_hand = (*state.by_hand, *(False for _ in new))
            return replace(
                state, version=replace(state.version, actors=(*old, *new)), by_hand=by_hand
            )

        self._replace(extended)

    @property
    def undone_next(self) -> Step | None:
        """The step that would be undone."""
        return self._undo[-1] if self._undo else None

    @property
    def redone_next(self) -> Step | None:
        """The step that would be redone."""
        return self._redo[-1] if self._redo else None

    def undo(self, scene: Scene, options: DisplayOptions, pose_at: _PoseAt) -> Step | None:
        """Undo one step and return it; None if there was none."""
        self.observe(self._now(scene, options), busy=False)
        if not self._undo:
            return None
        step = self._undo.pop()
        self._redo.append(step)
        self._go(step.after, step.before, scene, options, pose_at)
        return step

    def redo(self, scene: Scene, options: DisplayOptions, pose_at: _PoseAt) -> Step | None:
        """Redo one step and return it; None if there was none. Parameters are those of ``undo``."""
        self.observe(self._now(scene, options), busy=False)
        if not self._redo:
            return None
        step = self._redo.pop()
        self._undo.append(step)
        self._go(step.before, step.after, scene, options, pose_at)
        return step

    def _go(
        self,
        here: _Snapshot,
        there: _Snapshot,
        scene: Scene,
        options: DisplayOptions,
        pose_at: _PoseAt,
    ) -> None:
        """Switch from one state of a step to the other."""
        _restore_display(there.version, options)
        if self.feature is not None:
            self.feature.restore(there.kept)
        if not _have_same_motion(here.version, there.version):
            _restore_rigs(here.version, there.version)
            _restore_motion(there.version, scene)
            pose_at(there.time)
            time = there.time if scene.time is None else scene.time
            self.follow(self._now(scene, options), time)
            # Poses that were edited by hand replace those set by the clock.
            for one, is_own in zip(there.version.actors, there.by_hand, strict=True):
                if is_own and one.pose is not None:
                    one.actor.pose = pose_of(one.pose)
            self._seen = replace(there, version=self._now(scene, options), time=time)
        elif self._seen is not None:
            version = self._now(scene, options)
            self._seen = replace(self._seen, version=version, kept=self._kept())

    def _now(self, scene: Scene, options: DisplayOptions) -> SceneVersion:
        return version_of(scene, options, None if self._seen is None else self._seen.version)

    def _replace(self, change: Callable[[_Snapshot], _Snapshot]) -> None:
        """Replace every stored state."""
        for steps in (self._undo, self._redo):
            steps[:] = [
                replace(step, before=change(step.before), after=change(step.after))
                for step in steps
            ]
        self._seen, self._before = (
            None if one is None else change(one) for one in (self._seen, self._before)
        )

    def _take(self, version: SceneVersion, time: float) -> _Snapshot:
        by_hand = tuple(map(self.is_by_hand, version.actors))
        return _Snapshot(version, by_hand, time, self._kept())

    def is_by_hand(self, now: ActorVersion) -> bool:
        """Return whether an actor's pose differs from the one set by the clock from its clip."""
        clocked = self._clocked.get(now.actor)
        if clocked is None or clocked.clip is not now.clip or clocked.offset != now.offset:
            return False
        return clocked.pose != now.pose

    def _kept(self) -> object | None:
        return None if self.feature is None else self.feature.kept()

    def _has_another_value(self) -> bool:
        """Return whether a feature's value has changed; losing its value is not an edit."""
        kept = self._kept()
        return kept is not None and (self._seen is None or kept is not self._seen.kept)


@dataclass(frozen=True, slots=True)
class _Snapshot:
    """Everything that undo covers."""

    version: SceneVersion
    """Actors, poses and display of the scene."""
    by_hand: tuple[bool, ...]
    """Whether an actor's pose differs from that of its clip at ``time``."""
    time: float
    """Time of the scene's clock, seconds."""
    kept: object | None = None
    """Value of a feature that undo restores with the scene; compared by identity."""


def _extended(old: ActorVersion, new: ActorVersion | None) -> ActorVersion:
    """Return the state of an earlier step with the clip and drive that have grown since then."""
    if new is None:
        return old
    # Joints cannot be matched by hand while the motion grows.
    return old._replace(clip=_grown(old.clip, new.clip), drive=new.drive)


def _grown(old: Motion | None, new: Motion | None) -> Motion | None:
    """Return an earlier step's clip, extended by the frames read since then."""
    if old is None or new is None or old.timing is None or new.timing is None:
        return old
    return with_rate(new, old.frame_rate) if old.kind == new.kind else old


def _is_same(one: _Snapshot, other: _Snapshot) -> bool:
    """Return whether two states are equal in everything that undo restores."""
    a, b = one.version, other.version
    if a.options != b.options or [x.look for x in a.actors] != [x.look for x in b.actors]:
        return False
    return one.kept is other.kept and _have_same_motion(a, b)


def _have_same_motion(one: SceneVersion, other: SceneVersion) -> bool:
    """Return whether two states have the same actors, rigs, clips and poses."""
    a, b = ([(x.actor, _rig(x), x.clip, x.offset, x.pose) for x in v.actors] for v in (one, other))
    return a == b


def _rig(one: ActorVersion) -> tuple[object, ...]:
    """Return the parts of a figure that edits of its joints, or fixes of its faults, replace."""
    figure = one.figure
    return figure.skeleton, figure.skin, figure.mesh, figure.animations


def _restore_rigs(here: SceneVersion, there: SceneVersion) -> None:
    """Restore the figures of actors whose rig differs; other changes of figures are not edits."""
    now = {id(one.actor): one for one in here.actors}
    for one in there.actors:
        known = now.get(id(one.actor))
        if known is not None and _rig(known) != _rig(one):
            one.actor.figure = one.figure


def _restore_motion(version: SceneVersion, scene: Scene) -> None:
    """Restore the actors of a scene with their poses and clips."""
    scene.actors[:] = [one.actor for one in version.actors]
    for one in version.actors:
        actor = one.actor
        actor.own_pose = None if one.pose is None else pose_of(one.pose)
        actor.clip, actor.offset, actor.animation = one.clip, one.offset, one.animation
        actor.drive = one.drive


def _restore_display(version: SceneVersion, options: DisplayOptions) -> None:
    """Restore the display settings and placements of actors and scene."""
    for one in version.actors:
        actor = one.actor
        actor.visible, actor.color = one.visible, one.color
        actor.hidden_parts, actor.springs = one.hidden_parts, one.springs
        actor.placement = one.placement.array(0).reshape(4, 4)
    kept = copy.deepcopy(version.options)
    for name in DisplayOptions.__slots__:
        setattr(options, name, getattr(kept, name))
