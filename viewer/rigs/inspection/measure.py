"""Measurements of a body: height, volume and mass."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.topology import edges_of, sides_of, welded
from viewer.rigs.mesh import bounding_box, triangle_areas, volume

DENSITY = 985.0
"""Density of a human body, kg per cubic metre."""

# Maximum fraction of the surface that may be missing, for example at the eyes or the mouth of a
# body, for a meaningful volume.
_HOLE = 0.01


@dataclass(frozen=True, slots=True)
class Measures:
    """Measurements of a rest mesh, in its own unit."""

    height: float
    """Extent along the up axis."""
    volume: float | None
    """Enclosed volume, cubed units; None if the mesh is open."""
    mass: float | None
    """Volume times ``DENSITY``, kilograms; None if there is no volume or the unit is not metres."""
    n_open_edges: int = 0
    """Number of edges that belong to a single triangle, with coincident vertices merged."""


def measure(figure: Figure) -> Measures:
    """Measure the rest mesh of a figure whose blend shapes have been applied."""
    if figure.mesh is None:
        raise RigError(f"figure {figure.name} has no mesh to measure")
    box = bounding_box(figure.mesh.positions)
    axis = 2 if figure.up == "z" else 1
    height = float(box[1, axis] - box[0, axis])
    positions, triangles = figure.mesh.positions, figure.mesh.triangles
    edges = _open_edges(positions, triangles)
    lengths = np.linalg.norm(positions[edges[:, 1]] - positions[edges[:, 0]], axis=1)
    # Of all boundaries of a given length, a circle encloses the largest area.
    hole = lengths.sum() ** 2 / (4.0 * np.pi)
    if not len(triangles) or hole > _HOLE * triangle_areas(positions, triangles).sum():
        return Measures(height, None, None, len(edges))
    inside = abs(volume(positions, triangles))
    mass = DENSITY * inside if figure.unit == "m" else None
    return Measures(height, inside, mass, len(edges))


def _open_edges(positions: Floats, triangles: Ints) -> Ints:
    """Return the edges that belong to a single triangle, as vertices (E, 2)."""
    is_open = edges_of(triangles).counts == 1
    if is_open.any():
        # Vertices are often duplicated along texture seams.
        is_open = edges_of(welded(positions, triangles)).counts == 1
    return sides_of(triangles).reshape(-1, 2)[is_open]
