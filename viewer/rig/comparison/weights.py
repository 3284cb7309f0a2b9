"""How differently two skins weight the same vertices."""

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

    Rows that sum to 1 differ by 2 at most: all weight on other joints.

    Parameters
    ----------
    first, second : Skin
        Of the same vertices, V.
    pairs : Pairs
        Which joint is which; weights on joints without a partner count in full.

    Returns
    -------
    (V,)
        0 for equal rows, however they are ordered or split.
    """
    # Joints of the second without a partner are joints of their own.
    names = np.arange(second.n_joints, dtype=np.int32) + first.n_joints
    names[pairs.second] = pairs.first
    return row_norms(
        first.n_vertices,
        np.concatenate([owners(first), owners(second)]),
        np.concatenate([first.joints, names[second.joints]]),
        np.concatenate([first.weights, -second.weights]),
    )


def skin_at(skin: Skin, triangles: Ints, found: SurfacePoints) -> Skin:
    """Return a skin's weights at points of its surface, mixed by barycentric coordinates.

    Parameters
    ----------
    skin : Skin
        Of the mesh that the points lie on.
    triangles : (T, 3)
        Of that mesh.
    found : SurfacePoints
        N points.

    Returns
    -------
    Skin
        Of N vertices; a joint may occur several times in one.
    """
    corners = skin_rows(skin, triangles[found.triangles].ravel())
    shares = np.repeat(found.barycentric.ravel(), np.diff(corners.starts))
    return replace(corners, starts=corners.starts[::3], weights=shares * corners.weights)
