"""How differently two skins weight the same vertices."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats, Ints
from viewer.rig.closest_point import SurfacePoints
from viewer.rig.comparison.pairs import Pairs
from viewer.rig.skin import Skin, owners

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
    n_joints = first.n_joints + second.n_joints  # joints of the second without a partner get more
    names = np.arange(second.n_joints, dtype=np.int64) + first.n_joints
    names[pairs.second] = pairs.first
    vertices = np.concatenate([owners(first), owners(second)]).astype(np.int64)
    joints = np.concatenate([first.joints.astype(np.int64), names[second.joints]])
    entries, places = np.unique(vertices * n_joints + joints, return_inverse=True)
    signed = np.bincount(places, np.concatenate([first.weights, -second.weights]))
    rows = entries // n_joints
    sums = np.bincount(rows, np.abs(signed), minlength=first.n_vertices)
    return sums.astype(np.float64, copy=False)


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
    corners = triangles[found.triangles].ravel()
    counts = np.diff(skin.starts)[corners]
    starts = np.concatenate([[0], np.cumsum(counts)])
    index = np.repeat(skin.starts[corners] - starts[:-1], counts) + np.arange(starts[-1])
    return Skin(
        starts=starts[::3].astype(np.int32),
        joints=skin.joints[index],
        weights=skin.weights[index] * np.repeat(found.barycentric.ravel(), counts),
        inverse_bind=skin.inverse_bind,
    )
