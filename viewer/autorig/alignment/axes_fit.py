"""Another scale along each axis, of target or template: for what was stretched as a whole."""

from __future__ import annotations

import numpy as np

from viewer.autorig.alignment.icp import FEWEST, HOLD, SETTLED, Pairs, Side, pairs_between
from viewer.autorig.alignment.similarity import Similarity
from viewer.rig.arrays import Floats
from viewer.rig.geometry.rotation import rotation_vector_to_matrix

__all__ = ["fit_axes"]


def fit_axes(
    template: Side,
    target: Side,
    start: Similarity,
    rounds: int,
    turns: bool = False,
    own: bool = False,
) -> Similarity:
    """Find another scale along each axis.

    Each round solves for factors f, a shift t and, if asked, a small turn w that minimise
    sum (n . (x - q))^2 + 1e-5 |x - q|^2 with x = f R p + f' (w x R p) + t, or with the template's
    axes x = R f p + w x R f' p + t, in which f' are the factors so far: linear in all that is
    looked for.

    Parameters
    ----------
    template, target, rounds
        As for ``slide``.
    start : Similarity
        Roughly right, with one scale.
    turns : bool
        Whether the rotation is improved too: one that was found with one scale for all axes leans
        towards what a stretched target's diagonal asks for.
    own : bool
        Whether the axes are the template's.

    Returns
    -------
    Similarity
        With factors; the best so far where a fit would mirror, or too few pairs are left.
    """
    placed, scales = start, np.full(3, start.scale)
    for _ in range(rounds):
        pairs = pairs_between(template, target, placed)
        if len(pairs.points) < FEWEST:
            break
        before = scales
        columns = _columns(pairs.points, placed.rotation, before, turns, own)
        found, turn, shift = _solved(pairs, columns)
        if (found <= 0.0).any():
            break
        scales = found
        scale = float(np.cbrt(np.prod(scales)))
        rotation = rotation_vector_to_matrix(turn) @ placed.rotation
        factors, own_factors = np.ones(3), np.ones(3)
        (own_factors if own else factors)[:] = scales / scale
        placed = Similarity(scale, rotation, shift, factors, own_factors)
        if max(np.abs(scales / before - 1.0).max(), float(np.linalg.norm(turn))) < SETTLED:
            break
    return placed


def _columns(points: Floats, rotation: Floats, before: Floats, turns: bool, own: bool) -> Floats:
    """Return what moves points by factors, shift and turn: (N, 3, 6 or 9)."""
    if own:
        scaled = points[:, None, :] * rotation
        arms, lift = (points * before) @ rotation.T, np.ones(3)
    else:
        arms, lift = points @ rotation.T, before
        scaled = arms[:, :, None] * np.eye(3)
    parts = [scaled, np.broadcast_to(np.eye(3), scaled.shape)]
    if turns:
        x, y, z = arms.T
        null = np.zeros_like(x)
        # Columns are the axes crossed with the arm.
        crossed = np.stack([null, z, -y, -z, null, x, y, -x, null], axis=1).reshape(-1, 3, 3)
        parts.append(lift[:, None] * crossed)
    return np.concatenate(parts, axis=2)


def _solved(pairs: Pairs, columns: Floats) -> tuple[Floats, Floats, Floats]:
    along = np.einsum("na,nak->nk", pairs.normals, columns)
    rows = np.concatenate([along, HOLD * columns.reshape(-1, columns.shape[2])])
    values = np.einsum("na,na->n", pairs.normals, pairs.targets)
    solved = np.linalg.lstsq(rows, np.concatenate([values, HOLD * pairs.targets.ravel()]))[0]
    turn = solved[6:] if len(solved) > 6 else np.zeros(3)
    return solved[:3], turn, solved[3:6]
