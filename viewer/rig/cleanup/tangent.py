"""Tangent space of rotations: quaternions as rotation vectors relative to another rotation."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.geometry.quaternion import (
    align_signs,
    conjugate,
    multiply,
    rotation_vector_to_quaternion,
)

__all__ = ["continuous", "moved", "relative_vectors"]


def continuous(quaternions: Floats) -> Floats:
    """Return quaternions (N, ..., 4) with signs such that consecutive ones are nearest."""
    result = quaternions.copy()
    align_signs(result)
    return result


def relative_vectors(base: Floats, quaternions: Floats) -> Floats:
    """Return the rotation vectors v with q = b exp(v), for rotations by less than 2 pi.

    The sign of a quaternion matters: a negative real part means a rotation by more than pi.

    Parameters
    ----------
    base, quaternions : (..., 4)
        Unit quaternions b and q.

    Returns
    -------
    (..., 3)
        Radians, in the space of ``base``.

    >>> half_turn = np.array([0.0, 0.0, 1.0, 0.0])
    >>> relative_vectors(np.array([0.0, 0.0, 0.0, 1.0]), half_turn).round(6).tolist()
    [0.0, 0.0, 3.141593]
    """
    found = multiply(conjugate(base), quaternions)
    sine = np.linalg.norm(found[..., :3], axis=-1)
    angle = 2.0 * np.arctan2(sine, found[..., 3])
    # A rotation by nearly 0 has the factor angle / sin(angle / 2) = 2.
    is_tiny = sine < np.finfo(float).tiny ** 0.5
    factor = np.divide(angle, sine, out=np.full(sine.shape, 2.0), where=~is_tiny)
    return factor[..., None] * found[..., :3]


def moved(base: Floats, vectors: Floats) -> Floats:
    """Return b exp(v) of unit quaternions (..., 4) and rotation vectors (..., 3), normalised."""
    found = multiply(base, rotation_vector_to_quaternion(vectors))
    return found / np.linalg.norm(found, axis=-1, keepdims=True)
