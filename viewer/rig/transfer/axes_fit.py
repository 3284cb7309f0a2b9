"""Another scale along each axis of the target: for what was stretched as a whole."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.rotation import rotation_vector_to_matrix
from viewer.rig.transfer.icp import FEWEST, HOLD, SETTLED, Pairs, Side, pairs_between
from viewer.rig.transfer.similarity import Similarity

__all__ = ["fit_axes"]


def fit_axes(
    template: Side, target: Side, start: Similarity, rounds: int, turns: bool = False
) -> Similarity:
    """Find another scale along each axis of the target.

    Each round solves for factors f, a shift t and, if asked, a small turn w that minimise
    sum (n . (x - q))^2 + 1e-5 |x - q|^2 with x = f R p + f' (w x R p) + t, in which f' are the
    factors so far: linear in all that is looked for.

    Parameters
    ----------
    template, target, start, rounds
        As for ``slide``.
    turns : bool
        Whether the rotation is improved too: one that was found with one scale for all axes leans
        towards what a stretched target's diagonal asks for.

    Returns
    -------
    Similarity
        With factors; the best so far where a fit would mirror, or too few pairs are left.
    """
    placed = start
    for _ in range(rounds):
        pairs = pairs_between(template, target, placed)
        if len(pairs.points) < FEWEST:
            break
        scales, turn, shift = _solved(placed, pairs, turns)
        if (scales <= 0.0).any():
            break
        scale = float(np.cbrt(np.prod(scales)))
        change = np.abs(scales / (placed.scale * placed.factors) - 1.0).max()
        rotation = rotation_vector_to_matrix(turn) @ placed.rotation
        placed = Similarity(scale, rotation, shift, scales / scale)
        if max(change, float(np.linalg.norm(turn))) < SETTLED:
            break
    return placed


def _solved(placed: Similarity, pairs: Pairs, turns: bool) -> tuple[Floats, Floats, Floats]:
    arms = pairs.points @ placed.rotation.T
    before = placed.scale * placed.factors
    parts = [arms[:, :, None] * np.eye(3), np.broadcast_to(np.eye(3), (len(arms), 3, 3))]
    if turns:
        x, y, z = arms.T
        null = np.zeros_like(x)
        # Columns are the axes crossed with the arm.
        crossed = np.stack([null, z, -y, -z, null, x, y, -x, null], axis=1).reshape(-1, 3, 3)
        parts.append(before[:, None] * crossed)
    whole = np.concatenate(parts, axis=2)
    along = np.einsum("na,nak->nk", pairs.normals, whole)
    rows = np.concatenate([along, HOLD * whole.reshape(-1, whole.shape[2])])
    values = np.einsum("na,na->n", pairs.normals, pairs.targets)
    solved = np.linalg.lstsq(rows, np.concatenate([values, HOLD * pairs.targets.ravel()]))[0]
    return solved[:3], solved[6:] if turns else np.zeros(3), solved[3:6]
