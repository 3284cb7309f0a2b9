"""Distances between the weights of two skins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.rig.arrays import Floats, Ints
from viewer.rig.comparison.pairs import Pairs
from viewer.rig.geometry.closest_point import SurfacePoints
from viewer.rig.skin import Skin, owners, row_norms, skin_rows

__all__ = ["row_distances", "skin_at"]


def row_distances(first: Skin, second: Skin, pairs: Pairs) -> Floats:
    """Return the L1 distance of each vertex's weights: sum over joints of |w - w'|.

    The maximum for rows that sum to 1 is 2, if no joint has weight in both.

    Parameters
    ----------
    first, second : Skin
        Influences of the same V vertices.
    pairs : Pairs
        Matched joints; weights of unmatched joints are included in full.

    Returns
    -------
    (V,)
        0 for equal rows, regardless of the order of influences and of duplicate joints.
    """
    # Unmatched joints of the second skin get indices that the first skin does not use.
    names = np.arange(second.n_joints, dtype=np.int32) + first.n_joints
    names[pairs.second] = pairs.first
    return row_norms(
        first.n_vertices,
        np.concatenate([owners(first), owners(second)]),
        np.concatenate([first.joints, names[second.joints]]),
        np.concatenate([first.weights, -second.weights]),
    )


def skin_at(skin: Skin, triangles: Ints, found: SurfacePoints) -> Skin:
    """Interpolate a skin's weights at points of its surface by barycentric coordinates.

    Parameters
    ----------
    skin : Skin
        Influences on the mesh on which the points lie.
    triangles : (T, 3)
        Triangles of that mesh.
    found : SurfacePoints
        N points.

    Returns
    -------
    Skin
        Influences of N vertices; a vertex may list a joint several times.
    """
    corners = skin_rows(skin, triangles[found.triangles].ravel())
    factors = np.repeat(found.barycentric.ravel(), np.diff(corners.starts))
    return replace(corners, starts=corners.starts[::3], weights=factors * corners.weights)
