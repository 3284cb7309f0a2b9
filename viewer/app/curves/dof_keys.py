"""Curves of DOFs for the Curves panel; see ``keyed.KeyedMotion``."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial

from viewer.app.curves.data import channel_of, keyed_values
from viewer.app.curves.state import KeyPlace
from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats
from viewer.rig.motion.clip import Channel, Clip, Tangent, slopes
from viewer.rig.motion.clip_edit import (
    add_key,
    delete_keys,
    key_pose,
    move_keys,
    set_key,
    set_range,
    set_tangent,
    with_channel,
)
from viewer.rig.scene import Actor
from viewer.rig.skeleton import Skeleton

__all__ = ["DofKeys"]


@dataclass(frozen=True, slots=True, eq=False)
class DofKeys:
    """A clip of DOFs, whose rows are those of the DOF table."""

    clip: Clip
    skeleton: Skeleton

    def keys(self, row: int) -> tuple[Floats, Floats] | None:
        """Return the times and values of a curve's keys."""
        channel = channel_of(self.clip, row)
        return None if channel is None else (channel.times, channel.values)

    def slopes(self, row: int) -> Floats | None:
        """Return the slopes at the keys of a curve with at least two keys."""
        channel = channel_of(self.clip, row)
        return None if channel is None or len(channel.times) < 2 else slopes(channel)

    def values(self, rows: tuple[int, ...], times: Floats) -> Floats:
        """Return the values of some curves at many times."""
        return keyed_values(self.clip, rows, times)

    def wraps(self, row: int) -> bool:
        """Return False: angles of DOFs are not limited to one revolution."""
        return False

    def moved(self, places: Iterable[KeyPlace], dt: float, dv: float, gap: float) -> Clip:
        """Move keys together."""
        keys: dict[int, list[int]] = {}
        for row, key in places:
            keys.setdefault(row, []).append(key)
        clip = self.clip
        for row, chosen in keys.items():
            clip = with_channel(clip, row, partial(move_keys, keys=chosen, dt=dt, dv=dv, gap=gap))
        return clip

    def placed(self, place: KeyPlace, time: float | None, value: float | None, gap: float) -> Clip:
        """Set the time or value of one key; a typed time may equal a neighbour's."""
        return self._changed([place[0]], lambda old: set_key(old, place[1], time, value))

    def added(self, rows: Iterable[int], time: float, actor: Actor) -> Clip:
        """Add keys on curves."""
        return self._changed(rows, lambda old: add_key(old, time)[0])

    def deleted(self, places: Iterable[KeyPlace]) -> Clip:
        """Delete keys."""
        clip, places = self.clip, list(places)
        for row in {row for row, _ in places}:
            keys = [key for place, key in places if place == row]
            clip = with_channel(clip, row, partial(delete_keys, keys=keys))
        return clip

    def sloped(self, places: Iterable[KeyPlace], side: int, slope: float) -> Clip:
        """Set the slope on one side of keys."""
        return self.with_tangent(places, side, slope)

    def with_tangent(self, places: Iterable[KeyPlace], side: int, to: Tangent) -> Clip:
        """Set the tangent rule or slope on one side of keys."""
        clip = self.clip
        for row, key in places:
            clip = with_channel(clip, row, partial(set_tangent, key=key, side=side, tangent=to))
        return clip

    def ranged(self, start: float, end: float) -> Clip:
        """Set the playback range, seconds."""
        return set_range(self.clip, start, end)

    def posed(self, actor: Actor, time: float, only_changed: bool) -> Clip:
        """Key an actor's pose at a time."""
        return key_pose(self.clip, self.skeleton, actor.require_pose(), time, only_changed)

    def _changed(self, rows: Iterable[int], change: Callable[[Channel], Channel]) -> Clip:
        clip = self.clip
        for row in rows:
            clip = with_channel(clip, row, change)
        return clip
