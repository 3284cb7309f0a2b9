"""The quantity of body parts."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.scalars._asked import Asked

__all__ = ["parts"]


def parts(asked: Asked) -> Floats:
    """Return the body part of each vertex: (V,), integral indices into the parts' names."""
    assert asked.figure.body_parts is not None  # required by the quantity
    return asked.figure.body_parts.of_vertex.astype(np.float64)
