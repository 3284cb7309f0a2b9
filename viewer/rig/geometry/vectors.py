"""Vector normalisation, and transforms of tangents."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats


def unit(vectors: Floats) -> Floats:
    """Return vectors of length 1; a vector of length 0 stays 0.

    Parameters
    ----------
    vectors : (..., 3)
        Vectors of any length.

    Returns
    -------
    (..., 3)
        Unit vectors.

    >>> unit(np.array([0.0, 3.0, 4.0])).tolist()
    [0.0, 0.6, 0.8]
    """
    lengths = np.sqrt(np.einsum("...a,...a->...", vectors, vectors))[..., None]
    return vectors / np.where(lengths == 0.0, 1.0, lengths)


def moved_tangents(tangents: Floats, linear: Floats) -> Floats:
    """Return tangents transformed by a matrix, t' = A t / |A t|; a reflection changes the signs.

    Parameters
    ----------
    tangents : (N, 4)
        Direction of u, and the sign s of the direction of v, s n x t. Zeros stay 0.
    linear : (3, 3)
        A.

    Returns
    -------
    (N, 4)
        Unit vectors and signs.

    >>> moved_tangents(np.array([[2.0, 0.0, 0.0, 1.0]]), np.diag([1.0, 1.0, -1.0])).tolist()
    [[1.0, 0.0, 0.0, -1.0]]
    """
    reflects = -1.0 if np.linalg.det(linear) < 0.0 else 1.0
    signs = reflects * np.sign(tangents[:, 3:])
    return np.concatenate([unit(tangents[:, :3] @ linear.T), signs], axis=1)
