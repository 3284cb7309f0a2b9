"""Arrays of all keys of a transform clip, laid out for evaluation without loops over channels."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats, Ints
from viewer.rig.motion.transform_clip import TRANSFORM_PATHS, TransformChannel, TransformPath

__all__ = ["Arcs", "Curves", "Targets", "Timelines", "TransformTable", "transform_table"]

_SMALLEST = 1e-9  # angle in radians below which slerp equals linear interpolation


@dataclass(frozen=True, slots=True, eq=False)
class Timelines:
    """U distinct lists of key times; most channels of a file share one.

    Attributes
    ----------
    times : (K,)
        Seconds of all keys, one timeline after the other.
    first : (U,)
        Index of each timeline's first key.
    durations : (K,)
        Seconds until the next key of the timeline, inf after its last key.
    union : (M,)
        All distinct times, increasing.
    ends : (U,) int64
        u (M + 1) of each timeline u.
    ranks : (K,) int64
        For a key of timeline u, ``ends`` + the number of times of ``union`` up to the key. It is
        increasing, so one search finds the spans of all timelines.
    """

    times: Floats
    first: Ints
    durations: Floats
    union: Floats
    ends: NDArray[np.int64]
    ranks: NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Arcs:
    """R rotations that follow arcs between their keys, or stay at the earlier key.

    Attributes
    ----------
    timelines : (R,)
        Timelines.
    bases : (R,)
        Row of each rotation's first key.
    slopes : (R,)
        1 for arcs, 0 for steps, which stay at the earlier key.
    keys : (N, 4)
        Unit quaternions with signs such that neighbours are less than 180 degrees apart. The last
        key of each channel is repeated, so that every key has a successor.
    angles, sines : (N,)
        Angle of the arc to the next key, and its sine.
    """

    timelines: Ints
    bases: Ints
    slopes: Floats
    keys: Floats
    angles: Floats
    sines: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Curves:
    """C components of channels, each a scalar curve of lines, steps or cubic splines.

    Attributes
    ----------
    timelines : (C,)
        Timelines.
    bases, strides : (C,)
        Index of each component's first value, and the step from one value to the next.
    slopes : (C,)
        1 for lines, 0 for steps; empty for cubic curves.
    values : (N,)
        All values; the last key of each channel is repeated.
    incoming, outgoing : (N,)
        Slopes per second at the same indices; empty for lines and steps.
    """

    timelines: Ints
    bases: Ints
    strides: Ints
    slopes: Floats
    values: Floats
    incoming: Floats
    outgoing: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """Joints or shapes animated by one path, in the order of the samples.

    Attributes
    ----------
    indices : (N,) int32
        Joints, or blend shapes.
    lines, cubics : slice
        Components among the lines and steps, and among the cubic curves; lines come first.
    """

    indices: Ints
    lines: slice
    cubics: slice


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class TransformTable:
    """All keys of a clip, and the targets of each path."""

    timelines: Timelines
    arcs: Arcs
    lines: Curves
    cubics: Curves
    targets: dict[TransformPath, Targets]


def transform_table(channels: Sequence[TransformChannel]) -> TransformTable:
    """Lay out the keys of channels: arcs of rotations, then lines and splines by path."""
    timelines, of_channel = _timelines([channel.times for channel in channels])
    numbered = list(zip(channels, of_channel, strict=True))

    def chosen(wanted: Callable[[TransformChannel], bool]) -> list[tuple[TransformChannel, int]]:
        # Sorting by path makes the components of each path adjacent.
        found = [one for one in numbered if wanted(one[0])]
        return sorted(found, key=lambda one: TRANSFORM_PATHS.index(one[0].path))

    arcs = chosen(lambda one: one.path == "rotation" and one.interpolation != "cubic")
    lines = chosen(lambda one: one.path != "rotation" and one.interpolation != "cubic")
    cubics = chosen(lambda one: one.interpolation == "cubic")
    targets = {
        path: _targets(path, [one for one, _ in arcs], [one for one, _ in lines],
                       [one for one, _ in cubics])
        for path in TRANSFORM_PATHS
    }  # fmt: skip
    return TransformTable(timelines, _arcs(arcs), _curves(lines), _curves(cubics), targets)


def _timelines(every: Sequence[Floats]) -> tuple[Timelines, list[int]]:
    """Return the distinct lists of times, and each channel's index into them."""
    known: dict[bytes, int] = {}
    of_channel = [known.setdefault(times.tobytes(), len(known)) for times in every]
    parts = [np.frombuffer(raw, dtype=np.float64) for raw in known]
    counts = np.array([len(part) for part in parts], dtype=np.int64)
    last = np.cumsum(counts) - 1
    first = last + 1 - counts
    times = np.concatenate([np.zeros(0), *parts])
    durations = np.append(np.diff(times), np.inf)[: len(times)]
    durations[last] = np.inf
    union = np.unique(times)
    ends = np.arange(len(parts), dtype=np.int64) * (len(union) + 1)
    ranks = np.repeat(ends, counts) + np.searchsorted(union, times, side="right")
    timelines = Timelines(times, first.astype(np.int32), durations, union, ends, ranks)
    return timelines, of_channel


def _arcs(channels: list[tuple[TransformChannel, int]]) -> Arcs:
    parts = [part for one, _ in channels for part in (one.values, one.values[-1:])]
    keys: Floats = np.concatenate([np.zeros((0, 4)), *parts])
    keys /= np.linalg.norm(keys, axis=1, keepdims=True)
    counts = np.array([len(one.values) + 1 for one, _ in channels], dtype=np.int64)
    bases = np.cumsum(counts) - counts
    is_first = np.zeros(len(keys), dtype=np.bool_)
    is_first[bases] = True
    # A quaternion and its negative are the same rotation; the nearer one yields the shorter arc.
    far = np.zeros(len(keys), dtype=np.int64)
    far[1:] = np.einsum("na,na->n", keys[1:], keys[:-1]) < 0.0
    far[is_first] = 0
    flips = np.cumsum(far)
    flips -= np.repeat(flips[bases], counts)
    keys[flips % 2 != 0] *= -1.0
    chords = np.zeros(len(keys))
    chords[:-1] = np.where(is_first[1:], 0.0, np.linalg.norm(np.diff(keys, axis=0), axis=1))
    # The chord is accurate at small angles, whereas the arccosine loses half the digits.
    angles = np.maximum(2.0 * np.arcsin(np.minimum(0.5 * chords, 1.0)), _SMALLEST)
    return Arcs(
        np.array([timeline for _, timeline in channels], dtype=np.int32),
        bases.astype(np.int32),
        np.array([float(one.interpolation != "step") for one, _ in channels]),
        keys,
        angles,
        np.sin(angles),
    )


def _curves(channels: list[tuple[TransformChannel, int]]) -> Curves:
    of_component: list[tuple[int, int, int, float]] = []
    values, incoming, outgoing = [np.zeros(0)], [np.zeros(0)], [np.zeros(0)]
    start = 0
    for channel, timeline in channels:
        width, slope = channel.n_components, float(channel.interpolation != "step")
        of_component += [(timeline, start + part, width, slope) for part in range(width)]
        values.append(np.concatenate([channel.values, channel.values[-1:]]).ravel())
        if channel.tangents is not None:
            tangents = np.concatenate([channel.tangents, channel.tangents[-1:]])
            incoming.append(tangents[:, 0].ravel())
            outgoing.append(tangents[:, 1].ravel())
        start += values[-1].size
    table = np.array(of_component, dtype=np.float64).reshape(-1, 4)
    timelines, bases, strides = table[:, :3].astype(np.int64).T
    parts = (np.concatenate(part) for part in (values, incoming, outgoing))
    return Curves(timelines, bases, strides, table[:, 3].copy(), *parts)


def _targets(
    path: str,
    arcs: list[TransformChannel],
    lines: list[TransformChannel],
    cubics: list[TransformChannel],
) -> Targets:
    """Return the targets of a path: targets of arcs or lines first, then of cubic curves."""
    plain = arcs if path == "rotation" else lines
    indices = [np.zeros(0, dtype=np.int32)]
    for channel in (*plain, *cubics):
        if channel.path == path:
            own = np.array([channel.joint]) if channel.shapes is None else channel.shapes
            indices.append(own.astype(np.int32))
    return Targets(
        np.concatenate(indices),
        slice(0, 0) if path == "rotation" else _components(path, lines),
        _components(path, cubics),
    )


def _components(path: str, channels: list[TransformChannel]) -> slice:
    """Return the range of a path's components among all components of ordered channels."""
    widths = [(channel.path, channel.n_components) for channel in channels]
    place = TRANSFORM_PATHS.index
    start = sum(width for other, width in widths if place(other) < place(path))
    return slice(start, start + sum(width for other, width in widths if other == path))
