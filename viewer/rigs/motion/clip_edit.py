"""Editing of keyed clips: every function returns a new channel or clip; the original is unchanged.

The order of keys and therefore their indices never change: a moved key stops at an unmoved
neighbour.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from viewer.rigs.arrays import Floats
from viewer.rigs.motion.clip import (
    SHORTEST,
    Channel,
    Clip,
    Extrapolation,
    Tangent,
    evaluate,
    evaluate_all,
    hermite,
    slopes,
)
from viewer.rigs.motion.transform_clip import TransformClip
from viewer.rigs.pose import Pose
from viewer.rigs.skeleton import Skeleton, clamp_dofs

_SMOOTH: tuple[Tangent, Tangent] = ("smooth", "smooth")
_UNCHANGED = 1e-9  # tolerance, in radians or lengths, within which a DOF equals its curve


def add_key(channel: Channel, time: float, value: float | None = None) -> tuple[Channel, int]:
    """Return a channel with a key at a time, changing one that is there, and its index.

    Without a value, a key between others keeps the curve: it and neighbours whose rules look at
    adjacent keys get their slopes there as numbers. Otherwise its tangents are smooth.
    """
    there = np.flatnonzero(np.abs(channel.times - time) <= SHORTEST)
    if len(there):
        key = int(there[0])
        return channel if value is None else set_key(channel, key, value=value), key
    key = int(np.searchsorted(channel.times, time))
    pairs, tangents = list(channel.tangents), _SMOOTH
    if value is None and 0 < key < len(channel.times):
        slope = slope_at(channel, time)
        tangents = (slope, slope)
        for neighbour in (key - 1, key):
            pairs[neighbour] = _as_numbers(channel, neighbour)
    if value is None:
        value = float(evaluate(channel, np.array(time)))
    added = replace(
        channel,
        times=np.insert(channel.times, key, time),
        values=np.insert(channel.values, key, value),
        tangents=(*pairs[:key], tangents, *pairs[key:]),
    )
    return added, key


def _as_numbers(channel: Channel, key: int) -> tuple[Tangent, Tangent]:
    """Return a key's tangents, with rules that depend on its neighbours converted to slopes."""
    pair = zip(channel.tangents[key], slopes(channel)[key].tolist(), strict=True)
    incoming, outgoing = (
        slope if tangent in ("linear", "smooth") else tangent for tangent, slope in pair
    )
    return incoming, outgoing


def slope_at(channel: Channel, time: float) -> float:
    """Return the derivative of a curve between its keys, value per second; 0 outside them."""
    times = channel.times
    if len(times) < 2 or not times[0] <= time <= times[-1]:
        return 0.0
    key = min(int(np.searchsorted(times, time, side="right")) - 1, len(times) - 2)
    h = float(times[key + 1] - times[key])
    if h <= SHORTEST:
        return 0.0
    edges = slopes(channel)
    u = (time - times[key]) / h
    p0, p1 = channel.values[key], channel.values[key + 1]
    v0, v1 = h * edges[key, 1], h * edges[key + 1, 0]
    a, b = hermite(p0, p1, v0, v1)
    return float(((3.0 * a * u + 2.0 * b) * u + v0) / h)


def move_keys(
    channel: Channel, keys: Iterable[int], dt: float, dv: float, gap: float = 0.0
) -> Channel:
    """Move keys by ``dt`` seconds, less to stay ``gap`` away from unmoved ones, and by ``dv``."""
    moved = np.zeros(len(channel.times), dtype=np.bool_)
    moved[list(keys)] = True
    pairs = np.flatnonzero(moved[1:] != moved[:-1])
    room = np.maximum(np.diff(channel.times)[pairs] - gap, 0.0)
    later = moved[pairs]  # moved keys whose next neighbour is unmoved
    dt = min(dt, float(room[later].min(initial=np.inf)))
    dt = max(dt, -float(room[~later].min(initial=np.inf)))
    times = np.where(moved, channel.times + dt, channel.times)
    # Rounding must not push a key past its neighbour.
    back = np.minimum.accumulate(times[::-1])[::-1]
    times = back if dt > 0.0 else np.maximum.accumulate(times)
    values = np.where(moved, channel.values + dv, channel.values)
    return replace(channel, times=times, values=values)


def set_key(
    channel: Channel,
    key: int,
    time: float | None = None,
    value: float | None = None,
    gap: float = 0.0,
) -> Channel:
    """Return a channel with one key changed; its neighbours limit its time, see ``move_keys``."""
    times, values = channel.times.copy(), channel.values.copy()
    if time is not None:
        now = channel.times[key]
        if key > 0:
            time = max(time, times[key - 1] + min(gap, now - times[key - 1]))
        if key + 1 < len(times):
            time = min(time, times[key + 1] - min(gap, times[key + 1] - now))
        times[key] = time
    if value is not None:
        values[key] = value
    return replace(channel, times=times, values=values)


def delete_keys(channel: Channel, keys: Iterable[int]) -> Channel:
    """Return a channel without the given keys; the tangents of other keys are unchanged."""
    stays = np.ones(len(channel.times), dtype=np.bool_)
    stays[list(keys)] = False
    return replace(
        channel,
        times=channel.times[stays],
        values=channel.values[stays],
        tangents=tuple(channel.tangents[key] for key in np.flatnonzero(stays)),
    )


def set_tangent(channel: Channel, key: int, side: int, tangent: Tangent) -> Channel:
    """Set a rule or finite slope on one side of a key, 0 incoming, 1 outgoing; else RigError."""
    pairs = list(channel.tangents)
    incoming, outgoing = pairs[key]
    pairs[key] = (incoming, tangent) if side else (tangent, outgoing)
    return replace(channel, tangents=tuple(pairs))


def set_extrapolation(channel: Channel, side: int, mode: Extrapolation) -> Channel:
    """Return a channel with a new extrapolation before (side 0) or after (side 1) its keys."""
    before, after = channel.extrapolation
    return replace(channel, extrapolation=(before, mode) if side else (mode, after))


def with_channel(clip: Clip, target: int, change: Callable[[Channel], Channel]) -> Clip:
    """Return a clip with one channel changed, or added if the DOF has none yet."""
    known = {channel.target for channel in clip.channels}
    if target not in known:
        channels = (*clip.channels, change(_no_keys(target)))
        return replace(clip, channels=tuple(sorted(channels, key=lambda channel: channel.target)))
    return replace(
        clip,
        channels=tuple(
            change(channel) if channel.target == target else channel for channel in clip.channels
        ),
    )


def _no_keys(target: int) -> Channel:
    return Channel(target, np.zeros(0), np.zeros(0), ())


_Keyed = TypeVar("_Keyed", Clip, TransformClip)


def set_range(clip: _Keyed, start: float, end: float) -> _Keyed:
    """Return a clip with a new playback range; the two times are sorted."""
    return replace(clip, start=min(start, end), end=max(start, end))


def empty_clip(skeleton: Skeleton, name: str, start: float = 0.0, end: float = 1.0) -> Clip:
    """Return a clip with a channel without keys for every DOF; such channels evaluate to 0."""
    return Clip(name, tuple(map(_no_keys, range(skeleton.n_dofs))), start, end)


def clip_from_pose(
    skeleton: Skeleton, pose: Pose, name: str, start: float = 0.0, end: float = 1.0
) -> Clip:
    """Return a clip with one key per DOF, at its start: a constant pose."""
    return key_pose(empty_clip(skeleton, name, start, end), skeleton, pose, start)


def key_pose(
    clip: Clip, skeleton: Skeleton, pose: Pose, time: float, only_changed: bool = False
) -> Clip:
    """Key a pose's DOFs at a time; ``only_changed``: those that differ from the clamped clip."""
    targets, values = evaluate_all(clip, np.array([time]))
    now = np.zeros(skeleton.n_dofs)
    now[targets] = values[0]
    changed = np.abs(clamp_dofs(skeleton, now) - pose.dofs) > _UNCHANGED
    channels = {channel.target: channel for channel in clip.channels}
    for dof in range(skeleton.n_dofs):
        if changed[dof] or not only_changed:
            channel = channels.get(dof) or _no_keys(dof)
            channels[dof] = add_key(channel, time, float(pose.dofs[dof]))[0]
    return Clip(
        clip.name,
        tuple(channels[dof] for dof in sorted(channels)),
        min(clip.start, time),
        max(clip.end, time),
    )


def clip_from_frames(name: str, dofs: Floats, times: Floats, rule: Tangent = "linear") -> Clip:
    """Return a clip with a key per frame from (F, D) DOFs, F > 0; one key if a DOF is constant."""
    times, dofs = np.asarray(times, dtype=np.float64), np.asarray(dofs, dtype=np.float64)
    channels = tuple(_from_frames(dof, times, column, rule) for dof, column in enumerate(dofs.T))
    return Clip(name, channels, *times[[0, -1]].tolist())


def _from_frames(dof: int, times: Floats, values: Floats, rule: Tangent) -> Channel:
    count = 1 if (values == values[0]).all() else len(times)
    pairs: Sequence[tuple[Tangent, Tangent]] = ((rule, rule),) * count
    return Channel(dof, times[:count], values[:count], tuple(pairs))
