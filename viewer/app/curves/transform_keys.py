"""Curves of keyed transforms for the Curves panel; see ``keyed.KeyedMotion``."""

from __future__ import annotations

from collections.abc import Iterable

from viewer.app.curves.state import KeyPlace
from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats
from viewer.rig.motion.transform_clip import Interpolation, TransformChannel, TransformClip
from viewer.rig.scene import Actor
from viewer.rig.skeleton import Skeleton
from viewer.rig.transforms.edit import (
    add_transform_key,
    delete_transform_keys,
    move_transform_keys,
    set_clip_interpolation,
    set_clip_range,
    set_transform_key,
    set_transform_slope,
)
from viewer.rig.transforms.keying import joint_values, key_transform_pose
from viewer.rig.transforms.rows import TransformRow, key_values, row_values, rows_of

__all__ = ["TransformKeys"]


@dataclass(frozen=True, slots=True, eq=False)
class TransformKeys:
    """A clip of transforms, whose rows are indices into ``rows_of``."""

    clip: TransformClip
    skeleton: Skeleton

    def row(self, row: int) -> TransformRow:
        """Return the component that a curve shows."""
        return rows_of(self.clip, self.skeleton)[row]

    def channel(self, row: int) -> TransformChannel | None:
        """Return the channel of a curve; None for rotations without keys."""
        index = self.row(row).channel
        return None if index < 0 else self.clip.channels[index]

    def keys(self, row: int) -> tuple[Floats, Floats] | None:
        """Return the times and values of a curve's keys."""
        channel = self.channel(row)
        if channel is None:
            return None
        return channel.times, key_values(channel, self.skeleton)[:, self.row(row).component]

    def slopes(self, row: int) -> Floats | None:
        """Return the slopes at cubic keys; None for rotations, whose angles have other slopes."""
        channel = self.channel(row)
        if channel is None or channel.tangents is None or channel.path == "rotation":
            return None
        return channel.tangents[:, :, self.row(row).component]

    def values(self, rows: tuple[int, ...], times: Floats) -> Floats:
        """Return the values of some curves at many times."""
        return row_values(self.clip, self.skeleton, rows, times)

    def wraps(self, row: int) -> bool:
        """Return whether a curve is an angle, which jumps by full rotations."""
        return self.row(row).path == "rotation"

    def moved(self, places: Iterable[KeyPlace], dt: float, dv: float, gap: float) -> TransformClip:
        """Move keys together, including all components that share them."""
        return move_transform_keys(self.clip, self.skeleton, places, dt, dv, gap)

    def placed(
        self, place: KeyPlace, time: float | None, value: float | None, gap: float
    ) -> TransformClip:
        """Set the time or value of one key."""
        return set_transform_key(self.clip, self.skeleton, place, time, value, gap)

    def added(self, rows: Iterable[int], time: float, actor: Actor) -> TransformClip:
        """Add keys on curves; rotations without keys get the values of the actor's pose."""
        clip, now = self.clip, joint_values(self.skeleton, actor.require_pose())
        # The components of a channel share their keys.
        wanted = {(row.path, row.joint, row.channel): row for row in map(self.row, rows)}
        for row in wanted.values():
            value = now[row.path][row.joint] if row.channel < 0 else None
            clip = add_transform_key(clip, row, time, value)
        return clip

    def deleted(self, places: Iterable[KeyPlace]) -> TransformClip:
        """Delete keys, including all components that share them."""
        return delete_transform_keys(self.clip, self.skeleton, places)

    def sloped(self, places: Iterable[KeyPlace], side: int, slope: float) -> TransformClip:
        """Set the slope on one side of cubic keys."""
        clip = self.clip
        for row, key in places:
            clip = set_transform_slope(clip, self.row(row), key, side, slope)
        return clip

    def interpolated(self, rows: Iterable[int], mode: Interpolation) -> TransformClip:
        """Set the interpolation of the channels of some curves."""
        channels = sorted({self.row(row).channel for row in rows} - {-1})
        return set_clip_interpolation(self.clip, channels, mode)

    def ranged(self, start: float, end: float) -> TransformClip:
        """Set the playback range, seconds."""
        return set_clip_range(self.clip, start, end)

    def posed(self, actor: Actor, time: float, only_changed: bool) -> TransformClip:
        """Key an actor's pose at a time."""
        pose = actor.require_pose()
        return key_transform_pose(self.clip, actor.figure, pose, time, only_changed)
