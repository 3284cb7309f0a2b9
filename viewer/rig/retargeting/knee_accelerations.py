"""Accelerations of knees: a measure of how suddenly legs bend and straighten."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.cleanup.leg_ik import Leg

__all__ = ["acceleration_ratio", "knee_accelerations"]

_STILL = 10.0  # smallest acceleration with which others are compared, rad/s^2


def knee_accelerations(
    worlds: Floats, legs: Sequence[Leg], spans: Sequence[tuple[int, int]], rate: float
) -> Floats:
    """Return the largest angular acceleration of each knee: (L,) in rad/s^2.

    Parameters
    ----------
    worlds : (N, K, 4, 4)
        World matrices of the joints.
    legs : sequence of Leg
        The legs.
    spans : sequence of (int, int)
        Ranges of rows without gaps.
    rate : float
        Rows per second.
    """
    result = np.zeros(len(legs))
    for number, leg in enumerate(legs):
        hips, knees, ankles = (worlds[:, joint, :3, 3] for joint in (leg.hip, leg.knee, leg.ankle))
        upper, lower = hips - knees, ankles - knees
        sines = np.linalg.norm(np.cross(upper, lower), axis=1)
        angles = np.arctan2(sines, np.einsum("na,na->n", upper, lower))
        for start, stop in spans:
            found = np.abs(np.diff(angles[start:stop], 2)).max(initial=0.0)
            result[number] = max(result[number], float(found) * rate**2)
    return result


def acceleration_ratio(before: Floats, after: Floats) -> float:
    """Return the largest ratio of accelerations, (L,) each; knees at rest do not count."""
    return float((after / np.maximum(before, _STILL)).max(initial=0.0))
