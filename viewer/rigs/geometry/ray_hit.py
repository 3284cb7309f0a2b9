"""Intersection of a ray with a triangle mesh."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats, Ints

_AT_ONCE = 1 << 18  # triangles per batch, about 300 bytes each
_EDGE = 1e-9  # barycentric tolerance: no ray may pass between two adjacent triangles


@dataclass(frozen=True, slots=True, eq=False)
class RayHit:
    """The intersection of a ray with a surface."""

    triangle: int
    """Index of the triangle that is hit."""
    barycentric: Floats
    """(3,). Weights of its corners, with a sum of 1."""
    distance: float
    """Distance from the ray's origin, in multiples of the length of its direction."""


def first_hit(
    positions: Floats, triangles: Ints, origin: Floats, direction: Floats
) -> RayHit | None:
    """Return the first intersection of a ray with a surface, from either side, or None."""
    best: RayHit | None = None
    for start in range(0, len(triangles), _AT_ONCE):
        hit = _nearest(positions, triangles[start : start + _AT_ONCE], origin, direction)
        if hit is not None and (best is None or hit.distance < best.distance):
            best = RayHit(hit.triangle + start, hit.barycentric, hit.distance)
    return best


def _nearest(
    positions: Floats, triangles: Ints, origin: Floats, direction: Floats
) -> RayHit | None:
    """Return the nearest hit of a ray among some triangles, or None."""
    a, b, c = (positions[triangles[:, corner]] for corner in range(3))
    first, second, away = b - a, c - a, origin - a
    # With edges e1, e2 from corner a, o + t d = a + u e1 + v e2 is solved by determinants
    # (Möller and Trumbore 1997, eq. 6).
    # The paper's vectors P and Q.
    p, q = np.cross(direction, second), np.cross(away, first)
    determinant = np.einsum("na,na->n", first, p)
    # Triangles parallel to the ray are not hit.
    seen = determinant != 0.0
    inverse = np.divide(1.0, determinant, out=np.zeros(len(determinant)), where=seen)
    u = np.einsum("na,na->n", away, p) * inverse
    v = (q @ direction) * inverse
    t = np.einsum("na,na->n", second, q) * inverse
    inside = seen & (u >= -_EDGE) & (v >= -_EDGE) & (u + v <= 1.0 + _EDGE) & (t > 0.0)
    t = np.where(inside, t, np.inf)
    nearest = int(t.argmin()) if len(t) else -1
    if nearest < 0 or not np.isfinite(t[nearest]):
        return None
    # The tolerance admits hits just outside an edge: clip their negative weights.
    weights = np.clip([1.0 - u[nearest] - v[nearest], u[nearest], v[nearest]], 0.0, 1.0)
    return RayHit(nearest, weights / weights.sum(), float(t[nearest]))


def surface_point(positions: Floats, triangles: Ints, hit: RayHit) -> Floats:
    """Return the position of a hit for the current vertices of the surface: (3,)."""
    return np.asarray(hit.barycentric @ positions[triangles[hit.triangle]])
