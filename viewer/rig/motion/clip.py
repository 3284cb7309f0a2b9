"""Keyed clips: one curve of keys per DOF, with tangent rules and extrapolation."""

from __future__ import annotations

import math
from typing import Literal, get_args

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase
from viewer.errors import RigError
from viewer.rig.arrays import Floats, frozen
from viewer.rig.skeleton import DOF_KINDS, Skeleton, joint_label

__all__ = [
    "EXTRAPOLATIONS",
    "SHORTEST",
    "TANGENT_RULES",
    "Channel",
    "Clip",
    "Extrapolation",
    "Tangent",
    "check_fit",
    "is_course_rig",
    "misfit",
    "slopes",
    "suits",
]

Extrapolation = Literal["constant", "linear", "cycle", "cycle_offset", "bounce"]
EXTRAPOLATIONS: tuple[Extrapolation, ...] = get_args(Extrapolation)
"""Behaviour of a curve before its first and after its last key."""

SHORTEST = 1e-9
"""Keys at most this many seconds apart are treated as simultaneous: no slope is computed between
them."""

TangentRule = Literal["flat", "linear", "smooth"]
TANGENT_RULES: tuple[TangentRule, ...] = get_args(TangentRule)

Tangent = TangentRule | float
"""A tangent rule, or a slope in value per second."""


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """The curve of one DOF.

    Attributes
    ----------
    target : int
        Row of the DOF in the skeleton's table.
    times : (N,)
        Seconds, non-decreasing.
    values : (N,)
        Lengths or radians.
    tangents : tuple of N (incoming, outgoing)
        Rules or slopes on both sides of each key.
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


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Clip:
    """A motion of one skeleton.

    Attributes
    ----------
    name : str
        Display name.
    channels : tuple of Channel
        One per DOF that moves.
    start, end : float
        Playback range in seconds; the curves continue beyond it.
    """

    name: str
    channels: tuple[Channel, ...]
    start: float
    end: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", float(self.start))
        object.__setattr__(self, "end", float(self.end))
        if not (math.isfinite(self.start) and self.start <= self.end < math.inf):
            raise RigError(f"clip {self.name}: expected a range, found {self.start} to {self.end}")


def slopes(channel: Channel) -> Floats:
    """Return the slopes on both sides of every key, according to their tangent rules.

    flat is 0; linear is the slope of the span on that side; smooth is the slope from the previous
    key to the next. The first and last keys use their only span.

    Parameters
    ----------
    channel : Channel
        Channel with N keys.

    Returns
    -------
    (N, 2)
        Incoming and outgoing slope, value per second; 0 over a span of zero duration, and if
        all keys are simultaneous.
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


def is_course_rig(skeleton: Skeleton) -> bool:
    """Return whether a skeleton's DOFs are the DOFs of ``.anim`` channels, in that order.

    These are translations x, y, z of the root, then rotations x, y, z of joints 0, 1, 2 and so on.
    """
    count = skeleton.n_joints
    if skeleton.n_dofs != 3 + 3 * count:
        return False
    joints = np.concatenate([[0, 0, 0], np.repeat(np.arange(count), 3)])
    kinds = np.concatenate([[0, 1, 2], np.tile([3, 4, 5], count)])
    return bool((skeleton.dof_joints == joints).all() and (skeleton.dof_kinds == kinds).all())


def suits(clip: Clip, skeleton: Skeleton) -> bool:
    """Return whether a clip's channels are the DOFs of a skeleton; see ``check_fit``."""
    return not misfit(clip, skeleton)


def misfit(clip: Clip, skeleton: Skeleton) -> Phrase | None:
    """Return the reason why a clip cannot move a skeleton, phrased to follow its name, or None."""
    if not is_course_rig(skeleton):
        return Phrase("not-course-rig", reason=_first_misfit(skeleton))
    if len(clip.channels) != skeleton.n_dofs:
        return Phrase("clip-needs", n=skeleton.n_dofs, joints=skeleton.n_joints)
    return None


def _first_misfit(skeleton: Skeleton) -> Phrase:
    """Describe the first joint whose DOFs differ from the DOFs of a ``.skel``-style rig."""
    for joint in range(skeleton.n_joints):
        kinds = [DOF_KINDS[kind] for kind in skeleton.dof_kinds[skeleton.dof_joints == joint]]
        if kinds != list(DOF_KINDS if joint == 0 else DOF_KINDS[3:]):
            label = joint_label(skeleton, joint)
            if not kinds:
                return Phrase("joint-without-dofs", joint=label)
            return Phrase("joint-with-dofs", joint=label, kinds=kinds)
    return Phrase("dofs-unordered")


def check_fit(clip: Clip, skeleton: Skeleton) -> None:
    """Raise an error if a clip was made for a different skeleton.

    Raises
    ------
    RigError
        If the number of channels or the DOFs do not match; see ``is_course_rig``.
    """
    found = misfit(clip, skeleton)
    if found is None:
        return
    values = {"clip": clip.name, "n": len(clip.channels), "misfit": found}
    raise RigError(
        Diagnostic("C009.channels" if is_course_rig(skeleton) else "C009.rig", values=values)
    )
