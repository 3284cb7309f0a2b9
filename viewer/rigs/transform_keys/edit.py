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

from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.quaternion import align_signs, conjugate, multiply
from viewer.rigs.geometry.rotation import matrix_to_quaternion
from viewer.rigs.motion.clip import Channel, hermite
from viewer.rigs.motion.clip_edit import move_keys, set_key
from viewer.rigs.motion.transform_clip import (
    Interpolation,
    TransformChannel,
    TransformClip,
    TransformPath,
    sample_transforms,
)
from viewer.rigs.pose import Pose, joint_rotations, local_matrices
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.transform_keys.euler_curves import TransformRow, angles_of, from_angles, rows_of

_Place = tuple[int, int]
"""Index of a curve in ``rows_of``, and index of one of its keys."""
_STEEPEST = math.radians(90.0)  # limit of the middle angle, beyond which angles are ambiguous

# Tolerances of times: seconds, and the relative rounding error of single precision in files.
_SAME, _SINGLE = 1e-6, 2.0**-22
_UNCHANGED = 1e-9  # tolerance within which lengths, factors and weights equal their curves

# Tolerance of the difference of unit quaternions, about half the angle in radians.
_SAME_ROTATION = 1e-9


def move_transform_keys(
    clip: TransformClip,
    skeleton: Skeleton,
    places: Iterable[_Place],
    dt: float,
    dv: float,
    gap: float,
) -> TransformClip:
    """Move keys (row, key) by ``dt``, no nearer than ``gap`` > 0 to others, and by ``dv``."""
    for index, chosen in _by_channel(clip, skeleton, places).items():
        channel = clip.channels[index]
        for key, components in chosen.items():
            now = _component_values(channel, skeleton, key)
            wanted = {component: float(now[component]) + dv for component in components}
            channel = _with_value(channel, skeleton, key, wanted)
        times = move_keys(_line(channel), chosen, dt, 0.0, gap).times
        clip = _with_transform_channel(clip, index, replace(channel, times=times))
    return clip


def set_transform_key(
    clip: TransformClip,
    skeleton: Skeleton,
    place: _Place,
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
    return _with_transform_channel(clip, row.channel, channel)


def add_transform_key(
    clip: TransformClip, row: TransformRow, time: float, value: Floats | None = None
) -> TransformClip:
    """Return a clip with a key at a time, or the one there changed; a new channel needs a value.

    ``value`` (C,): a quaternion for rotations; without it, the curve's shape is unchanged.
    """
    if row.channel >= 0:
        channel = added_key(clip.channels[row.channel], time, value)[0]
        return _with_transform_channel(clip, row.channel, channel)
    if value is None:
        return clip
    new = TransformChannel(row.joint, row.path, np.array([time]), value[None])
    return _with_transform_channel(clip, -1, new)


def delete_transform_keys(
    clip: TransformClip, skeleton: Skeleton, places: Iterable[_Place]
) -> TransformClip:
    """Return a clip without some keys; channels without keys are removed."""
    chosen = _by_channel(clip, skeleton, places)
    channels = [
        _without_keys(channel, chosen[index]) if index in chosen else channel
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
    return _with_transform_channel(clip, row.channel, replace(channel, tangents=tangents))


def set_clip_interpolation(
    clip: TransformClip, channels: Iterable[int], mode: Interpolation
) -> TransformClip:
    """Return a clip with the interpolation of some channels changed."""
    for index in channels:
        clip = _with_transform_channel(clip, index, with_interpolation(clip.channels[index], mode))
    return clip


def key_transform_pose(
    clip: TransformClip, figure: Figure, pose: Pose, time: float, only_changed: bool = False
) -> TransformClip:
    """Key a pose at a time, with new channels for what differs from the file's pose.

    ``only_changed``: key only properties that differ from the clip at this time.
    """
    skeleton = figure.require_skeleton()
    now, rest = joint_values(skeleton, pose), figure_pose(figure)
    channels = []
    for channel in clip.channels:
        if channel.shapes is not None:
            value = pose.shape_weights[channel.shapes]
        else:
            value = now[channel.path][channel.joint]
        if not only_changed or _differs(channel.path, value_at(channel, time), value):
            channel = added_key(channel, time, value)[0]
        channels.append(channel)
    channels += _new_joints(clip, skeleton, now, joint_values(skeleton, rest), time)
    channels += _new_weights(clip, pose.shape_weights, rest.shape_weights, time)
    start, end = min(clip.start, time), max(clip.end, time)
    return replace(clip, channels=tuple(channels), start=start, end=end)


def joint_values(skeleton: Skeleton, pose: Pose) -> dict[TransformPath, Floats]:
    """Return the local transforms of a pose as values of keys, by path: (J, 3) and (J, 4)."""
    return {
        "translation": local_matrices(skeleton, pose)[:, :3, 3],
        "rotation": matrix_to_quaternion(joint_rotations(skeleton, pose)),
        "scale": pose.scales.copy(),
    }


def _differs(path: TransformPath, one: Floats, other: Floats) -> bool:
    if path != "rotation":
        return bool(np.abs(one - other).max() > _UNCHANGED)
    apart = min(np.abs(one - other).max(), np.abs(one + other).max())
    return bool(apart > _SAME_ROTATION)


def _new_joints(
    clip: TransformClip,
    skeleton: Skeleton,
    now: dict[TransformPath, Floats],
    rest: dict[TransformPath, Floats],
    time: float,
) -> list[TransformChannel]:
    """Return channels for joints that differ from the file's pose and have none."""
    known = {(channel.path, channel.joint) for channel in clip.channels}
    return [
        TransformChannel(joint, path, np.array([time]), values[joint][None])
        for path, values in now.items()
        for joint in range(skeleton.n_joints)
        if (path, joint) not in known
        and not (skeleton.auxiliary is not None and skeleton.auxiliary[joint])
        and _differs(path, rest[path][joint], values[joint])
    ]


def _new_weights(
    clip: TransformClip, now: Floats, rest: Floats, time: float
) -> list[TransformChannel]:
    """Return a channel for blend shapes that differ from the file's weights and have none."""
    known = {
        shape
        for channel in clip.channels
        if channel.shapes is not None
        for shape in channel.shapes.tolist()
    }
    changed = np.flatnonzero(np.abs(now - rest) > _UNCHANGED).tolist()
    shapes: Ints = np.array([shape for shape in changed if shape not in known], dtype=np.int32)
    if not len(shapes):
        return []
    keys = now[shapes][None]
    return [TransformChannel(-1, "weights", np.array([time]), keys, shapes=shapes)]


def _with_transform_channel(
    clip: TransformClip, index: int, channel: TransformChannel | None
) -> TransformClip:
    """Return a clip with one channel replaced, removed (None), or added (index -1)."""
    channels = list(clip.channels)
    if index < 0:
        channels += [] if channel is None else [channel]
    else:
        channels[index : index + 1] = [] if channel is None else [channel]
    return replace(clip, channels=tuple(channels))


def _by_channel(
    clip: TransformClip, skeleton: Skeleton, places: Iterable[_Place]
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


def value_at(channel: TransformChannel, time: float) -> Floats:
    """Return a channel's value at a time: (C,)."""
    alone = TransformClip("", (channel,), 0.0, 0.0)
    found = sample_transforms(alone, np.array([time]))
    if channel.path == "weights":
        return found.shape_weights[0]
    return {
        "rotation": found.rotations,
        "translation": found.translations,
        "scale": found.scales,
    }[channel.path][0, 0]


def added_key(
    channel: TransformChannel, time: float, value: Floats | None = None
) -> tuple[TransformChannel, int]:
    """Return a channel with a key (C,), changing one that is there, and its index.

    Without a value the curve is unchanged; a cubic key with one gets the slope of its neighbours.
    """
    near = int(np.abs(channel.times - time).argmin())
    is_same = abs(channel.times[near] - time) <= max(_SAME, _SINGLE * abs(time))
    there = near if is_same else -1
    if there >= 0:
        return (channel if value is None else _with_key_value(channel, there, value)), there
    key = int(np.searchsorted(channel.times, time))
    tangent = np.zeros(channel.n_components)
    given = value
    if value is None and channel.tangents is None:
        given = value_at(channel, time)
    elif value is None:
        given, tangent = _spline(channel, time)
    assert given is not None  # given, or computed above
    tangents = channel.tangents
    if tangents is not None:
        tangents = np.insert(tangents, key, np.stack([tangent, tangent]), axis=0)
    added = replace(
        channel,
        times=np.insert(channel.times, key, time),
        values=np.insert(channel.values, key, given, axis=0),
        tangents=tangents,
    )
    return (added if value is None else _with_key_value(added, key, value)), key


def _with_key_value(channel: TransformChannel, key: int, value: Floats) -> TransformChannel:
    """Return a channel with the value of one key changed, and a smooth slope there."""
    values = channel.values.copy()
    values[key] = value
    if channel.path == "rotation" and len(values) > 1:
        # Choose the sign of the quaternion nearer to a neighbour, as cubic interpolation does not.
        neighbour = values[key - 1 if key else 1]
        values[key] *= -1.0 if values[key] @ neighbour < 0.0 else 1.0
    if channel.tangents is None:
        return replace(channel, values=values)
    tangents = channel.tangents.copy()
    tangents[key] = _smooth(channel.times, values)[key]
    return replace(channel, values=values, tangents=tangents)


def _smooth(times: Floats, values: Floats) -> Floats:
    """Return the slopes between each key's neighbours, 0 at both ends: (N, C)."""
    slopes = np.zeros(values.shape)
    if len(times) > 2:
        slopes[1:-1] = (values[2:] - values[:-2]) / (times[2:] - times[:-2])[:, None]
    return slopes


def _spline(channel: TransformChannel, time: float) -> tuple[Floats, Floats]:
    """Return the value and slope of a cubic channel, before normalisation of rotations: (C,)."""
    times, values = channel.times, channel.values
    assert channel.tangents is not None  # the caller has checked for cubic interpolation
    if not times[0] < time < times[-1]:
        return values[0 if time <= times[0] else -1], np.zeros(channel.n_components)
    key = int(np.searchsorted(times, time, side="right")) - 1
    h = float(times[key + 1] - times[key])
    u = (time - float(times[key])) / h
    m0, m1 = h * channel.tangents[key, 1], h * channel.tangents[key + 1, 0]
    a, b = hermite(values[key], values[key + 1], m0, m1)
    return ((a * u + b) * u + m0) * u + values[key], ((3.0 * a * u + 2.0 * b) * u + m0) / h


def _without_keys(channel: TransformChannel, keys: Iterable[int]) -> TransformChannel | None:
    """Return a channel without some keys; None if no key remains."""
    stays = np.ones(len(channel.times), dtype=np.bool_)
    stays[list(keys)] = False
    if not stays.any():
        return None
    tangents = None if channel.tangents is None else channel.tangents[stays]
    return replace(
        channel, times=channel.times[stays], values=channel.values[stays], tangents=tangents
    )


def with_interpolation(channel: TransformChannel, mode: Interpolation) -> TransformChannel:
    """Return a channel with another interpolation; cubic keys get smooth slopes."""
    if mode == channel.interpolation:
        return channel
    if mode != "cubic":
        return replace(channel, interpolation=mode, tangents=None)
    values = channel.values
    if channel.path == "rotation":
        values = values / np.linalg.norm(values, axis=1, keepdims=True)
        align_signs(values)
    slopes = _smooth(channel.times, values)
    tangents = np.stack([slopes, slopes], axis=1)
    return replace(channel, values=values, interpolation=mode, tangents=tangents)
