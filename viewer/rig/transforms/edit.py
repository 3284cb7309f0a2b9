"""Editing of keyed transforms: every function returns a new clip; the original is unchanged.

The three components of a translation, rotation or scale share their keys, and so do the weights of
one channel: keys are moved in time, added and deleted for all of them. The order of keys and
therefore their indices never change: a moved key stops before an unmoved neighbour.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.geometry.quaternion import conjugate, multiply
from viewer.rig.motion.clip import Channel
from viewer.rig.motion.clip_edit import move_keys, set_key
from viewer.rig.motion.transform_clip import Interpolation, TransformChannel, TransformClip
from viewer.rig.skeleton import Skeleton
from viewer.rig.transforms.channel_edit import (
    added_key,
    with_interpolation,
    without_keys,
)
from viewer.rig.transforms.rows import TransformRow, angles_of, from_angles, rows_of

__all__ = [
    "add_transform_key",
    "delete_transform_keys",
    "move_transform_keys",
    "set_clip_interpolation",
    "set_clip_range",
    "set_transform_key",
    "set_transform_slope",
    "with_transform_channel",
]

Place = tuple[int, int]
"""Index of a curve in ``rows_of``, and index of one of its keys."""

_STEEPEST = math.radians(90.0)  # limit of the middle angle, beyond which angles are ambiguous


def with_transform_channel(
    clip: TransformClip, index: int, channel: TransformChannel | None
) -> TransformClip:
    """Return a clip with one channel replaced, removed (None), or added (index -1)."""
    channels = list(clip.channels)
    if index < 0:
        channels += [] if channel is None else [channel]
    else:
        channels[index : index + 1] = [] if channel is None else [channel]
    return replace(clip, channels=tuple(channels))


def move_transform_keys(
    clip: TransformClip,
    skeleton: Skeleton,
    places: Iterable[Place],
    dt: float,
    dv: float,
    gap: float,
) -> TransformClip:
    """Return a clip with some keys moved together.

    Parameters
    ----------
    clip : TransformClip
        The motion, which contains these keys.
    skeleton : Skeleton
        Defines the angles of rotations.
    places : iterable of (row, key)
        Selected keys.
    dt : float
        Seconds; reduced if a key would otherwise come closer than ``gap`` to an unmoved key.
    dv : float
        Change of the value of each selected component: radians, length, factor or weight.
    gap : float
        Minimum distance between keys, seconds, above 0.
    """
    for index, chosen in _by_channel(clip, skeleton, places).items():
        channel = clip.channels[index]
        for key, components in chosen.items():
            now = _component_values(channel, skeleton, key)
            wanted = {component: float(now[component]) + dv for component in components}
            channel = _with_value(channel, skeleton, key, wanted)
        times = move_keys(_line(channel), chosen, dt, 0.0, gap).times
        clip = with_transform_channel(clip, index, replace(channel, times=times))
    return clip


def set_transform_key(
    clip: TransformClip,
    skeleton: Skeleton,
    place: Place,
    time: float | None = None,
    value: float | None = None,
    gap: float = 1e-3,
) -> TransformClip:
    """Return a clip with one key changed; parameters as for ``move_transform_keys``."""
    row, key = rows_of(clip, skeleton)[place[0]], place[1]
    channel = clip.channels[row.channel]
    if value is not None:
        channel = _with_value(channel, skeleton, key, {row.component: value})
    if time is not None:
        channel = replace(channel, times=set_key(_line(channel), key, time, gap=gap).times)
    return with_transform_channel(clip, row.channel, channel)


def add_transform_key(
    clip: TransformClip, row: TransformRow, time: float, value: Floats | None = None
) -> TransformClip:
    """Return a clip with a key added to a channel; an existing key at this time is changed instead.

    Parameters
    ----------
    clip : TransformClip
        The motion.
    row : TransformRow
        Any component; if it has no channel, one is added.
    time : float
        Seconds.
    value : (C,), optional
        Value of the key, a quaternion for rotations; by default the value of the curve, whose shape
        is then unchanged. Required if the row has no channel.
    """
    if row.channel >= 0:
        channel = added_key(clip.channels[row.channel], time, value)[0]
        return with_transform_channel(clip, row.channel, channel)
    if value is None:
        return clip
    new = TransformChannel(row.joint, row.path, np.array([time]), value[None])
    return with_transform_channel(clip, -1, new)


def delete_transform_keys(
    clip: TransformClip, skeleton: Skeleton, places: Iterable[Place]
) -> TransformClip:
    """Return a clip without some keys; channels without keys are removed."""
    chosen = _by_channel(clip, skeleton, places)
    channels = [
        without_keys(channel, chosen[index]) if index in chosen else channel
        for index, channel in enumerate(clip.channels)
    ]
    return replace(clip, channels=tuple(channel for channel in channels if channel is not None))


def set_transform_slope(
    clip: TransformClip, row: TransformRow, key: int, side: int, slope: float
) -> TransformClip:
    """Return a clip with another slope per second at a cubic key: side 0 incoming, 1 outgoing."""
    channel = clip.channels[row.channel]
    if channel.tangents is None:
        return clip
    tangents = channel.tangents.copy()
    tangents[key, side, row.component] = slope
    return with_transform_channel(clip, row.channel, replace(channel, tangents=tangents))


def set_clip_interpolation(
    clip: TransformClip, channels: Iterable[int], mode: Interpolation
) -> TransformClip:
    """Return a clip with the interpolation of some channels changed."""
    for index in channels:
        clip = with_transform_channel(clip, index, with_interpolation(clip.channels[index], mode))
    return clip


def set_clip_range(clip: TransformClip, start: float, end: float) -> TransformClip:
    """Return a clip with a new playback range; the two times are sorted."""
    return replace(clip, start=min(start, end), end=max(start, end))


def _by_channel(
    clip: TransformClip, skeleton: Skeleton, places: Iterable[Place]
) -> dict[int, dict[int, set[int]]]:
    """Return the selected components by channel and key."""
    rows, found = rows_of(clip, skeleton), dict[int, dict[int, set[int]]]()
    for index, key in places:
        row = rows[index]
        if row.channel >= 0:
            found.setdefault(row.channel, {}).setdefault(key, set()).add(row.component)
    return found


def _line(channel: TransformChannel) -> Channel:
    """Return a curve with a channel's key times, which can then be moved like keys of a curve."""
    count = len(channel.times)
    return Channel(0, channel.times, np.zeros(count), (("flat", "flat"),) * count)


def _component_values(channel: TransformChannel, skeleton: Skeleton, key: int) -> Floats:
    if channel.path != "rotation":
        return channel.values[key]
    return angles_of(skeleton, channel.joint, channel.values[key])


def _with_value(
    channel: TransformChannel, skeleton: Skeleton, key: int, wanted: Mapping[int, float]
) -> TransformChannel:
    """Return a channel with some components of one key changed."""
    values = channel.values.copy()
    if channel.path != "rotation":
        for component, value in wanted.items():
            values[key, component] = value
        return replace(channel, values=values)
    angles = _component_values(channel, skeleton, key).copy()
    for component, value in wanted.items():
        angles[component] = np.clip(value, -_STEEPEST, _STEEPEST) if component == 1 else value
    old = values[key].copy()
    new = from_angles(skeleton, channel.joint, angles) * np.linalg.norm(old)
    values[key] = new = -new if new @ old < 0.0 else new
    if channel.tangents is None:
        return replace(channel, values=values)
    # The spline rotates with its key: q' = d q, so its tangents become d t.
    tangents = channel.tangents.copy()
    turn = multiply(new, conjugate(old)) / (old @ old)
    tangents[key] = multiply(turn, tangents[key])
    return replace(channel, values=values, tangents=tangents)
