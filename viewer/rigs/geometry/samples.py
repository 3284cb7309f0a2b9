"""Evenly distributed sample points of a surface."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Floats, Ints, freeze_fields
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.mesh import area_vectors, triangle_areas


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceSamples:
    """Points of a surface, and the normals there."""

    positions: Floats
    """(N, 3). The mesh's unit."""
    normals: Floats
    """(N, 3). Unit normals of the triangles on which they lie."""
    triangles: Ints
    """(N,). Those triangles."""
    weights: Floats
    """(N, 3). Barycentric coordinates of the points in them."""

    def __post_init__(self) -> None:
        freeze_fields(self, positions=(None, 3))
        freeze_fields(self, normals=(len(self.positions), 3))
        freeze_fields(self, np.int32, triangles=(len(self.positions),))
        freeze_fields(self, weights=(len(self.positions), 3))


def triangle_normals(positions: Floats, triangles: Ints) -> Floats:
    """Return unit normals of triangles, 0 for triangles without area: (T, 3)."""
    return unit(area_vectors(positions, triangles))


def sample_surface(positions: Floats, triangles: Ints, count: int) -> SurfaceSamples:
    """Return evenly distributed points of a surface, deterministically."""
    # Positions along the cumulative area are evenly spaced, so every triangle gets points in
    # proportion to its area, rounded up or down. Within a triangle, the point is a (1 - sqrt u) + b
    # sqrt u (1 - v) + c v sqrt u (Turk 1990), with u and v from the R2 sequence (multiples of the
    # plastic number's powers).
    chosen = _even_triangles(positions, triangles, count)
    plastic = 1.32471795724474602596  # the real root of x^3 = x + 1
    u, v = (np.arange(1, count + 1) * plastic**-power % 1.0 for power in (1, 2))
    root = np.sqrt(u)
    weights = np.stack([1.0 - root, root * (1.0 - v), root * v], axis=1)
    corners = positions[triangles[chosen]]
    return SurfaceSamples(
        np.einsum("nk,nka->na", weights, corners),
        triangle_normals(positions, triangles[chosen]),
        chosen,
        weights,
    )


def even_vertices(positions: Floats, triangles: Ints, count: int) -> Ints:
    """Return at most ``count`` vertices, sorted, approximately evenly distributed by area."""
    return np.unique(triangles[_even_triangles(positions, triangles, count), 0])


def _even_triangles(positions: Floats, triangles: Ints, count: int) -> Ints:
    """Return triangles at evenly spaced positions along the cumulative area: (count,)."""
    areas = triangle_areas(positions, triangles)
    total = np.cumsum(areas)
    if len(areas) == 0 or not total[-1] > 0.0:
        raise RigError("expected a mesh with an area, found none")
    places = (np.arange(count) + 0.5) / count * total[-1]
    return np.minimum(np.searchsorted(total, places), len(areas) - 1).astype(np.int32)
