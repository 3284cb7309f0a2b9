"""Affine transforms as 4 x 4 matrices for column vectors, translation in the last column."""

from __future__ import annotations

import numpy as np

from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.rotation import axis_rotations


def translation_matrix(offset: Floats) -> Floats:
    """Return the matrices (..., 4, 4) that translate by ``offset`` (..., 3)."""
    offset = np.asarray(offset, dtype=np.float64)
    matrices = np.zeros((*offset.shape[:-1], 4, 4))
    matrices[..., [0, 1, 2, 3], [0, 1, 2, 3]] = 1.0
    matrices[..., :3, 3] = offset
    return matrices


def mean_scale(matrix: Floats) -> float:
    """Return the mean scale factor of a transform, the cube root of its change of volume."""
    return float(np.cbrt(abs(np.linalg.det(matrix[:3, :3]))))


def rotation_transform(axis: int, angle: float) -> Floats:
    """Return the (4, 4) matrix that rotates about a coordinate axis by ``angle`` radians."""
    matrix = np.eye(4)
    matrix[:3, :3] = axis_rotations(axis, np.asarray(angle))
    return matrix


def affine_matrices(linear: Floats, offsets: Floats) -> Floats:
    """Return [A t; 0 1] for linear maps A (..., 3, 3) and translations t (..., 3): (..., 4, 4)."""
    matrices = np.zeros((*np.broadcast_shapes(linear.shape[:-2], offsets.shape[:-1]), 4, 4))
    matrices[..., :3, :3] = linear
    matrices[..., :3, 3] = offsets
    matrices[..., 3, 3] = 1.0
    return matrices


def apply_transform(matrix: Floats, points: Floats) -> Floats:
    """Transform points (..., 3): p' = M [p 1]."""
    return points @ matrix[:3, :3].T + matrix[:3, 3]
