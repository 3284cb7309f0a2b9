"""Quaternions (x, y, z, w): from rotation vectors, products, spherical interpolation."""

from __future__ import annotations

import numpy as np

from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.vectors import unit

_OPPOSITE = 1e-12  # 1 plus the cosine of the angle between vectors that are treated as opposite
_PARALLEL = 1e-6  # sine of the angle t below which sin(u t) / sin(t) equals u to the last digit


def rotation_vector_to_quaternion(vectors: Floats) -> Floats:
    """Return q = (sin(t/2) r / t, cos(t/2)) of rotation vectors r (..., 3), t = |r| radians."""
    vectors = np.asarray(vectors, dtype=np.float64)
    half = 0.5 * np.sqrt(np.einsum("...a,...a->...", vectors, vectors))[..., None]
    # sinc is defined at 0: np.sinc(x) = sin(pi x) / (pi x).
    return np.concatenate([0.5 * np.sinc(half / np.pi) * vectors, np.cos(half)], axis=-1)


def quaternion_to_rotation_vector(quaternions: Floats) -> Floats:
    """Return r = 2 atan2(|v|, w) v / |v| of unit quaternions (v, w); 0 to 2 pi, to pi if w >= 0."""
    # 2 atan2 is accurate at 0 and at pi, unlike 2 acos(w).
    sines = np.linalg.norm(quaternions[..., :3], axis=-1)
    angles = 2.0 * np.arctan2(sines, quaternions[..., 3])
    # A rotation by nearly 0 has the factor angle / sin(angle / 2) = 2.
    is_tiny = sines < np.finfo(float).tiny ** 0.5
    factors = np.divide(angles, sines, out=np.full(sines.shape, 2.0), where=~is_tiny)
    return factors[..., None] * quaternions[..., :3]


def between(start: Floats, end: Floats) -> Floats:
    """Return the smallest rotations from direction a to b: q = (a x b, 1 + a . b) / |q|.

    Lengths do not matter; a zero vector gives the identity, opposite vectors a rotation by 180
    degrees about any perpendicular axis.
    """
    start, end = unit(start), unit(end)
    real = 1.0 + np.einsum("...a,...a->...", start, end)[..., None]
    found = np.concatenate([np.cross(start, end), real], axis=-1)
    across = np.cross(start, np.eye(3)[np.abs(start).argmin(axis=-1)])
    half = np.concatenate([across, np.zeros_like(real)], axis=-1)
    return unit(np.where(real > _OPPOSITE, found, half))


def align_signs(quaternions: Floats) -> None:
    """Replace q by -q, the same rotation, where it is nearer to the previous row; in place.

    >>> rows = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, -1.0], [0.0, 0.0, 0.6, -0.8]])
    >>> align_signs(rows)
    >>> rows.tolist()
    [[0.0, 0.0, 0.0, 1.0], [-0.0, -0.0, -0.0, 1.0], [-0.0, -0.0, -0.6, 0.8]]
    """
    products = np.einsum("n...a,n...a->n...", quaternions[1:], quaternions[:-1])
    is_opposite = np.logical_xor.accumulate(products < 0.0, axis=0)
    if is_opposite.any():
        quaternions[1:][is_opposite] *= -1.0


def angles_between(first: Floats, second: Floats) -> Floats:
    """Return the angle between unit quaternions, 2 arccos |q . p|, in radians: (...)."""
    cosines = np.abs(np.einsum("...q,...q->...", first, second))
    angles: Floats = 2.0 * np.arccos(np.minimum(cosines, 1.0))
    return angles


def conjugate(quaternions: Floats) -> Floats:
    """Return the inverses (-x, -y, -z, w) of unit quaternions (..., 4)."""
    return quaternions * [-1.0, -1.0, -1.0, 1.0]


def multiply(first: Floats, second: Floats) -> Floats:
    """Return the Hamilton product (..., 4): the rotation ``second``, followed by ``first``."""
    a, b = np.broadcast_arrays(np.asarray(first, float), np.asarray(second, float))
    result = np.empty(a.shape)
    result[..., :3] = (
        a[..., 3:] * b[..., :3] + b[..., 3:] * a[..., :3] + np.cross(a[..., :3], b[..., :3])
    )
    result[..., 3] = a[..., 3] * b[..., 3] - np.einsum("...a,...a->...", a[..., :3], b[..., :3])
    return result


def slerp(start: Floats, end: Floats, fraction: Floats | float) -> Floats:
    """Interpolate unit quaternions (..., 4) along the shorter arc (Shoemake 1985).

    q(u) = (sin((1 - u) t) q0 + sin(u t) q1) / sin(t), with q1 negated if q0 . q1 < 0, so that u = 1
    gives ``end`` or its negative, the same rotation.
    """
    start, end = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    cosine = np.einsum("...a,...a->...", start, end)
    end = np.where(cosine[..., None] < 0.0, -end, end)
    # For small angles the chord is accurate, whereas the arc cosine loses half the digits.
    half_chord = 0.5 * np.linalg.norm(end - start, axis=-1)
    angle = 2.0 * np.arcsin(np.minimum(half_chord, 1.0))
    sine = np.sin(angle)
    fraction = np.broadcast_to(np.asarray(fraction, dtype=np.float64), cosine.shape)
    near = sine < _PARALLEL
    divisor = np.where(near, 1.0, sine)
    first = np.where(near, 1.0 - fraction, np.sin((1.0 - fraction) * angle) / divisor)
    second = np.where(near, fraction, np.sin(fraction * angle) / divisor)
    mixed = first[..., None] * start + second[..., None] * end
    return mixed / np.linalg.norm(mixed, axis=-1, keepdims=True)
