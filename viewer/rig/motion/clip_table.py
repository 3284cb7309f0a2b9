"""Vectorised evaluation of keyed curves: many channels at many times, without Python loops."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.memo import Memo
from viewer.rig.motion.clip import EXTRAPOLATIONS, SHORTEST, Channel, Clip, slopes

__all__ = ["evaluate_all", "evaluate_channels"]

_MODES: dict[str, int] = {mode: index for index, mode in enumerate(EXTRAPOLATIONS)}


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class _Table:
    """C channels with up to K keys; unused keys are at infinity."""

    targets: Ints  # (C,)
    times: Floats  # (C, K)
    values: Floats  # (C, K)
    edges: Floats  # (C, K, 2), incoming and outgoing slopes
    last: Ints  # (C,), index of the last key
    modes: Ints  # (C, 2)


_tables: Memo[Clip, _Table] = Memo(kept=1)


def evaluate_all(clip: Clip, times: Floats) -> tuple[Ints, Floats]:
    """Return the values of all curves of a clip at many times; see ``clip_sampling.evaluate``.

    Parameters
    ----------
    clip : Clip
        Clip with C channels that have keys.
    times : (T,)
        Seconds.

    Returns
    -------
    targets : (C,)
        Rows of the skeleton's DOF table.
    values : (T, C)
        Lengths or radians; channels without keys are 0.
    """
    table = _tables.get(clip, (), lambda: _table(clip.channels))
    return table.targets, _values(table, np.atleast_1d(times))


def evaluate_channels(channels: Sequence[Channel], times: Floats) -> Floats:
    """Return the values of some curves at many times, uncached: (T, C) for times (T,)."""
    return _values(_table(channels), times)


def _values(table: _Table, times: Floats) -> Floats:
    times = np.asarray(times, dtype=np.float64)[:, None]
    if not len(table.targets):
        return np.zeros((len(times), 0))
    every = np.arange(len(table.targets))
    first, last = table.times[:, 0], table.times[every, table.last]
    at_first, at_last = table.values[:, 0], table.values[every, table.last]
    is_flat = last - first <= SHORTEST
    inside, shift = _inside(table, times, first, last, np.where(is_flat, 1.0, last - first))
    # End values are returned unchanged; of simultaneous keys, the outermost is used.
    values = np.where(inside >= last, at_last, _hermite(table, inside))
    values = np.where((inside <= first) & (times < first), at_first, values) + shift
    return np.where(is_flat, at_last, values)


def _table(channels: Sequence[Channel]) -> _Table:
    width = max((len(channel.times) for channel in channels), default=0)
    count, width = len(channels), max(width, 1)
    times = np.full((count, width), np.inf)
    values, edges = np.zeros((count, width)), np.zeros((count, width, 2))
    last = np.zeros(count, dtype=np.int32)
    modes = np.zeros((count, 2), dtype=np.int32)
    for row, channel in enumerate(channels):
        keys = len(channel.times)
        if keys:
            times[row, :keys], values[row, :keys] = channel.times, channel.values
            edges[row, :keys] = slopes(channel)
            last[row] = keys - 1
        else:
            times[row, 0] = 0.0  # a curve without keys is 0 everywhere
        modes[row] = [_MODES[mode] for mode in channel.extrapolation]
    targets = np.array([channel.target for channel in channels], dtype=np.int32)
    return _Table(targets, times, values, edges, last, modes)


def _inside(
    table: _Table, times: Floats, first: Floats, last: Floats, period: Floats
) -> tuple[Floats, Floats]:
    """Return each curve's time mapped into its key range, and its value offset: (T, C)."""
    every = np.arange(len(table.targets))
    inside = np.clip(times, first, last)
    shift = np.zeros(inside.shape)
    # The remainder is exact even for distant times and short periods.
    cycles, rest = np.divmod(times - first, period)
    folded = np.minimum(first + rest, last)
    mirrored = np.where(cycles % 2 != 0, first + last - folded, folded)
    rise = table.values[every, table.last] - table.values[:, 0]
    ends = ((times < first, 0, first, table.edges[:, 0, 0]),
            (times > last, 1, last, table.edges[every, table.last, 1]))  # fmt: skip
    for outside, side, end, slope in ends:

        def where(mode: str, outside: Bools = outside, side: int = side) -> Bools:
            return outside & (table.modes[:, side] == _MODES[mode])

        shift = np.where(where("linear"), slope * (times - end), shift)
        shift = np.where(where("cycle_offset"), cycles * rise, shift)
        inside = np.where(where("cycle") | where("cycle_offset"), folded, inside)
        inside = np.where(where("bounce"), mirrored, inside)
    return inside, shift


def _spans(table: _Table, times: Floats) -> Ints:
    """Return the index of the key before each time: (T, C)."""
    most = np.maximum(table.last - 1, 0)
    if len(times) * table.times.size <= 1 << 16:
        found = (table.times <= times[:, :, None]).sum(axis=2) - 1
    else:
        columns = [
            np.searchsorted(keys, column, side="right") - 1
            for keys, column in zip(table.times, times.T, strict=True)
        ]
        found = np.stack(columns, axis=1)
    return np.clip(found, 0, most)


def _hermite(table: _Table, times: Floats) -> Floats:
    span = _spans(table, times)
    every = np.arange(len(table.targets))
    following = np.minimum(span + 1, table.last)
    start = table.times[every, span]
    duration = table.times[every, following] - start
    u = np.divide(times - start, duration, out=np.zeros(times.shape), where=duration > SHORTEST)
    p0, p1 = table.values[every, span], table.values[every, following]
    v0, v1 = duration * table.edges[every, span, 1], duration * table.edges[every, following, 0]
    a, b = 2.0 * p0 - 2.0 * p1 + v0 + v1, -3.0 * p0 + 3.0 * p1 - 2.0 * v0 - v1
    return ((a * u + b) * u + v0) * u + p0
