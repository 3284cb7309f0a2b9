"""Influences of the vertices of one primitive."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.formats._nodes.content import Primitive
from viewer.rig.arrays import Floats, Ints

__all__ = ["Influences", "divided", "of_rows", "on_joint"]

_NO_SUM = 1e-12  # minimum sum of weights that is scaled to 1


@dataclass(frozen=True, slots=True, eq=False)
class Influences:
    """A flat list of influences, vertex by vertex.

    Attributes
    ----------
    counts : (V,)
        Number of influences of each vertex.
    joints, weights : (N,) int32, (N,)
        Joint of the figure and weight of each; the weights of a vertex sum to 1.
    deviation : float
        Largest deviation of a sum of weights from 1 before normalisation.
    n_deviating : int
        Number of sums that deviate by more than the rounding of 8-bit weights.
    n_unbound : int
        Number of vertices without any weight.
    """

    counts: Ints
    joints: Ints
    weights: Floats
    deviation: float = 0.0
    n_deviating: int = 0
    n_unbound: int = 0


def on_joint(n_vertices: int, joint: int) -> Influences:
    """Return the influences of vertices that follow one joint rigidly."""
    counts, joints = np.ones(n_vertices, np.int32), np.full(n_vertices, joint, np.int32)
    return Influences(counts, joints, np.ones(n_vertices))


def divided(primitive: Primitive, slots: Ints) -> Influences:
    """Return a skinned primitive's influences, normalised to sums of 1 (glTF 2.0, 3.7.3.1).

    A vertex without weights follows the joint of its first slot, as in Blender and three.js.

    Parameters
    ----------
    primitive : Primitive
        A primitive with (V, K) joints and weights.
    slots : (M,) int32
        Joint of the figure for each joint of the skin.

    Returns
    -------
    Influences
        Influences whose weight is not 0.
    """
    assert primitive.joints is not None and primitive.weights is not None
    weights = primitive.weights.astype(np.float64)
    sums = weights.sum(axis=1)
    unbound = np.abs(sums) < _NO_SUM
    weights[unbound] = 0.0
    weights[unbound, :1] = 1.0
    weights /= np.where(unbound, 1.0, sums)[:, None]
    used = weights != 0.0
    deviations = np.abs(sums - 1.0)[~unbound]
    # Each of K weights is rounded to a multiple of 1 / 255.
    rounding = 0.5 / 255.0 * weights.shape[1] + 1e-6
    return Influences(
        np.count_nonzero(used, axis=1).astype(np.int32),
        slots[primitive.joints[used]],
        weights[used],
        float(deviations.max(initial=0.0)),
        int(np.count_nonzero(deviations > rounding)),
        int(np.count_nonzero(unbound)),
    )


def of_rows(influences: Influences, rows: Ints) -> Influences:
    """Return the influences of the given vertices, which may repeat."""
    starts = np.concatenate([[0], np.cumsum(influences.counts)])
    counts = influences.counts[rows]
    firsts = np.concatenate([[0], np.cumsum(counts)])
    index = np.repeat(starts[rows] - firsts[:-1], counts) + np.arange(firsts[-1])
    return Influences(counts, influences.joints[index], influences.weights[index])
