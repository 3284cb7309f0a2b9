"""Quantities of the weights as they count: after cutting and normalising, if that is on.

Weights that a vertex lists for one joint several times are one influence.
"""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.scalars._asked import Asked
from viewer.rig.skin import (
    has_influence,
    limit_influences,
    merged,
    owners,
    weight_sums,
)

__all__ = ["dominant", "entropy", "influences", "sums", "weight"]

_ROUNDING = 1e-14  # a few of float64's steps: what sums of weights are off by


def weight(asked: Asked) -> Floats:
    """Return each vertex's weight of one joint: (V,), 0 where the joint has none."""
    skin = asked.skin
    chosen = skin.joints == asked.joint
    found = np.bincount(owners(skin)[chosen], skin.weights[chosen], skin.n_vertices)
    return found.astype(np.float64, copy=False)


def dominant(asked: Asked) -> Floats:
    """Return each vertex's joint of the largest weight: (V,), whole; -1 without influence.

    Of equal weights the first joint listed counts.
    """
    skin = asked.skin
    strongest = limit_influences(skin, 1)
    found = np.full(skin.n_vertices, -1.0)
    listed = np.diff(strongest.starts) > 0
    found[listed] = strongest.joints[strongest.starts[:-1][listed]]
    found[~has_influence(skin)] = -1.0
    return found


def influences(asked: Asked) -> Floats:
    """Return how many joints move each vertex, with a weight that is not 0: (V,), whole."""
    skin = merged(asked.skin)
    counts = np.bincount(owners(skin)[skin.weights != 0.0], minlength=skin.n_vertices)
    return counts.astype(np.float64)


def sums(asked: Asked) -> Floats:
    """Return how far each vertex's weights are from a sum of 1: (V,), |sum_i w_i - 1|."""
    found = np.abs(weight_sums(asked.skin) - 1.0)
    found[found < _ROUNDING] = 0.0
    return found


def entropy(asked: Asked) -> Floats:
    """Return how evenly each vertex's weight is spread: H = -sum_i p_i log2 p_i.

    With p_i = |w_i| / sum_j |w_j| (Shannon 1948): 0 bits if one joint has all, 1 bit for two equal
    weights, 2 bits for four. (V,), bits; 0 without influence.
    """
    skin = merged(asked.skin)
    vertices, sizes = owners(skin), np.abs(skin.weights)
    totals = np.bincount(vertices, sizes, skin.n_vertices)
    counts = sizes > 0.0
    shares = sizes[counts] / totals[vertices[counts]]
    found = np.bincount(vertices[counts], -shares * np.log2(shares), skin.n_vertices)
    return np.maximum(found, 0.0)  # 0, not -0
