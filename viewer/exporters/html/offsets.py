"""Offsets of the rest vertices that change during a motion, as a few fields with weights.

Blend shapes and pose correctives displace the rest vertices by sum_p c_fp d_p in frame f. A motion
uses few of the possible displacements: the principal fields of its frames replace hundreds of d_p.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from viewer.data_classes import dataclass
from viewer.progress import report
from viewer.rigs.arrays import Floats

_NEGLIGIBLE = 1e-12  # singular value, relative to the largest, of directions that are never used
_SPREAD = 8.0  # first guess of the ratio between the largest error and its root mean square
_BLOCK = 32  # frames whose errors are computed at once


@dataclass(frozen=True, slots=True, eq=False)
class Fields:
    """Displacements as mean + sum_k weights_fk fields_k."""

    mean: Floats
    """(V, 3)."""
    weights: Floats
    """(F, K). At most 1."""
    fields: Floats
    """(K, V, 3)."""


def principal_fields(
    weights: Floats,
    displacement: Callable[[Floats], Floats],
    tolerance: float,
    is_centered: bool = True,
) -> Fields:
    """Return the fewest fields that reproduce ``displacement`` of weights (F, P), which is linear.

    The errors of all vertices in all frames are below ``tolerance``. The mean is 0 if not
    ``is_centered``.
    """
    middle = weights.mean(axis=0) * is_centered
    mean = displacement(middle)
    # C = U S W: the rows of W, orthonormal, span the weights that occur, so that each of them needs
    # to be displaced only once, and X = (U S) D with D = displacement(W) has all frames.
    left, sizes, basis = np.linalg.svd(weights - middle, full_matrices=False)
    n_used = int((sizes > _NEGLIGIBLE * max(float(sizes.max(initial=0.0)), 1.0)).sum())
    places = left[:, :n_used] * sizes[:n_used]
    made = np.zeros((n_used, mean.size))
    for row in range(n_used):
        report(row, n_used, "displacements")
        made[row] = displacement(basis[row]).reshape(-1)
    # The principal frames of X, from the small matrix D D^T = Q diag(l) Q^T: X has the same left
    # singular vectors P and singular values s as (U S) Q diag(sqrt l).
    spread, axes = np.linalg.eigh(made @ made.T)
    turned = places @ (axes * np.sqrt(np.maximum(spread, 0.0)))
    frames, strengths, _ = np.linalg.svd(turned, full_matrices=False)
    tails = np.sqrt(np.append(np.cumsum(strengths[::-1] ** 2)[::-1], 0.0))
    count = int((tails > tolerance / _SPREAD * np.sqrt(weights.shape[0] * len(mean))).sum())
    count = min(count, len(strengths))
    while count < len(strengths) and _error(frames[:, :count], places, made) > tolerance:
        count = min(count + max(1, count // 8), len(strengths))
    kept = frames[:, :count]
    # X ~ P P^T X. The weights are scaled to at most 1, so that a step means the same in all fields.
    scale = np.abs(kept).max(axis=0)
    fields = scale[:, None] * ((kept.T @ places) @ made)
    return Fields(mean, kept / scale, fields.reshape(count, *mean.shape))


def _error(kept: Floats, places: Floats, made: Floats) -> float:
    """Return the largest distance of a vertex from where all fields would place it."""
    rest, largest = places - kept @ (kept.T @ places), 0.0
    for first in range(0, len(rest), _BLOCK):
        report(first, len(rest), "errors of displacements")
        apart = (rest[first : first + _BLOCK] @ made).reshape(-1, 3)
        largest = max(largest, float(np.einsum("va,va->v", apart, apart).max(initial=0.0)))
    return float(np.sqrt(largest))
