"""A motion: one curve of keys per DOF, with tangent rules and extrapolation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from viewer.errors import RigError
from viewer.rig.arrays import Bools, Floats, frozen
from viewer.rig.pose import Pose
from viewer.rig.skeleton import Skeleton, clamp_dofs

__all__ = [
    "EXTRAPOLATIONS",
    "TANGENT_RULES",
    "Channel",
    "Clip",
    "Extrapolation",
    "Tangent",
    "check_fit",
    "evaluate",
    "sample",
    "slopes",
]

Extrapolation = Literal["constant", "linear", "cycle", "cycle_offset", "bounce"]
EXTRAPOLATIONS: tuple[Extrapolation, ...] = get_args(Extrapolation)
"""What a curve does before its first and after its last key."""

TangentRule = Literal["flat", "linear", "smooth"]
TANGENT_RULES: tuple[TangentRule, ...] = get_args(TangentRule)

Tangent = TangentRule | float
"""A rule, or the slope itself in value per second."""


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """The curve of one DOF.

    Attributes
    ----------
    target : int
        Row of the DOF in the skeleton's table.
    times : (N,)
        Seconds, never falling.
    values : (N,)
        Lengths or radians.
    tangents : tuple of N (incoming, outgoing)
        Rules or slopes on the two sides of each key.
    extrapolation : (before, after)
        Two of ``EXTRAPOLATIONS``.
    """

    target: int
    times: Floats
    values: Floats
    tangents: tuple[tuple[Tangent, Tangent], ...]
    extrapolation: tuple[Extrapolation, Extrapolation] = ("constant", "constant")

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", frozen("times", self.times, (None,)))
        count = len(self.times)
        object.__setattr__(self, "values", frozen("values", self.values, (count,)))
        if len(self.tangents) != count:
            raise RigError(f"tangents: expected {count} pairs, found {len(self.tangents)}")
        if (np.diff(self.times) < 0).any():
            raise RigError("times: expected seconds that never fall")


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Clip:
    """A motion of one skeleton.

    Attributes
    ----------
    name : str
        What menus call it.
    channels : tuple of Channel
        One per DOF that moves.
    start, end : float
        The seconds that are meant to be played; curves go on beyond.
    """

    name: str
    channels: tuple[Channel, ...]
    start: float
    end: float


def slopes(channel: Channel) -> Floats:
    """Return the slopes on both sides of every key, as the tangent rules make them.

    flat is 0; linear is the slope of the span on that side; smooth is the slope from the key
    before to the key after. At the ends both use the only span there is.

    Parameters
    ----------
    channel : Channel
        With N keys.

    Returns
    -------
    (N, 2)
        Incoming and outgoing slope, value per second; 0 over a span without duration.
    """
    times, values = channel.times, channel.values
    count = len(times)
    result = np.zeros((count, 2))
    if count < 2:
        return result
    spans = _ratio(np.diff(values), np.diff(times))
    before = np.concatenate([spans[:1], spans])
    after = np.concatenate([spans, spans[-1:]])
    smooth = before.copy()
    smooth[-1] = after[-1]
    smooth[1:-1] = _ratio(values[2:] - values[:-2], times[2:] - times[:-2])
    rules = {"flat": (np.zeros(count),) * 2, "linear": (before, after), "smooth": (smooth,) * 2}
    for key, pair in enumerate(channel.tangents):
        for side, tangent in enumerate(pair):
            if isinstance(tangent, str):
                result[key, side] = rules[tangent][side][key]
            else:
                result[key, side] = tangent
    return result


def _ratio(rise: Floats, run: Floats) -> Floats:
    return np.divide(rise, run, out=np.zeros_like(rise), where=run != 0.0)


def evaluate(channel: Channel, times: Floats) -> Floats:
    """Return a curve's values: cubic Hermite inside the keys, extrapolated outside.

    With u in 0..1 across a span of h seconds, v0 = h out0 and v1 = h in1, the value is
    ((a u + b) u + v0) u + p0, a = 2 p0 - 2 p1 + v0 + v1, b = -3 p0 + 3 p1 - 2 v0 - v1
    (CSE169 course notes).

    Parameters
    ----------
    channel : Channel
        The curve; without keys it is 0 everywhere.
    times : (...)
        Seconds.

    Returns
    -------
    (...)
        Lengths or radians.
    """
    times = np.asarray(times, dtype=np.float64)
    if len(channel.times) == 0:
        return np.zeros(times.shape)
    first, last = channel.times[0], channel.times[-1]
    if first == last:
        return np.full(times.shape, channel.values[-1])
    edges = slopes(channel)
    inside, shift = np.clip(times, first, last), np.zeros(times.shape)
    for outside, mode, key, side in (
        (times < first, channel.extrapolation[0], 0, 0),
        (times > last, channel.extrapolation[1], -1, 1),
    ):
        if mode == "linear":
            distance = times - channel.times[key]
            shift = np.where(outside, edges[key, side] * distance, shift)
        elif mode != "constant":
            folded, offset = _fold(channel, times, mode)
            inside = np.where(outside, folded, inside)
            shift = np.where(outside, offset, shift)
    return _hermite(channel, edges, inside) + shift


def _fold(channel: Channel, times: Floats, mode: Extrapolation) -> tuple[Floats, Floats]:
    """Return where in the keys a repeated curve is at these times, and what to add."""
    first, last = channel.times[0], channel.times[-1]
    period = last - first
    turns = np.floor((times - first) / period)
    folded = times - turns * period
    if mode == "bounce":
        odd: Bools = turns % 2 != 0
        return np.where(odd, first + last - folded, folded), np.zeros(times.shape)
    rise = channel.values[-1] - channel.values[0]
    return folded, turns * rise if mode == "cycle_offset" else np.zeros(times.shape)


def _hermite(channel: Channel, edges: Floats, times: Floats) -> Floats:
    span = np.clip(
        np.searchsorted(channel.times, times, side="right") - 1, 0, len(channel.times) - 2
    )
    duration = channel.times[span + 1] - channel.times[span]
    u = _ratio(times - channel.times[span], duration)
    p0, p1 = channel.values[span], channel.values[span + 1]
    v0, v1 = duration * edges[span, 1], duration * edges[span + 1, 0]
    a, b = 2.0 * p0 - 2.0 * p1 + v0 + v1, -3.0 * p0 + 3.0 * p1 - 2.0 * v0 - v1
    return ((a * u + b) * u + v0) * u + p0


def sample(clip: Clip, skeleton: Skeleton, time: float, out: Pose) -> None:
    """Set a pose's DOFs to where a clip has them at one time, within their limits.

    Parameters
    ----------
    clip : Clip
        The motion.
    skeleton : Skeleton
        Gives the limits; the clip must fit it, see ``check_fit``.
    time : float
        Seconds; before ``start`` and after ``end`` the curves extrapolate.
    out : Pose
        Changed in place.
    """
    from viewer.rig.clip_table import evaluate_all

    targets, values = evaluate_all(clip, np.array([time]))
    out.dofs[targets] = values[0]
    out.dofs[:] = clamp_dofs(skeleton, out.dofs)


def check_fit(clip: Clip, skeleton: Skeleton) -> None:
    """Refuse a clip that was made for another skeleton.

    Raises
    ------
    RigError
        With both numbers.
    """
    if len(clip.channels) != skeleton.n_dofs:
        raise RigError(
            f"clip {clip.name} has {len(clip.channels)} channels, the skeleton needs "
            f"{skeleton.n_dofs} (3 + 3 x {skeleton.n_joints} joints)"
        )
