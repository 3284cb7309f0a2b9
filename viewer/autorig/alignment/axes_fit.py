"""Alignment with a separate scale along each axis of the target, for stretched meshes."""

from __future__ import annotations

import numpy as np

from viewer.autorig.alignment.icp import (
    FEWEST,
    SETTLED,
    Side,
    pairs_between,
    rotation_columns,
    solved_along,
)
from viewer.autorig.alignment.similarity import Similarity
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix


def fit_axes(
    template: Side,
    target: Side,
    start: Similarity,
    rounds: int,
    rotations: bool = False,
) -> Similarity:
    """Fit a separate scale along each axis.

    ``rotations`` also refines the rotation: one found with a single scale is biased towards the
    stretched target's diagonal. Returns the best alignment so far if the next fit would be a
    reflection or too few pairs are left.
    """
    similarity, scales = start, np.full(3, start.scale)
    for _ in range(rounds):
        pairs = pairs_between(template, target, similarity)
        if len(pairs.points) < FEWEST:
            break
        before = scales
        # Minimise sum (n . (x - q))^2 + 1e-5 |x - q|^2 over factors f, a shift t and, optionally, a
        # small rotation w, with x = f R p + f' (w x R p) + t. f' are the current factors: with f
        # there, the products of f and w would not be linear.
        columns = _columns(pairs.points, similarity.rotation, before, rotations)
        solved = solved_along(pairs.normals, columns, pairs.targets)
        found, shift = solved[:3], solved[3:6]
        vector = solved[6:] if rotations else np.zeros(3)
        if (found <= 0.0).any():
            break
        scales = found
        # The geometric mean is the common scale, so that the product of the factors is 1.
        scale = float(np.cbrt(np.prod(scales)))
        rotation = rotation_vector_to_matrix(vector) @ similarity.rotation
        similarity = Similarity(scale, rotation, shift, scales / scale)
        if max(np.abs(scales / before - 1.0).max(), float(np.linalg.norm(vector))) < SETTLED:
            break
    return similarity


def _columns(points: Floats, rotation: Floats, before: Floats, rotations: bool) -> Floats:
    """Return the Jacobian of points by factors, shift and rotation: (N, 3, 6 or 9)."""
    arms, lift = points @ rotation.T, before
    scaled = arms[:, :, None] * np.eye(3)
    parts = [scaled, np.broadcast_to(np.eye(3), scaled.shape)]
    if rotations:
        parts.append(lift[:, None] * rotation_columns(arms))
    return np.concatenate(parts, axis=2)
