"""Nearest-vertex correspondence: weights copied unchanged, the simplest transfer."""

from __future__ import annotations

import numpy as np

from viewer.errors import RigError
from viewer.rig._scipy import scipy_part
from viewer.rig.arrays import Floats, Ints

__all__ = ["nearest_vertices"]


def nearest_vertices(template: Floats, points: Floats) -> tuple[Ints, Floats]:
    """Return the nearest vertex of the template for each point.

    Parameters
    ----------
    template : (V, 3)
        Positions of its vertices, in the points' space.
    points : (N, 3)
        Positions of the target's vertices.

    Returns
    -------
    vertices : (N,) int32
        ``skin_rows(skin, vertices)`` returns the target's skin.
    distances : (N,)
        Distance to each of these vertices.

    Raises
    ------
    RigError
        If the template has no vertex, or SciPy is missing.
    """
    if len(template) == 0:
        raise RigError("expected a template with vertices, found none")
    tree = scipy_part("spatial").cKDTree(template)
    distances, vertices = tree.query(points, workers=-1)
    return np.asarray(vertices, dtype=np.int32), np.asarray(distances, dtype=np.float64)
