"""Euler angles of rotations, and their unwrapping over time."""

from __future__ import annotations

import numpy as np

from viewer.exporters._options import RotationOrder
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.geometry.rotation import TURN, nearest_angles

_BLOCK = 256  # frames
_LOCKED = 1e-9  # cosine of the middle angle below which the outer axes coincide (gimbal lock)


def euler_angles(matrices: Floats, order: RotationOrder) -> Floats:
    """Return radians a, b, c (..., 3) with R = R_i(a) R_j(b) R_k(c) for the axes of ``order``."""
    # With e = 1 if i, j, k is a cyclic permutation of x, y, z, else -1: R[j, k] = -e sin a cos b,
    # R[k, k] = cos a cos b, and R_i(a)^T R = R_j(b) R_k(c) gives b, from -pi / 2 to pi / 2, and c.
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


def unrolled(angles: Floats, order: RotationOrder) -> Floats:
    """Return equivalent angles (N, ..., 3) that are nearest to those of the previous frame."""
    return Unroller(order).following(angles)


class Unroller:
    """Unwrapping of angles over time, block by block, for one order of the axes."""

    def __init__(self, order: RotationOrder) -> None:
        self._sign = _sign(order)
        self._first: Floats | None = None  # first angle of the last frame without gimbal lock
        # Angles of the last frame: as given, and in the chosen form.
        self._last = self._chosen = np.zeros(0)
        # Whether the chosen form is the other one.
        self._is_other: Bools = np.zeros(0, dtype=np.bool_)
        self._turns = np.zeros(0)  # accumulated revolutions

    def following(self, angles: Floats) -> Floats:
        """Return the angles (N, ..., 3) of the next frames, unwrapped."""
        result = np.empty_like(angles)
        # Frames are processed in blocks whose arrays fit into the processor's cache.
        for start in range(0, len(angles), _BLOCK):
            rows = slice(start, start + _BLOCK)
            result[rows] = self._unwrapped(angles[rows])
        return result

    def _unwrapped(self, angles: Floats) -> Floats:
        if self._first is None:
            self._first = angles[0, ..., 0].copy()
            self._last = self._chosen = angles[0]
            self._is_other = np.zeros(angles.shape[1:-1], dtype=np.bool_)
            self._turns = np.zeros(angles.shape[1:])
        angles = self._unlocked(angles)
        chosen = self._nearest_form(angles)
        before = np.concatenate([self._chosen[None], chosen[:-1]])
        turns = np.cumsum(np.rint((chosen - before) / TURN), axis=0)
        turns += self._turns
        # Copies: views would keep the whole motion in memory.
        self._chosen, self._turns = chosen[-1].copy(), turns[-1]
        return chosen - TURN * turns

    def _nearest_form(self, angles: Floats) -> Floats:
        """Switch to the other form of a rotation where it is nearer to the previous frame."""
        before = np.concatenate([self._last[None], angles[:-1]])
        self._last = angles[-1].copy()
        stay = np.abs(nearest_angles(angles, before) - before).sum(axis=-1)
        # The distance to the other form is at least 2 pi - stay.
        if (stay < np.pi).all() and not self._is_other.any():
            return angles
        # (a, b, c) and (a + pi, pi - b, c + pi) are the same rotation.
        other = angles * [1.0, -1.0, 1.0] + np.pi
        # Switching costs the same from either form, so the number of switches accumulates.
        switches = np.abs(nearest_angles(other, before) - before).sum(axis=-1) < stay - 1e-9
        switches[0] ^= self._is_other
        changed = np.logical_xor.accumulate(switches, axis=0)
        self._is_other = changed[-1]
        return np.where(changed[..., None], other, angles)

    def _unlocked(self, angles: Floats) -> Floats:
        """Set the first angle of frames in gimbal lock to that of the previous frame."""
        assert self._first is not None  # set by the caller
        locked = np.cos(angles[..., 1]) < 2.0 * _LOCKED
        if not locked.any():
            self._first = angles[-1, ..., 0].copy()
            return angles
        # R_j(+-90 degrees) maps axis k to +-i (or -+i), so only a + c or a - c is defined, and the
        # third angle compensates for a change of the first.
        frames = np.arange(1, len(angles) + 1).reshape(-1, *[1] * (locked.ndim - 1))
        before = np.maximum.accumulate(np.where(locked, 0, frames), axis=0)
        known = np.concatenate([self._first[None], angles[..., 0]])
        first = np.take_along_axis(known, before, axis=0)
        self._first = first[-1]
        result = angles.copy()
        result[..., 0] = np.where(locked, first, angles[..., 0])
        sign = self._sign * np.sign(angles[..., 1])
        result[..., 2] += np.where(locked, sign * (angles[..., 0] - first), 0.0)
        return result


def _sign(order: RotationOrder) -> float:
    return 1.0 if order in ("xyz", "yzx", "zxy") else -1.0
