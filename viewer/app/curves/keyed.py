"""Keyed motions for the Curves panel: curves with keys, by row of the panel's list."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from viewer.app.curves.dof_keys import DofKeys
from viewer.app.curves.state import KeyPlace
from viewer.app.curves.transform_keys import TransformKeys
from viewer.rig.arrays import Floats
from viewer.rig.motion.clip import Clip
from viewer.rig.motion.transform_clip import TransformClip
from viewer.rig.scene import Actor, Motion

__all__ = ["KeyedMotion", "keyed_of"]


class KeyedMotion(Protocol):
    """A keyed motion; every edit returns a new motion. Rows are as in ``curves_of``."""

    def keys(self, row: int) -> tuple[Floats, Floats] | None:
        """Return the times and values of a curve's keys, (N,) each; None without keys."""

    def slopes(self, row: int) -> Floats | None:
        """Return the slopes at the keys that can be dragged, (N, 2); None if there are none."""

    def values(self, rows: tuple[int, ...], times: Floats) -> Floats:
        """Return the values of some curves at many times: (T, C); those without keys are 0."""

    def wraps(self, row: int) -> bool:
        """Return whether a curve shows angles that jump by full rotations."""

    def moved(self, places: Iterable[KeyPlace], dt: float, dv: float, gap: float) -> Motion:
        """Move keys together; they stop at unselected keys."""

    def placed(
        self, place: KeyPlace, time: float | None, value: float | None, gap: float
    ) -> Motion:
        """Set the time or value of one key."""

    def added(self, rows: Iterable[int], time: float, actor: Actor) -> Motion:
        """Add keys on curves; those without keys get the value of the actor's pose."""

    def deleted(self, places: Iterable[KeyPlace]) -> Motion:
        """Delete keys."""

    def sloped(self, places: Iterable[KeyPlace], side: int, slope: float) -> Motion:
        """Set the slope on one side of keys: 0 incoming, 1 outgoing."""

    def ranged(self, start: float, end: float) -> Motion:
        """Set the playback range, seconds."""

    def posed(self, actor: Actor, time: float, only_changed: bool) -> Motion:
        """Key an actor's pose at a time."""


def keyed_of(actor: Actor) -> KeyedMotion | None:
    """Return an actor's motion if it has keys to edit."""
    clip, skeleton = actor.clip, actor.figure.skeleton
    if skeleton is None:
        return None
    if isinstance(clip, Clip):
        return DofKeys(clip, skeleton)
    return TransformKeys(clip, skeleton) if isinstance(clip, TransformClip) else None
