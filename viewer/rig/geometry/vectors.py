"""Vector normalisation."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats

__all__ = ["unit"]


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
