"""Keyed clips: one curve of keys per DOF, with tangent rules and extrapolation.

Between two keys with the values p0 and p1, h seconds apart, a curve is a cubic Hermite spline. With
u from 0 to 1 across the span, v0 = h out0 and v1 = h in1, its value is (CSE169 course notes)::

    ((a u + b) u + v0) u + p0      a = 2 p0 - 2 p1 + v0 + v1      b = -3 p0 + 3 p1 - 2 v0 - v1

At a key it is exactly the key's value. A clip fits the skeletons whose DOFs are its channels.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from viewer.arguments import check_type
from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase
from viewer.errors import RigError
from viewer.phrases import all_of
from viewer.rigs.arrays import Bools, Floats, Ints, freeze_fields, frozen
from viewer.rigs.checked_fields import checked
from viewer.rigs.memo import Memo
from viewer.rigs.motion.samples import Samples
from viewer.rigs.motion.timing import DEFAULT_RATE, check_range
from viewer.rigs.pose import Pose
from viewer.rigs.skeleton import DOF_KINDS, Skeleton, clamp_dofs, joint_label

Extrapolation = Literal["constant", "linear", "cycle", "cycle_offset", "bounce"]
EXTRAPOLATIONS: tuple[Extrapolation, ...] = get_args(Extrapolation)
"""Behaviour of a curve before its first and after its last key."""
SHORTEST = 1e-9
"""Keys at most this many seconds apart are treated as simultaneous: no slope is computed between
them."""
_TangentRule = Literal["flat", "linear", "smooth"]
TANGENT_RULES: tuple[_TangentRule, ...] = get_args(_TangentRule)
Tangent = _TangentRule | float
"""A tangent rule, or a slope in value per second."""
_MODES: dict[str, int] = {mode: index for index, mode in enumerate(EXTRAPOLATIONS)}
_tables: Memo[Clip, _Table] = Memo(kept=1)


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """The curve of one DOF."""

    target: int
    """Row of the DOF in the skeleton's table."""
    times: Floats
    """(N,). Seconds, non-decreasing."""
    values: Floats
    """(N,). Lengths or radians."""
    tangents: tuple[tuple[Tangent, Tangent], ...]
    """tuple of N (incoming, outgoing). Rules or slopes on both sides of each key."""
    extrapolation: tuple[Extrapolation, Extrapolation] = ("constant", "constant")
    """(before, after). Two of ``EXTRAPOLATIONS``."""

    def __post_init__(self) -> None:
        freeze_fields(self, times=(None,))
        count = len(self.times)
        freeze_fields(self, values=(count,))
        if len(self.tangents) != count:
            raise RigError(f"tangents: expected {count} pairs, found {len(self.tangents)}")
        if (np.diff(self.times) < 0).any():
            raise RigError("times: expected non-decreasing seconds")
        # Thousands of keys share a few distinct pairs, so each pair is validated once.
        pairs = {pair: (_tangent(pair[0]), _tangent(pair[1])) for pair in set(self.tangents)}
        object.__setattr__(self, "tangents", tuple(pairs[pair] for pair in self.tangents))
        wrong = next((mode for mode in self.extrapolation if mode not in EXTRAPOLATIONS), None)
        if wrong is not None or len(self.extrapolation) != 2:
            raise RigError(
                f"extrapolation: expected two of {', '.join(EXTRAPOLATIONS)}, "
                f"found {self.extrapolation}"
            )


def _tangent(given: Tangent) -> Tangent:
    """Return a rule unchanged, and a slope as a Python float, which prints with full precision."""
    if given in TANGENT_RULES:
        return given
    if isinstance(given, str) or not math.isfinite(given):
        raise RigError(f"tangent: expected {', '.join(TANGENT_RULES)} or a number, found {given}")
    return float(given)


@checked
@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Clip:
    """A motion of one skeleton."""

    kind: ClassVar[Literal["curves"]] = "curves"
    timing: ClassVar[None] = None
    """Curves have no frames."""
    points: ClassVar[None] = None
    """Joints move."""
    sets_shape: ClassVar[bool] = False
    """Curves move joints only."""
    frame_rate: ClassVar[float] = DEFAULT_RATE
    """Frames per second by which curves are counted."""
    name: str
    """Display name."""
    channels: tuple[Channel, ...]
    """One per DOF that moves."""
    start: float
    end: float
    """Playback range in seconds; the curves continue beyond it."""

    def __post_init__(self) -> None:
        check_range(self, self.name, self.start, self.end)

    @property
    def n_keys(self) -> int:
        """Number of keys of all channels."""
        return sum(len(channel.times) for channel in self.channels)

    def sample(
        self, skeleton: Skeleton | None, times: Floats, interpolate: bool = False
    ) -> Samples:
        """Return the DOFs with a channel at times (T,), in seconds; see ``evaluate``."""
        targets, values = evaluate_all(self, times)
        return Samples(np.ones(len(values), dtype=np.bool_), targets, values)


def evaluate(channel: Channel, times: ArrayLike) -> Floats:
    """Return a curve's values: cubic Hermite between the keys, extrapolated outside.

    Parameters
    ----------
    channel
        The curve; without keys it is 0 everywhere.
    times : (...)
        Seconds.

    Returns
    -------
    (...)
        Lengths or radians.
    """
    check_type("channel", channel, Channel)
    flat = frozen("times", np.ravel(times), (None,))
    return _values(_table((channel,)), flat)[:, 0].reshape(np.shape(times))


def evaluate_all(clip: Clip, times: Floats) -> tuple[Ints, Floats]:
    """Return all curves' targets (C,), DOF rows, and values (T, C); 0 for channels without keys."""
    table = _tables.get(clip, (), lambda: _table(clip.channels))
    return table.targets, _values(table, np.atleast_1d(times))


def sample(clip: Clip, skeleton: Skeleton, time: float, out: Pose) -> None:
    """Set a pose's DOFs to a clip's values at one time, clamped to their limits.

    Parameters
    ----------
    clip
        The motion.
    skeleton
        Provides the limits; the clip must fit the skeleton, see ``suits``.
    time
        Seconds; before ``start`` and after ``end`` the curves extrapolate.
    out
        Modified in place.
    """
    check_type("clip", clip, Clip)
    check_type("skeleton", skeleton, Skeleton)
    check_type("time", time, float)
    check_type("out", out, Pose)
    targets, values = evaluate_all(clip, np.array([time]))
    out.dofs[targets] = values[0]
    out.dofs[:] = clamp_dofs(skeleton, out.dofs)


def slopes(channel: Channel) -> Floats:
    """Return incoming and outgoing slope of each key (N, 2), value per second.

    flat is 0, linear is the slope of the span on its side, smooth the slope from the previous key
    to the next. End keys use their only span. Slopes over a span of no duration are 0.
    """
    times, values = channel.times, channel.values
    count = len(times)
    result = np.zeros((count, 2))
    if count < 2 or times[-1] - times[0] <= SHORTEST:
        return result
    spans = _ratio(np.diff(values), np.diff(times))
    linear = np.stack([np.append(spans[0], spans), np.append(spans, spans[-1])], axis=1)
    smooth = linear.copy()
    smooth[1:-1] = _ratio(values[2:] - values[:-2], times[2:] - times[:-2])[:, None]
    known = {"flat": result, "linear": linear, "smooth": smooth}
    for rule, rates in known.items():
        follows = np.array([[tangent == rule for tangent in pair] for pair in channel.tangents])
        result = np.where(follows, rates, result)
    numbers = [[0.0 if t in known else float(t) for t in pair] for pair in channel.tangents]
    return result + np.array(numbers)


def _ratio(rise: Floats, run: Floats) -> Floats:
    return np.divide(rise, run, out=np.zeros_like(rise), where=run > SHORTEST)


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class _Table:
    """C channels with up to K keys; unused keys are at infinity."""

    targets: Ints  # (C,)
    times: Floats  # (C, K)
    values: Floats  # (C, K)
    edges: Floats  # (C, K, 2), incoming and outgoing slopes
    last: Ints  # (C,), index of the last key
    modes: Ints  # (C, 2)


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


def _hermite(table: _Table, times: Floats) -> Floats:
    # The index of the key before each time: (T, C).
    most = np.maximum(table.last - 1, 0)
    if len(times) * table.times.size <= 1 << 16:
        found = (table.times <= times[:, :, None]).sum(axis=2) - 1
    else:
        columns = [
            np.searchsorted(keys, column, side="right") - 1
            for keys, column in zip(table.times, times.T, strict=True)
        ]
        found = np.stack(columns, axis=1)
    span = np.clip(found, 0, most)
    every = np.arange(len(table.targets))
    following = np.minimum(span + 1, table.last)
    start = table.times[every, span]
    duration = table.times[every, following] - start
    u = np.divide(times - start, duration, out=np.zeros(times.shape), where=duration > SHORTEST)
    p0, p1 = table.values[every, span], table.values[every, following]
    v0, v1 = duration * table.edges[every, span, 1], duration * table.edges[every, following, 0]
    a, b = hermite(p0, p1, v0, v1)
    return ((a * u + b) * u + v0) * u + p0


def hermite(p0: Floats, p1: Floats, v0: Floats, v1: Floats) -> tuple[Floats, Floats]:
    """Return a, b of a u^3 + b u^2 + v0 u + p0 with values p0, p1 and slopes v0, v1 at 0 and 1."""
    return 2.0 * p0 - 2.0 * p1 + v0 + v1, -3.0 * p0 + 3.0 * p1 - 2.0 * v0 - v1


def suits(clip: Clip, skeleton: Skeleton) -> bool:
    """Return whether a clip's channels are the DOFs of a skeleton; see ``misfit``."""
    return not misfit(clip, skeleton)


def misfit(clip: Clip, skeleton: Skeleton) -> Phrase | None:
    """Return the reason why a clip cannot move a skeleton, phrased to follow its name, or None."""
    if not is_course_rig(skeleton):
        return Phrase(
            "is not a .skel-style rig, in which clips translate the root along x, y, z and "
            "rotate each joint about x, y, z: {reason}",
            reason=_first_misfit(skeleton),
        )
    if len(clip.channels) != skeleton.n_dofs:
        return Phrase(
            "needs {n} (3 + 3 x {joints} joints)", n=skeleton.n_dofs, joints=skeleton.n_joints
        )
    return None


def is_course_rig(skeleton: Skeleton) -> bool:
    """Return whether DOFs are those of ``.anim``: root x, y, z, then rotations x, y, z a joint."""
    count = skeleton.n_joints
    if skeleton.n_dofs != 3 + 3 * count:
        return False
    joints = np.concatenate([[0, 0, 0], np.repeat(np.arange(count), 3)])
    kinds = np.concatenate([[0, 1, 2], np.tile([3, 4, 5], count)])
    return bool((skeleton.dof_joints == joints).all() and (skeleton.dof_kinds == kinds).all())


def _first_misfit(skeleton: Skeleton) -> Phrase:
    """Describe the first joint whose DOFs differ from the DOFs of a ``.skel``-style rig."""
    for joint in range(skeleton.n_joints):
        kinds = [DOF_KINDS[kind] for kind in skeleton.dof_kinds[skeleton.dof_joints == joint]]
        if kinds != list(DOF_KINDS if joint == 0 else DOF_KINDS[3:]):
            label = joint_label(skeleton, joint)
            if not kinds:
                return Phrase("joint {joint} has no DOFs", joint=label)
            return Phrase("joint {joint} has DOFs {kinds}", joint=label, kinds=all_of(kinds))
    return Phrase("its DOFs are not in the order of its joints")
