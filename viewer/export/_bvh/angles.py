"""Euler angles of rotations, and their unwrapping over time."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats

_WHOLE = 2.0 * np.pi  # radians in a revolution
_LOCKED = 1e-9  # cosine of the middle angle below which the outer axes coincide (gimbal lock)


def euler_angles(matrices: Floats, order: str) -> Floats:
    """Return angles a, b, c with R = R_i(a) R_j(b) R_k(c), i, j, k being the axes of ``order``.

    With e = 1 if i, j, k is a cyclic permutation of x, y, z, else -1: R[j, k] = -e sin a cos b,
    R[k, k] = cos a cos b, and R_i(a)^T R = R_j(b) R_k(c) gives b and c.

    ``matrices`` (..., 3, 3): rotations for column vectors.
    ``order``: ``"zyx"`` for R = Rz Ry Rx.
    Returns (..., 3): radians, in the order of the axes; the middle angle is from -pi / 2 to pi / 2.
    """
    i, j, k = ("xyz".index(letter) for letter in order)
    sign = _sign(order)
    m = matrices
    locked = np.hypot(m[..., j, k], m[..., k, k]) < _LOCKED
    # In gimbal lock only a sum of the outer angles is defined, so the first is 0: see unrolled.
    first = np.where(locked, 0.0, np.arctan2(-sign * m[..., j, k], m[..., k, k]))
    # Rows of R_i(a)^T R.
    cosine, sine = np.cos(first), sign * np.sin(first)
    second = np.arctan2(sign * m[..., i, k], cosine * m[..., k, k] - sine * m[..., j, k])
    third = np.arctan2(
        sign * (cosine * m[..., j, i] + sine * m[..., k, i]),
        cosine * m[..., j, j] + sine * m[..., k, j],
    )
    return np.stack([first, second, third], axis=-1)


def unrolled(angles: Floats, order: str) -> Floats:
    """Return equivalent angles that are nearest to those of the previous frame.

    (a, b, c) and (a + pi, pi - b, c + pi) are the same rotation, as are angles that differ by
    multiples of 2 pi. If the middle angle is +-pi / 2, only the sum or difference of the outer two
    is defined.

    ``angles`` (N, ..., 3): radians, one row per frame; result of ``euler_angles``.
    ``order``: order of the axes.
    Returns (N, ..., 3): radians, not limited to one revolution.
    """
    if len(angles) < 2:
        return angles.copy()
    if angles.ndim > 2:
        # One joint at a time, so that the arrays of many frames fit into the processor's cache.
        joints = np.empty_like(angles)
        for joint in range(angles.shape[1]):
            joints[:, joint] = unrolled(angles[:, joint], order)
        return joints
    angles = _unlocked(angles, order)
    stay = np.abs(_wrapped(angles[1:] - angles[:-1])).sum(axis=-1)
    # The distance to the other form is at least 2 pi - stay.
    if not (stay < np.pi).all():
        angles = _nearest_form(angles, stay)
    turns = np.zeros_like(angles)
    np.cumsum(_revolutions(angles[1:] - angles[:-1]), axis=0, out=turns[1:])
    return angles - _WHOLE * turns


def _nearest_form(angles: Floats, stay: Floats) -> Floats:
    """Switch to the other form of a rotation where it is nearer to the previous frame.

    ``stay`` (N - 1, ...): distance from the previous frame in the given form.
    """
    other = angles * [1.0, -1.0, 1.0] + np.pi
    # Switching costs the same from either form, so the number of switches accumulates.
    change = np.abs(_wrapped(other[1:] - angles[:-1])).sum(axis=-1)
    changed = np.logical_xor.accumulate(change < stay - 1e-9, axis=0)
    chosen = angles.copy()
    chosen[1:] = np.where(changed[..., None], other[1:], angles[1:])
    return chosen


def _revolutions(angles: Floats) -> Floats:
    """Return the nearest whole numbers of revolutions."""
    return np.rint(angles / _WHOLE)


def _wrapped(angles: Floats) -> Floats:
    return angles - _WHOLE * _revolutions(angles)


def _unlocked(angles: Floats, order: str) -> Floats:
    """Set the first angle of frames in gimbal lock to that of the previous frame.

    R_j(+-90 degrees) maps axis k to +-i (or -+i), so only a + c or a - c is defined, and the third
    angle compensates.
    """
    locked = np.cos(angles[..., 1]) < 2.0 * _LOCKED
    if not locked.any():
        return angles
    frames = np.arange(len(angles)).reshape(-1, *[1] * (locked.ndim - 1))
    before = np.maximum.accumulate(np.where(locked, 0, frames), axis=0)
    first = np.take_along_axis(angles[..., 0], before, axis=0)
    result = angles.copy()
    result[..., 0] = np.where(locked, first, angles[..., 0])
    sign = _sign(order) * np.sign(angles[..., 1])
    result[..., 2] += np.where(locked, sign * (angles[..., 0] - first), 0.0)
    return result


def _sign(order: str) -> float:
    return 1.0 if order in ("xyz", "yzx", "zxy") else -1.0
