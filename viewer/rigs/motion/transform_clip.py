"""Keyed transforms: keys of translation, rotation, scale and shape weights, as in glTF and FBX.

With their evaluation: slerp, linear, step and cubic interpolation (glTF 2.0).

An ``Animation`` names such a clip before its keys are read, on first playback.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Floats, Ints, freeze_fields
from viewer.rigs.memo import Memo
from viewer.rigs.motion.samples import Samples
from viewer.rigs.motion.timing import DEFAULT_RATE, check_range

if TYPE_CHECKING:
    from viewer.rigs.skeleton import Skeleton

TransformPath = Literal["translation", "rotation", "scale", "weights"]
TRANSFORM_PATHS: tuple[TransformPath, ...] = get_args(TransformPath)
"""Properties that keys can change."""
Interpolation = Literal["step", "linear", "cubic"]
INTERPOLATIONS: tuple[Interpolation, ...] = get_args(Interpolation)
"""Values between keys: the earlier value, a line (slerp for rotations), or a cubic Hermite
spline."""
_COMPONENTS = {"translation": 3, "rotation": 4, "scale": 3}
_SMALLEST = 1e-9  # angle in radians below which slerp equals linear interpolation

# Usual rates, the most likely first: few keys lie on the frames of several.
_RATES = (DEFAULT_RATE, 24.0, 25.0, 60.0, 120.0, 50.0, 100.0, 48.0, 90.0, 240.0)
_BROADCAST = tuple(1000.0 * rate / 1001.0 for rate in (30.0, 24.0, 60.0, 120.0))
_ON_FRAME = 1e-3  # tolerance in frames
_SINGLE = 2.0**-24  # relative rounding error of times, which files store in single precision
_FASTEST = 1000.0  # keys that are closer are at irregular times
_SLOWEST = 24.0  # keys that are further apart have frames between them
_RECORDED = 0.5  # minimum fraction of frames with keys of a motion at another rate than stated
_rates: Memo[TransformClip, float] = Memo()
_tables: Memo[TransformClip, _TransformTable] = Memo(kept=1)


@dataclass(frozen=True, slots=True, eq=False)
class TransformChannel:
    """Keys of one property of a joint or of blend shapes; constant beyond its ends (glTF 3.11)."""

    joint: int
    """Joint that moves; -1 for ``"weights"``."""
    path: TransformPath
    """Entry of ``TRANSFORM_PATHS``."""
    times: Floats
    """(N,). Seconds, increasing; N > 0."""
    values: Floats
    """(N, C). Translation relative to the parent joint (rest translation included), quaternion (x,
    y, z, w) including the rest rotation, scale factors, or shape weights."""
    interpolation: Interpolation = "linear"
    """Entry of ``INTERPOLATIONS``. Linear rotations follow the shorter arc; cubic ones are
    normalised after interpolation."""
    tangents: Floats | None = None
    """(N, 2, C) or None. Incoming and outgoing slopes, per second; only for ``"cubic"``."""
    shapes: Ints | None = None
    """(C,) int32 or None. Blend shape of each component; only for ``"weights"``."""
    key_times: Floats | None = None
    """(K,) or None. Seconds of the file's own keys, if the reader added others between them."""

    def __post_init__(self) -> None:
        if self.path not in TRANSFORM_PATHS or self.interpolation not in INTERPOLATIONS:
            raise RigError(f"channel: found {self.path!r} with {self.interpolation!r}")
        freeze_fields(self, times=(None,))
        count = len(self.times)
        freeze_fields(self, values=(count, _COMPONENTS.get(self.path)))
        if count == 0 or (self.times[1:] <= self.times[:-1]).any():
            raise RigError("times: expected increasing seconds of at least one key")
        if (self.tangents is not None) != (self.interpolation == "cubic"):
            raise RigError("tangents: expected for cubic interpolation, and only there")
        freeze_fields(self, tangents=(count, 2, self.n_components))
        if (self.shapes is not None) != (self.path == "weights"):
            raise RigError("shapes: expected for weights, and only there")
        freeze_fields(self, np.int32, shapes=(self.n_components,))
        freeze_fields(self, key_times=(None,))
        if self.path == "rotation" and not self.values.any(axis=1).all():
            key = int(np.argmin(self.values.any(axis=1)))
            raise RigError(f"values of key {key}: expected a quaternion, found 0 0 0 0")

    @property
    def own_times(self) -> Floats:
        """Seconds of the keys that the file has: (K,)."""
        return self.times if self.key_times is None else self.key_times

    @property
    def n_components(self) -> int:
        """Number of values per key, C."""
        return int(self.values.shape[1])


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class TransformClip:
    """A motion of one figure, as keys of joint transforms and shape weights."""

    kind: ClassVar[Literal["transforms"]] = "transforms"
    timing: ClassVar[None] = None
    """Keys have their own times."""
    points: ClassVar[None] = None
    """Joints move."""
    name: str
    """Display name."""
    channels: tuple[TransformChannel, ...]
    """At most one per joint and path; properties without a channel have their values in the
    pose."""
    start: float
    end: float
    """Playback range in seconds."""
    extras: Any = None
    """Application data of its file, as parsed from JSON; None if there is none."""
    number: int = -1
    """Index of its animation in the file, which may move several figures; -1 if unknown."""
    stated_rate: float | None = None
    """Frames per second that the file states; None if it states none."""

    def __post_init__(self) -> None:
        check_range(self, self.name, self.start, self.end)

    @property
    def n_keys(self) -> int:
        """Number of keys of all channels."""
        return sum(len(channel.times) for channel in self.channels)

    @property
    def sets_shape(self) -> bool:
        """Whether it sets weights of blend shapes."""
        return any(channel.path == "weights" for channel in self.channels)

    @property
    def frame_rate(self) -> float:
        """Frames per second; see ``key_rate``."""
        return key_rate(self)

    def sample(
        self, skeleton: Skeleton | None, times: Floats, interpolate: bool = False
    ) -> Samples:
        """Return what the channels set at times (T,), in seconds; see ``sample_transforms``."""
        found = sample_transforms(self, times)
        if skeleton is None or not len(found.translated):
            return found
        rest = skeleton.rest_translations[found.translated]
        return replace(found, translations=found.translations - rest)


class Animation:
    """An animation of a figure.

    ``name``: as in the file; may repeat or be empty. ``start``, ``end``: seconds. ``read``: returns
    the keys, or raises a ``FormatError``; called at most once. ``place``: JSON pointer in the file;
    empty if unknown. ``number``: index in its file, which may move several figures; -1 if unknown.
    """

    __slots__ = ("_clip", "_read", "end", "name", "number", "place", "start")

    def __init__(
        self,
        name: str,
        start: float,
        end: float,
        read: Callable[[], TransformClip],
        place: str = "",
        number: int = -1,
    ) -> None:
        self.name, self.start, self.end, self._read = name, start, end, read
        self.place, self.number = place, number
        self._clip: TransformClip | None = None

    def plays(self, clip: object) -> bool:
        """Return whether a motion is the clip of this animation."""
        return clip is not None and clip is self._clip

    def clip(self) -> TransformClip:
        """Return the motion, always the same object; FormatError if its keys cannot be read."""
        if self._clip is None:
            self._clip = self._read()
        return self._clip


# Evaluation. The keys of all channels are laid out in a table once. One search then finds the spans
# of all distinct lists of key times, and each kind of interpolation is a few operations on whole
# arrays.


def sample_transforms(clip: TransformClip, times: Floats) -> Samples:
    """Return all channels at times (T,), exactly the keys at theirs; translations include rest."""
    table = _tables.get(clip, (), lambda: _transform_table(clip.channels))
    times = np.atleast_1d(np.asarray(times, dtype=np.float64))
    spans, fractions = _places(table.timelines, times)
    arcs = _arcs(table.arcs, spans, fractions)
    lines = _lines(table.lines, spans, fractions)
    cubics = np.zeros((len(times), 0))
    if len(table.cubics.timelines):
        cubics = _cubics(table.cubics, table.timelines, spans, fractions)

    def part(path: TransformPath, width: int) -> Floats:
        targets, count = table.targets[path], len(times)
        plain = arcs if path == "rotation" else lines[:, targets.lines].reshape(count, -1, width)
        curved = cubics[:, targets.cubics].reshape(count, -1, width)
        if path == "rotation" and curved.shape[1]:
            curved = _normalised(curved)
        return np.concatenate([plain, curved], axis=1) if curved.shape[1] else plain

    indices = {path: targets.indices for path, targets in table.targets.items()}
    return Samples(
        np.ones(len(times), dtype=np.bool_),
        rotated=indices["rotation"],
        rotations=part("rotation", 4),
        translated=indices["translation"],
        translations=part("translation", 3),
        scaled=indices["scale"],
        scales=part("scale", 3),
        weighted=indices["weights"],
        shape_weights=part("weights", 1)[..., 0],
    )


def _places(timelines: _Timelines, times: Floats) -> tuple[Ints, Floats]:
    """Return the key before each time, and the fraction of the span elapsed since: (T, U)."""
    passed = np.searchsorted(timelines.union, times, side="right")
    keys = np.searchsorted(timelines.ranks, timelines.ends + passed[:, None], side="right") - 1
    keys = np.maximum(keys, timelines.first)
    spans = keys - timelines.first
    fractions = (times[:, None] - timelines.times.take(keys)) / timelines.durations.take(keys)
    # Before the first key the difference is negative; after the last one the duration is infinite.
    return spans, np.maximum(fractions, 0.0)


def _arcs(arcs: _Arcs, spans: Ints, fractions: Floats) -> Floats:
    """Return rotations by (sin((1 - u) t) q0 + sin(u t) q1) / sin(t): (T, R, 4)."""
    rows = arcs.bases + spans.take(arcs.timelines, axis=1)
    angles, sines = arcs.angles.take(rows), arcs.sines.take(rows)
    after = fractions.take(arcs.timelines, axis=1) * arcs.slopes * angles
    first, second = np.sin(angles - after) / sines, np.sin(after) / sines
    before, following = arcs.keys.take(rows, axis=0), arcs.keys.take(rows + 1, axis=0)
    return first[..., None] * before + second[..., None] * following


def _lines(curves: _Curves, spans: Ints, fractions: Floats) -> Floats:
    """Return linear and step interpolation: (T, C)."""
    rows = curves.bases + spans.take(curves.timelines, axis=1) * curves.strides
    start = curves.values.take(rows)
    rise = curves.values.take(rows + curves.strides) - start
    return start + fractions.take(curves.timelines, axis=1) * curves.slopes * rise


def _cubics(curves: _Curves, timelines: _Timelines, spans: Ints, fractions: Floats) -> Floats:
    """Return cubic Hermite splines: (T, C)."""
    durations = timelines.durations[timelines.first + spans]
    durations = np.where(np.isfinite(durations), durations, 0.0)[:, curves.timelines]
    rows = curves.bases + spans.take(curves.timelines, axis=1) * curves.strides
    following = rows + curves.strides
    u, start = fractions.take(curves.timelines, axis=1), curves.values.take(rows)
    rise = curves.values.take(following) - start
    leaving, arriving = curves.outgoing.take(rows), curves.incoming.take(following)
    # glTF 2.0, appendix C, over a span of h seconds: (2 u^3 - 3 u^2 + 1) p0 + h (u^3 - 2 u^2 + u)
    # b0 + (3 u^2 - 2 u^3) p1 + h (u^3 - u^2) a1, with incoming tangents a and outgoing tangents b.
    # The basis functions of both values sum to 1, so this form gives exactly p0 at u = 0.
    bend = (u - 1.0) * (u - 1.0) * leaving + u * (u - 1.0) * arriving
    return start + u * u * (3.0 - 2.0 * u) * rise + durations * u * bend


def _normalised(quaternions: Floats) -> Floats:
    """Return unit quaternions; if a spline passes through 0, the rotation is arbitrary."""
    lengths = np.linalg.norm(quaternions, axis=-1, keepdims=True)
    still = np.array([0.0, 0.0, 0.0, 1.0])
    return np.where(lengths > 0.0, quaternions / np.where(lengths > 0.0, lengths, 1.0), still)


@dataclass(frozen=True, slots=True, eq=False)
class _Timelines:
    """U distinct lists of key times; most channels of a file share one."""

    times: Floats
    """(K,). Seconds of all keys, one timeline after the other."""
    first: Ints
    """(U,). Index of each timeline's first key."""
    durations: Floats
    """(K,). Seconds until the next key of the timeline, inf after its last key."""
    union: Floats
    """(M,). All distinct times, increasing."""
    ends: NDArray[np.int64]
    """(U,) int64. u (M + 1) of each timeline u."""
    ranks: NDArray[np.int64]
    """(K,) int64. For a key of timeline u, ``ends`` + the number of times of ``union`` up to the
    key. It is increasing, so one search finds the spans of all timelines."""


@dataclass(frozen=True, slots=True, eq=False)
class _Arcs:
    """R rotations that follow arcs between their keys, or stay at the earlier key."""

    timelines: Ints
    """(R,)."""
    bases: Ints
    """(R,). Row of each rotation's first key."""
    slopes: Floats
    """(R,). 1 for arcs, 0 for steps, which stay at the earlier key."""
    keys: Floats
    """(N, 4). Unit quaternions with signs such that neighbours are less than 180 degrees apart. The
    last key of each channel is repeated, so that every key has a successor."""
    angles: Floats
    sines: Floats
    """(N,). Angle of the arc to the next key, and its sine."""


@dataclass(frozen=True, slots=True, eq=False)
class _Curves:
    """C components of channels, each a scalar curve of lines, steps or cubic splines."""

    timelines: Ints
    """(C,)."""
    bases: Ints
    strides: Ints
    """(C,). Index of each component's first value, and the step from one value to the next."""
    slopes: Floats
    """(C,). 1 for lines, 0 for steps; empty for cubic curves."""
    values: Floats
    """(N,). All values; the last key of each channel is repeated."""
    incoming: Floats
    outgoing: Floats
    """(N,). Slopes per second at the same indices; empty for lines and steps."""


@dataclass(frozen=True, slots=True, eq=False)
class _Targets:
    """Joints or shapes animated by one path, in the order of the samples."""

    indices: Ints
    """(N,) int32. Joints, or blend shapes."""
    lines: slice
    cubics: slice
    """Components among the lines and steps, and among the cubic curves; lines come first."""


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class _TransformTable:
    """All keys of a clip, and the targets of each path."""

    timelines: _Timelines
    arcs: _Arcs
    lines: _Curves
    cubics: _Curves
    targets: dict[TransformPath, _Targets]


def _transform_table(channels: Sequence[TransformChannel]) -> _TransformTable:
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
    return _TransformTable(timelines, _arc_table(arcs), _curves(lines), _curves(cubics), targets)


def _timelines(every: Sequence[Floats]) -> tuple[_Timelines, list[int]]:
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
    timelines = _Timelines(times, first.astype(np.int32), durations, union, ends, ranks)
    return timelines, of_channel


def _arc_table(channels: list[tuple[TransformChannel, int]]) -> _Arcs:
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
    return _Arcs(
        np.array([timeline for _, timeline in channels], dtype=np.int32),
        bases.astype(np.int32),
        np.array([float(one.interpolation != "step") for one, _ in channels]),
        keys,
        angles,
        np.sin(angles),
    )


def _curves(channels: list[tuple[TransformChannel, int]]) -> _Curves:
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
    return _Curves(timelines, bases, strides, table[:, 3].copy(), *parts)


def _targets(
    path: str,
    arcs: list[TransformChannel],
    lines: list[TransformChannel],
    cubics: list[TransformChannel],
) -> _Targets:
    """Return the targets of a path: targets of arcs or lines first, then of cubic curves."""
    plain = arcs if path == "rotation" else lines
    indices = [np.zeros(0, dtype=np.int32)]
    for channel in (*plain, *cubics):
        if channel.path == path:
            own = np.array([channel.joint]) if channel.shapes is None else channel.shapes
            indices.append(own.astype(np.int32))
    return _Targets(
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


# Rates, stated by the file or estimated from the times of the keys


def key_rate(clip: TransformClip) -> float:
    """Return the rate that the file states, or else one that is estimated from its keys.

    It is the first usual rate whose frames hold all keys, counted from the clip's start, or else
    that of evenly spaced keys, multiplied to at least 24 per second; ``DEFAULT_RATE`` if keys are
    irregular. It replaces a stated rate whose frames do not hold all keys if most frames have keys:
    motions are saved in scenes of other rates than those at which they were recorded.
    """
    return _regular_rate(clip) or clip.stated_rate or DEFAULT_RATE


def is_regular(clip: TransformClip) -> bool:
    """Return whether all keys of a clip's file lie on frames of ``key_rate``."""
    return _regular_rate(clip) > 0.0


def _regular_rate(clip: TransformClip) -> float:
    """Return the rate of the keys; 0 if they are at irregular times."""
    return _rates.get(clip, (), lambda: _estimated(clip))


def _estimated(clip: TransformClip) -> float:
    # Most channels of a file share their times.
    every = [channel.own_times for channel in clip.channels]
    lists = {times.tobytes(): times for times in every}
    times = np.unique(np.concatenate([np.array([clip.start]), *lists.values()]))
    rounding = _SINGLE * float(np.abs(times[[0, -1]]).max())
    since = times - clip.start
    if len(since) == 1:
        # A pose that is held for some frames: only the end of the range tells the rate.
        since = np.array([0.0, clip.end - clip.start])
    if clip.stated_rate is not None:
        if _is_on_frames(since, clip.stated_rate, rounding):
            return clip.stated_rate
        rate = _of_keys(since, rounding)
        return rate if len(since) - 1 >= _RECORDED * rate * since[-1] else 0.0
    return _of_keys(since, rounding)


def _of_keys(since: Floats, rounding: float) -> float:
    """Return the rate of keys at seconds since the start of their clip, increasing; see above."""
    for rate in (*_RATES, *_BROADCAST):
        if _is_on_frames(since, rate, rounding):
            return rate
    # No usual rate: keys may still be multiples of their smallest distance apart.
    apart = np.diff(since)
    apart = apart[apart > 2.0 * rounding]
    if not len(apart) or 1.0 / apart.min() > _FASTEST:
        return 0.0
    # The whole span has a smaller relative error than one distance.
    span = float(since[-1] - since[0])
    rate = round(span / float(apart.min())) / span
    if not _is_on_frames(since - since[0], rate, rounding):
        return 0.0
    near = round(rate, 2)
    rate = near if _is_on_frames(since - since[0], near, rounding) else rate
    rate *= max(1, math.ceil(_SLOWEST / rate))
    return rate if _is_on_frames(since, rate, rounding) else 0.0


def _is_on_frames(times: Floats, rate: float, rounding: float) -> bool:
    frames = times * rate
    limit = _ON_FRAME + 2.0 * rate * rounding
    return bool((np.abs(frames - np.round(frames)) <= limit).all())
