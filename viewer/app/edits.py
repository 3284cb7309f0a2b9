"""Every change of pose, clip or display as an undoable edit; a slider drag is one."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from viewer.app.frame_rate import with_rate
from viewer.rendering.options import DisplayOptions
from viewer.rig.points import PointClip
from viewer.rig.pose import Pose, pose_key
from viewer.rig.sampled_clip import SampledClip
from viewer.rig.scene import Actor, Motion, Scene

if TYPE_CHECKING:
    from viewer.app.rig_view import Placing, RigView

__all__ = ["History"]

_MOST = 500  # steps kept


@dataclass(frozen=True, slots=True)
class _Snapshot:
    """All that can be undone: who is there, each actor's pose, clip and way to be shown; how.

    And where the template of a rig was laid, None where that is not known.
    """

    actors: tuple[Actor, ...]
    poses: tuple[Pose | None, ...]
    looks: tuple[_Look, ...]
    options: DisplayOptions
    time: float
    placing: Placing | None = None


@dataclass(frozen=True, slots=True)
class _Look:
    """What an actor is, beside its pose."""

    clip: Motion | None
    offset: float
    visible: bool
    color: tuple[float, float, float] | None
    placement: bytes


@dataclass(slots=True)
class History:
    """Notices changes instead of being told of them, so no panel or key can forget to.

    ``observe`` compares the state after each frame with the last one it kept. While a widget is
    held nothing is kept: the whole drag becomes one step. What the scene's clock does to poses is
    no change: see ``follow``.

    Attributes
    ----------
    time : float
        Seconds that are shown; undoing goes back to the time of the change.
    has_restored : bool
        Whether poses were brought back that the clock has not been told of.
    rig : RigView or None
        Says where the template of a rig lies, which is undone with the scene.
    """

    time: float = 0.0
    has_restored: bool = False
    rig: RigView | None = None
    _now: _Snapshot | None = None
    _undo: list[_Snapshot] = field(default_factory=list)
    _redo: list[_Snapshot] = field(default_factory=list)

    def start(self, scene: Scene, options: DisplayOptions) -> None:
        """Forget everything; the scene as it is becomes the first state."""
        self.rig = None  # it was about another scene
        self._now = self._take(scene, options)
        self._undo.clear()
        self._redo.clear()

    def observe(self, scene: Scene, options: DisplayOptions, busy: bool) -> bool:
        """Keep a step if something changed and no widget is held; return whether it did."""
        if busy or self._now is None:
            return False
        if _is_same(self._now, scene, options) and not self._is_laid_elsewhere():
            return False
        self._undo.append(self._now)
        del self._undo[:-_MOST]
        self._redo.clear()
        self._now = self._take(scene, options)
        return True

    def accept(self, scene: Scene, options: DisplayOptions) -> None:
        """Take over what only looks at the scene otherwise, without a step of its own."""
        if self._now is not None:
            self._now = self._take(scene, options)

    def measured(self, placing: Placing, known: Placing) -> None:
        """Put a placing whose error is known in the place of the same one without, in all steps."""

        def exchanged(one: _Snapshot) -> _Snapshot:
            return replace(one, placing=known) if one.placing is placing else one

        self._undo[:] = map(exchanged, self._undo)
        self._redo[:] = map(exchanged, self._redo)
        if self._now is not None:
            self._now = exchanged(self._now)

    def follow(self, scene: Scene, time: float) -> None:
        """Take over poses that the clock has set, without a step; edits keep their steps."""
        self.time = time
        if self._now is not None:
            actors = self._now.actors  # others may have come to the scene since
            poses = tuple(actor.pose.copy() if actor.pose else None for actor in actors)
            self._now = replace(self._now, poses=poses, time=time)

    def add_actors(self, scene: Scene, options: DisplayOptions) -> None:
        """Go on with a scene to which actors were added at its end, as captures are read."""
        whole = self._take(scene, options)
        known = {id(actor) for one in (*self._undo, *self._redo) for actor in one.actors}
        known |= {id(actor) for actor in (self._now.actors if self._now else ())}
        rows = [row for row, actor in enumerate(whole.actors) if id(actor) not in known]
        clips = {id(actor): actor.clip for actor in whole.actors}

        def extended(one: _Snapshot) -> _Snapshot:
            looks = (
                replace(look, clip=_grown(look.clip, clips.get(id(actor))))
                for actor, look in zip(one.actors, one.looks, strict=True)
            )
            return replace(
                one,
                actors=(*one.actors, *(whole.actors[row] for row in rows)),
                poses=(*one.poses, *(whole.poses[row] for row in rows)),
                looks=(*looks, *(whole.looks[row] for row in rows)),
            )

        self._undo[:] = map(extended, self._undo)
        self._redo[:] = map(extended, self._redo)
        if self._now is not None:
            self._now = extended(self._now)

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
        if self.rig is not None:
            self.rig.placing = self._now.placing
        self.time, self.has_restored = self._now.time, True
        return True

    def _take(self, scene: Scene, options: DisplayOptions) -> _Snapshot:
        poses = tuple(actor.pose.copy() if actor.pose else None for actor in scene.actors)
        looks, kept = tuple(map(_look, scene.actors)), copy.deepcopy(options)
        return _Snapshot(tuple(scene.actors), poses, looks, kept, self.time, self._placing())

    def _placing(self) -> Placing | None:
        return None if self.rig is None else self.rig.placing

    def _is_laid_elsewhere(self) -> bool:
        """Return whether a template was laid; forgetting it with another choice is no edit."""
        placing = self._placing()
        return placing is not None and (self._now is None or placing is not self._now.placing)


def _grown(old: Motion | None, new: Motion | None) -> Motion | None:
    """Return what a clip of an earlier step is now that more of its capture has been read."""
    if isinstance(old, SampledClip) and isinstance(new, SampledClip):
        return with_rate(new, old.timing.frame_rate)
    if isinstance(old, PointClip) and isinstance(new, PointClip):
        return with_rate(new, old.timing.frame_rate)
    return old


def _look(actor: Actor) -> _Look:
    placement = actor.placement.tobytes()
    return _Look(actor.clip, actor.offset, actor.visible, actor.color, placement)


def _restore(snapshot: _Snapshot, scene: Scene, options: DisplayOptions) -> None:
    scene.actors[:] = snapshot.actors
    for actor, pose, look in zip(scene.actors, snapshot.poses, snapshot.looks, strict=True):
        actor.pose = pose.copy() if pose else None
        actor.clip, actor.offset, actor.visible = look.clip, look.offset, look.visible
        actor.color = look.color
        actor.placement = np.frombuffer(look.placement).reshape(4, 4).copy()
    kept = copy.deepcopy(snapshot.options)
    for name in DisplayOptions.__slots__:
        setattr(options, name, getattr(kept, name))


def _is_same(snapshot: _Snapshot, scene: Scene, options: DisplayOptions) -> bool:
    if snapshot.options != options:
        return False
    if [*map(id, snapshot.actors)] != [*map(id, scene.actors)]:
        return False
    # Clips are compared by identity: they are never changed, only replaced.
    if any(_look(actor) != look for actor, look in zip(scene.actors, snapshot.looks, strict=True)):
        return False
    pairs = zip(snapshot.poses, (actor.pose for actor in scene.actors), strict=True)
    return all(_same_pose(old, new) for old, new in pairs)


def _same_pose(old: Pose | None, new: Pose | None) -> bool:
    if old is None or new is None:
        return old is new
    return pose_key(old) == pose_key(new)
