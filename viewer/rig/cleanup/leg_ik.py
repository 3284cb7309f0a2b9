"""Analytic inverse kinematics of legs: hip and knee rotate until the ankle is at its target."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats
from viewer.rig.geometry.quaternion import between, multiply
from viewer.rig.geometry.vectors import unit

__all__ = ["Leg", "bend", "reach"]

# Forward bias of the direction of the knee, relative to the leg's length: 80 mm for a person. The
# direction of a nearly straight knee is only noise.
_FORWARDS = 0.1
_REACH = 0.9999  # maximum extension relative to the leg's length: a straight knee has no direction


@dataclass(frozen=True, slots=True)
class Leg:
    """Joints of one leg.

    Attributes
    ----------
    hip, knee, ankle : int
        Indices in the skeleton.
    toe : int
        The ball of the foot; the ankle if there is none.
    """

    hip: int
    knee: int
    ankle: int
    toe: int


def reach(hips: Floats, knees: Floats, ankles: Floats) -> Floats:
    """Return the longest distance from hip to ankle in each frame: (F,) for (F, 3) each."""
    thigh = np.linalg.norm(knees - hips, axis=1)
    return _REACH * (thigh + np.linalg.norm(ankles - knees, axis=1))


def bend(
    hips: Floats, knees: Floats, ankles: Floats, targets: Floats, axis: Floats
) -> tuple[Floats, Floats]:
    """Return the rotations of thigh and shin that bring the ankle to a target.

    Hip and knee rotate in the leg's plane until the distance from hip to ankle equals the target's
    (law of cosines). Then the whole leg rotates about the hip by the smallest angle that points it
    at the target, so the knee keeps its direction. The nearer a leg is to straight, the more the
    knee points forwards instead, perpendicular to its axis.

    Parameters
    ----------
    hips, knees, ankles : (F, 3)
        Positions.
    targets : (F, 3)
        Targets of the ankle; those out of reach are approached as closely as possible.
    axis : (F, 3)
        Unit vectors along the axis of the knee: the normal of a bent leg's plane, thigh x shin.

    Returns
    -------
    thigh, shin : (F, 4)
        Unit quaternions in the space of the positions: R' = Q R.
    """
    upper, lower = knees - hips, ankles - knees
    a, b = np.linalg.norm(upper, axis=1), np.linalg.norm(lower, axis=1)
    line = unit(ankles - hips)
    aside = upper - _dot(upper, line)[:, None] * line
    ahead = unit(aside + _FORWARDS * (a + b)[:, None] * np.cross(line, axis))
    distance = np.linalg.norm(targets - hips, axis=1)
    distance = np.clip(distance, np.abs(a - b) * (2.0 - _REACH), _REACH * (a + b))
    cosine = (a * a + distance * distance - b * b) / np.maximum(2.0 * a * distance, 1e-30)
    cosine = np.clip(cosine, -1.0, 1.0)[:, None]
    knee = a[:, None] * (cosine * line + np.sqrt(1.0 - cosine * cosine) * ahead)
    turn = between(line, targets - hips)
    thigh, shin = between(upper, knee), between(lower, distance[:, None] * line - knee)
    return multiply(turn, thigh), multiply(turn, shin)


def _dot(a: Floats, b: Floats) -> Floats:
    return np.einsum("fa,fa->f", a, b)
