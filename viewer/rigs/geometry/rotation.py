"""Conversions of rotations: matrices, Euler angles, rotation vectors, quaternions (x, y, z, w).

``scipy.spatial.transform`` makes 24,000 matrices of quaternions or rotation vectors two to four
times faster, but takes 5 times as long for quaternions of matrices and 30 times for Euler angles,
and loads for longer than a command takes to start.
"""

from __future__ import annotations

import numpy as np

from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.geometry.quaternion import quaternion_to_rotation_vector
from viewer.rigs.geometry.vectors import unit

TURN = 2.0 * np.pi
"""Radians in a revolution."""

_SMALL = 1e-8  # squared angle below which the Taylor series are exact to the last digit


def axis_rotations(axis: int, angles: Floats) -> Floats:
    """Return right-handed rotations (..., 3, 3) about one axis by angles (...), radians."""
    cosines, sines = np.cos(angles), np.sin(angles)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrices = np.zeros((*np.shape(angles), 3, 3))
    matrices[..., axis, axis] = 1.0
    matrices[..., first, first] = matrices[..., second, second] = cosines
    matrices[..., second, first] = sines
    matrices[..., first, second] = -sines
    return matrices


def quaternion_to_matrix(quaternions: Floats) -> Floats:
    """Return the matrices of quaternions of any length, R v = q v q* / |q|^2 (Shoemake 1985)."""
    entries = quaternion_entries(*np.moveaxis(np.asarray(quaternions, dtype=np.float64), -1, 0))
    return np.ascontiguousarray(np.moveaxis(entries, (0, 1), (-2, -1)))


def quaternion_entries(x: Floats, y: Floats, z: Floats, w: Floats) -> Floats:
    """Return the entries (3, 3, ...) of ``quaternion_to_matrix``, one entry of all together."""
    scale = 2.0 / (x * x + y * y + z * z + w * w)
    entries = np.empty((3, 3, *x.shape))
    entries[0, 0] = 1.0 - scale * (y * y + z * z)
    entries[0, 1] = scale * (x * y - z * w)
    entries[0, 2] = scale * (x * z + y * w)
    entries[1, 0] = scale * (x * y + z * w)
    entries[1, 1] = 1.0 - scale * (x * x + z * z)
    entries[1, 2] = scale * (y * z - x * w)
    entries[2, 0] = scale * (x * z - y * w)
    entries[2, 1] = scale * (y * z + x * w)
    entries[2, 2] = 1.0 - scale * (x * x + y * y)
    return entries


def rotation_vector_to_matrix(vectors: Floats) -> Floats:
    """Return R = I + a K + b K^2, K = [r]x (Rodrigues), of rotation vectors r in radians."""
    vectors = np.asarray(vectors, dtype=np.float64)
    squares = np.einsum("...a,...a->...", vectors, vectors)
    angles = np.sqrt(squares)
    is_small = squares < _SMALL
    divisor = np.where(is_small, 1.0, angles)
    first = np.where(is_small, 1.0 - squares / 6.0, np.sin(angles) / divisor)
    # a = sin(t) / t and b = 2 sin^2(t / 2) / t^2 are accurate at any angle t, whereas
    # (1 - cos t) / t^2 suffers from cancellation near 0.
    half = np.sin(0.5 * angles) / divisor
    second = np.where(is_small, 0.5 - squares / 24.0, 2.0 * half * half)
    cross = np.zeros((*squares.shape, 3, 3))
    x, y, z = np.moveaxis(vectors, -1, 0)
    cross[..., 2, 1], cross[..., 0, 2], cross[..., 1, 0] = x, y, z
    cross -= np.swapaxes(cross, -1, -2)
    return np.eye(3) + first[..., None, None] * cross + second[..., None, None] * (cross @ cross)


def matrix_to_quaternion(matrices: Floats) -> Floats:
    """Return the unit quaternions of rotation matrices (..., 3, 3), w >= 0 (Shepperd 1978)."""
    m = np.asarray(matrices, dtype=np.float64)
    diagonal = np.moveaxis(np.diagonal(m, axis1=-2, axis2=-1), -1, 0)
    trace = diagonal.sum(axis=0)
    # 4 x^2, 4 y^2, 4 z^2, 4 w^2. Dividing by the largest of them avoids cancellation.
    squares = np.stack([1.0 + 2.0 * part - trace for part in diagonal] + [1.0 + trace], axis=-1)
    xy, xz, yz = (
        m[..., 1, 0] + m[..., 0, 1],
        m[..., 2, 0] + m[..., 0, 2],
        m[..., 2, 1] + m[..., 1, 2],
    )
    xw, yw, zw = (
        m[..., 2, 1] - m[..., 1, 2],
        m[..., 0, 2] - m[..., 2, 0],
        m[..., 1, 0] - m[..., 0, 1],
    )
    products = np.stack(
        [
            np.stack([squares[..., 0], xy, xz, xw], axis=-1),
            np.stack([xy, squares[..., 1], yz, yw], axis=-1),
            np.stack([xz, yz, squares[..., 2], zw], axis=-1),
            np.stack([xw, yw, zw, squares[..., 3]], axis=-1),
        ],
        axis=-2,
    )
    largest = squares.argmax(axis=-1)
    rows = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    quaternions = rows / np.linalg.norm(rows, axis=-1, keepdims=True)
    return np.where(quaternions[..., 3:] < 0.0, -quaternions, quaternions) + 0.0


def matrix_to_rotation_vector(matrices: Floats) -> Floats:
    """Return the rotation vectors of rotation matrices: axis times angle, 0 to pi radians."""
    return quaternion_to_rotation_vector(matrix_to_quaternion(matrices))


def matrix_to_euler(matrices: Floats) -> Floats:
    """Return Euler angles (..., 3) about x, y and z with R = Rz Ry Rx, x applied first, radians.

    x and z are from -pi to pi, y from -pi / 2 to pi / 2. In gimbal lock (y = +-90 degrees) x and z
    rotate about the same axis, so only their sum or difference is determined. The angles returned
    still reproduce R exactly.
    """
    m = np.asarray(matrices, dtype=np.float64)
    z = np.arctan2(m[..., 1, 0], m[..., 0, 0])
    sine, cosine = np.sin(z), np.cos(z)
    # y and x are taken from Rz^T R, which is Ry Rx even if z is ill-conditioned.
    y = np.arctan2(-m[..., 2, 0], cosine * m[..., 0, 0] + sine * m[..., 1, 0])
    x = np.arctan2(
        sine * m[..., 0, 2] - cosine * m[..., 1, 2], cosine * m[..., 1, 1] - sine * m[..., 0, 1]
    )
    return np.stack([x, y, z], axis=-1) + 0.0


def nearest_angles(angles: Floats | float, wanted: Floats | float) -> Floats:
    """Return the angles, plus multiples of 2 pi, that are nearest to the wanted ones, radians."""
    return np.asarray(angles - TURN * np.rint((angles - wanted) / TURN))


def nearest_rotations(matrices: Floats) -> tuple[Floats, Floats]:
    """Return proper R and P of M = R P (polar decomposition); det P < 0 for reflections."""
    # M = U S V^T yields R = U V^T, with the last column of U negated if that is a reflection.
    left, _, right = np.linalg.svd(matrices)
    signs = np.ones((*left.shape[:-2], 3))
    signs[..., 2] = np.where(np.linalg.det(left @ right) < 0.0, -1.0, 1.0)
    rotations = (left * signs[..., None, :]) @ right
    return rotations, np.swapaxes(rotations, -1, -2) @ matrices


def nearest_similarity(points: Floats, targets: Floats) -> tuple[float, Floats, Floats]:
    """Return s, R (3, 3) and t (3,) that bring s R p + t nearest to targets, both (N, 3).

    The scale is 1 if all points coincide.
    """
    # With means removed, sum_i q_i p_i^T = U D V^T, R = U S V^T, where S = diag(1, 1, det(U V^T))
    # prevents a reflection, s = tr(D S) / sum |p_i|^2 and t = mean q - s R mean p (Umeyama 1991,
    # eqs. 39 to 43). Both are of the polar decomposition R P of the sum, as P = V S D V^T.
    middle, aim = points.mean(axis=0), targets.mean(axis=0)
    p, q = points - middle, targets - aim
    rotation, stretch = nearest_rotations(q.T @ p)
    total = float(np.einsum("na,na->", p, p))
    scale = float(np.trace(stretch)) / total if total > 0.0 else 1.0
    return scale, rotation, aim - scale * rotation @ middle


def rotation_distance(first: Floats, second: Floats) -> Floats:
    """Return the angle (...) in radians between rotations, 2 asin(|A - B| / sqrt(8)) (Frobenius).

    It stays accurate for small angles, unlike the arc cosine of the trace.
    """
    # |A - B|^2 = tr A^T A + tr B^T B - 2 tr A^T B = 6 - 2 (1 + 2 cos t) = 8 sin^2(t / 2), where t
    # is the angle of A^T B, whose trace is 1 + 2 cos t.
    norm = np.linalg.norm(first - second, axis=(-2, -1))
    return 2.0 * np.arcsin(np.minimum(norm / np.sqrt(8.0), 1.0))


def angles_of_pairs(rotations: Floats) -> Floats:
    """Return the angles between all pairs of rotations (N, 3, 3), radians: (N, N)."""
    # trace(A^T B) = 1 + 2 cos t.
    traces = np.einsum("iab,jab->ij", rotations, rotations)
    return np.arccos(np.clip(0.5 * (traces - 1.0), -1.0, 1.0))


def six_to_matrix(values: Floats) -> tuple[Floats, Floats]:
    """Return matrices (..., 3, 3) of two columns each (..., 6), and how far these span a plane.

    Zhou, Barnes, Lu, Yang, Li 2019, "On the Continuity of Rotation Representations in Neural
    Networks", eq. 15: the six numbers are the first column, then the second one. Matrices are valid
    where the second result (...) is above 0: the shorter of the two columns, of the second its part
    across the first.
    """
    # Gram-Schmidt: the second column loses its part along the first one; the third one follows.
    first, second = values[..., :3], values[..., 3:]
    x = unit(first)
    across = second - (x * second).sum(axis=-1, keepdims=True) * x
    y = unit(across)
    lengths = np.linalg.norm(np.stack([first, across]), axis=-1)
    return np.stack([x, y, np.cross(x, y)], axis=-1), lengths.min(axis=0)


def are_rotations(matrices: Floats, tolerance: float) -> Bools:
    """Return which matrices (..., 3, 3) rotate: R R^T differs from I by less, and det R > 0."""
    apart = np.abs(matrices @ np.swapaxes(matrices, -1, -2) - np.eye(3)).max(axis=(-1, -2))
    found: Bools = (apart < tolerance) & (np.linalg.det(matrices) > 0.0)
    return found


def up_rotation(source: str, target: str) -> Floats:
    """Return the rotation (3, 3) about x from one up axis to another, "y" or "z"; exact."""
    if source == target:
        return np.eye(3)
    # Adding 0 replaces -0 by 0.
    quarter = np.asarray(np.pi / 2 if target == "z" else -np.pi / 2)
    return np.round(axis_rotations(0, quarter)) + 0.0
