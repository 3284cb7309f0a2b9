"""Edits of one channel of keyed transforms; each returns a new channel."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.motion.transform_clip import Interpolation, TransformChannel, TransformClip
from viewer.rig.transforms.sampling import sample_transforms

__all__ = ["added_key", "key_at", "value_at", "with_interpolation", "without_keys"]

# Tolerances of times: seconds, and the relative rounding error of single precision in files.
_SAME, _SINGLE = 1e-6, 2.0**-22


def key_at(channel: TransformChannel, time: float) -> int:
    """Return the key at a time, within the rounding errors of files; -1 if there is none."""
    near = int(np.abs(channel.times - time).argmin())
    is_same = abs(channel.times[near] - time) <= max(_SAME, _SINGLE * abs(time))
    return near if is_same else -1


def value_at(channel: TransformChannel, time: float) -> Floats:
    """Return a channel's value at a time: (C,)."""
    alone = TransformClip("", (channel,), 0.0, 0.0)
    found = sample_transforms(alone, np.array([time]))
    if channel.path == "weights":
        return found.weights[0]
    return {
        "rotation": found.rotations,
        "translation": found.translations,
        "scale": found.scales,
    }[channel.path][0, 0]


def added_key(
    channel: TransformChannel, time: float, value: Floats | None = None
) -> tuple[TransformChannel, int]:
    """Return a channel with one more key, and its index.

    Parameters
    ----------
    channel : TransformChannel
        With any interpolation.
    time : float
        Seconds. An existing key at this time is changed instead.
    value : (C,), optional
        Its value; by default the shape of the curve is unchanged. A cubic key with a value gets the
        slope between its neighbours.
    """
    there = key_at(channel, time)
    if there >= 0:
        return (channel if value is None else _with_value(channel, there, value)), there
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
    return (added if value is None else _with_value(added, key, value)), key


def _with_value(channel: TransformChannel, key: int, value: Floats) -> TransformChannel:
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
    p0, p1 = values[key], values[key + 1]
    m0, m1 = h * channel.tangents[key, 1], h * channel.tangents[key + 1, 0]
    a, b = 2.0 * p0 - 2.0 * p1 + m0 + m1, -3.0 * p0 + 3.0 * p1 - 2.0 * m0 - m1
    return ((a * u + b) * u + m0) * u + p0, ((3.0 * a * u + 2.0 * b) * u + m0) / h


def without_keys(channel: TransformChannel, keys: Iterable[int]) -> TransformChannel | None:
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
        far = np.einsum("na,na->n", values[1:], values[:-1]) < 0.0
        values[1:] *= np.where(np.cumsum(far) % 2 != 0, -1.0, 1.0)[:, None]
    slopes = _smooth(channel.times, values)
    tangents = np.stack([slopes, slopes], axis=1)
    return replace(channel, values=values, interpolation=mode, tangents=tangents)
