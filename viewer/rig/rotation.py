"""Rotations: about an axis, in sequence (Euler), and as unit quaternions (x, y, z, w)."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats

__all__ = ["axis_rotations", "quaternion_to_matrix"]


def axis_rotations(axis: int, angles: Floats) -> Floats:
    """Return the matrices that turn about one coordinate axis, right-handed.

    Parameters
    ----------
    axis : int
        0 for x, 1 for y, 2 for z.
    angles : (...)
        Radians.

    Returns
    -------
    (..., 3, 3)
        Matrices for column vectors.

    >>> bool(np.allclose(axis_rotations(2, np.array(np.pi / 2)) @ [1, 0, 0], [0, 1, 0]))
    True
    """
    cosines, sines = np.cos(angles), np.sin(angles)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrices = np.zeros((*np.shape(angles), 3, 3))
    matrices[..., axis, axis] = 1.0
    matrices[..., first, first] = matrices[..., second, second] = cosines
    matrices[..., second, first] = sines
    matrices[..., first, second] = -sines
    return matrices


def quaternion_to_matrix(quaternions: Floats) -> Floats:
    """Return the rotation matrices of quaternions.

    With q = (x, y, z, w) of any length but zero, R v = q v q* / |q|^2 (Shoemake 1985).

    Parameters
    ----------
    quaternions : (..., 4)
        (x, y, z, w); they need not be of unit length.

    Returns
    -------
    (..., 3, 3)
        Matrices for column vectors.

    >>> half = np.sqrt(0.5)
    >>> turned = quaternion_to_matrix(np.array([0, 0, half, half])) @ [1, 0, 0]
    >>> bool(np.allclose(turned, [0, 1, 0]))
    True
    """
    x, y, z, w = np.moveaxis(np.asarray(quaternions, dtype=np.float64), -1, 0)
    scale = 2.0 / (x * x + y * y + z * z + w * w)
    matrices = np.empty((*x.shape, 3, 3))
    matrices[..., 0, 0] = 1.0 - scale * (y * y + z * z)
    matrices[..., 0, 1] = scale * (x * y - z * w)
    matrices[..., 0, 2] = scale * (x * z + y * w)
    matrices[..., 1, 0] = scale * (x * y + z * w)
    matrices[..., 1, 1] = 1.0 - scale * (x * x + z * z)
    matrices[..., 1, 2] = scale * (y * z - x * w)
    matrices[..., 2, 0] = scale * (x * z - y * w)
    matrices[..., 2, 1] = scale * (y * z + x * w)
    matrices[..., 2, 2] = 1.0 - scale * (x * x + y * y)
    return matrices
