"""Vertices whose normals follow the blended matrices, not their inverse transposes."""

from __future__ import annotations

import numpy as np

from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.kinematics import are_alike, rigid_sizes
from viewer.rigs.skin import Skin


def rigid_vertices(skin: Skin, palette: Floats) -> Bools:
    """Return which vertices (V,) have only joints that rotate, up to one common scale.

    Their normals follow the blended matrix, others the inverse transpose.
    """
    sizes = rigid_sizes(palette)
    rigid = np.ones(skin.n_vertices, dtype=np.bool_)
    if len(sizes) == 0 or are_alike(sizes.min(), sizes.max()):
        return rigid
    moving = np.flatnonzero(np.diff(skin.starts) > 0)
    if len(moving):
        own, is_used = sizes[skin.joints], skin.weights != 0.0
        edges = skin.starts[moving]
        lowest = np.minimum.reduceat(np.where(is_used, own, np.inf), edges)
        highest = np.maximum.reduceat(np.where(is_used, own, -np.inf), edges)
        with np.errstate(invalid="ignore"):
            rigid[moving] = are_alike(lowest, highest) | (lowest > highest)
    return rigid
