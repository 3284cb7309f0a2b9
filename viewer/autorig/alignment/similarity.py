"""Similarities between point sets: rotation, shift and one scale, never a reflection."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Floats, freeze_fields
from viewer.rigs.geometry.rotation import nearest_similarity

# Ratio of the second to the first extent below which points are collinear, so that the rotation is
# undetermined.
_ON_LINE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Similarity:
    """A map of points, p' = F s R H p + t, F = diag(factors), H = diag(own_factors)."""

    scale: float
    """Scale common to all axes."""
    rotation: Floats
    """(3, 3). Proper rotation, applied after ``own_factors``."""
    shift: Floats
    """(3,). Translation in the unit of the target space."""
    factors: Floats
    """(3,). Additional scales along the axes of the target space; their product is 1."""
    own_factors: Floats = field(default_factory=lambda: np.ones(3))
    """(3,). Additional scales along the axes of the source space."""

    def __post_init__(self) -> None:
        freeze_fields(self, rotation=(3, 3), shift=(3,), factors=(3,), own_factors=(3,))
        if not 0.0 < self.scale < np.inf:
            raise RigError(f"alignment: expected a scale above 0, found {self.scale:g}")

    @property
    def linear(self) -> Floats:
        """F s R H: (3, 3)."""
        return (self.scale * self.factors)[:, None] * self.rotation * self.own_factors

    @property
    def is_plain(self) -> bool:
        """Whether the scale is the same in all directions."""
        return bool((self.factors == 1.0).all() and (self.own_factors == 1.0).all())

    @property
    def matrix(self) -> Floats:
        """The whole map as a matrix for column vectors: (4, 4)."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.linear
        matrix[:3, 3] = self.shift
        return matrix

    def apply(self, points: Floats) -> Floats:
        """Map points (..., 3)."""
        return points @ self.linear.T + self.shift

    def undo(self, points: Floats) -> Floats:
        """Map points (..., 3) of the target space back to the source space."""
        rotated = (points - self.shift) / (self.scale * self.factors) @ self.rotation
        return rotated / self.own_factors


def fit_similarity(points: Floats, targets: Floats, scale: float | None = None) -> Similarity:
    """Return the similarity that maps three or more points (N, 3), not on a line, to targets."""
    if len(points) < 3 or len(points) != len(targets):
        raise RigError(
            f"alignment: expected 3 or more pairs of points, found {len(points)} and {len(targets)}"
        )
    from_mean, to_mean = points.mean(axis=0), targets.mean(axis=0)
    p, q = points - from_mean, targets - to_mean
    for cloud in (p, q):
        extents = np.linalg.svd(cloud, compute_uv=False)
        if extents[1] <= _ON_LINE * extents[0]:
            raise RigError("alignment: expected points in a plane or in space, found a line")
    found, rotation, shift = nearest_similarity(points, targets)
    if scale is not None:
        found, shift = scale, to_mean - scale * rotation @ from_mean
    return Similarity(found, rotation, shift, np.ones(3))
