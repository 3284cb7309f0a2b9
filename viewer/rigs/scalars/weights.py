"""Quantities of the effective weights: after pruning and normalising, if enabled.

Several weights of one vertex for the same joint are one influence.
"""

from __future__ import annotations

import numpy as np

from viewer.rigs.arrays import Floats
from viewer.rigs.scalars._inputs import Asked
from viewer.rigs.skin import (
    has_influence,
    limit_influences,
    merged,
    owners,
    weight_sums,
)

_ROUNDING = 1e-14  # rounding error of sums of weights near 1, a few units in the last place


def weight(asked: Asked) -> Floats:
    """Return each vertex's weight of one joint: (V,), 0 without influence."""
    skin = asked.skin
    chosen = skin.joints == asked.joint
    found = np.bincount(owners(skin)[chosen], skin.weights[chosen], skin.n_vertices)
    return found.astype(np.float64, copy=False)


def dominant(asked: Asked) -> Floats:
    """Return the joint with the largest weight, the first of equal ones: (V,); -1 for none."""
    skin = asked.skin
    strongest = limit_influences(skin, 1)
    found = np.full(skin.n_vertices, -1.0)
    listed = np.diff(strongest.starts) > 0
    found[listed] = strongest.joints[strongest.starts[:-1][listed]]
    found[~has_influence(skin)] = -1.0
    return found


def influences(asked: Asked) -> Floats:
    """Return the number of joints with a non-zero weight at each vertex: (V,), integral."""
    skin = merged(asked.skin)
    counts = np.bincount(owners(skin)[skin.weights != 0.0], minlength=skin.n_vertices)
    return counts.astype(np.float64)


def sums(asked: Asked) -> Floats:
    """Return the error of each vertex's sum of weights: (V,), |sum_i w_i - 1|."""
    found = np.abs(weight_sums(asked.skin) - 1.0)
    found[found < _ROUNDING] = 0.0
    return found


def entropy(asked: Asked) -> Floats:
    """Return H = -sum_i p_i log2 p_i of p_i = |w_i| / sum_j |w_j| (Shannon 1948): (V,), bits."""
    skin = merged(asked.skin)
    vertices, sizes = owners(skin), np.abs(skin.weights)
    totals = np.bincount(vertices, sizes, skin.n_vertices)
    counts = sizes > 0.0
    fractions = sizes[counts] / totals[vertices[counts]]
    found = np.bincount(vertices[counts], -fractions * np.log2(fractions), skin.n_vertices)
    return np.maximum(found, 0.0)  # this replaces -0 by 0
