"""Measurements of a body: height, volume and mass."""

from __future__ import annotations

from dataclasses import dataclass

from viewer.errors import RigError
from viewer.rig.figure import Figure
from viewer.rig.mesh import bounding_box, volume

__all__ = ["DENSITY", "Measures", "measure"]

DENSITY = 985.0
"""Density of a human body, kg per cubic metre."""


@dataclass(frozen=True, slots=True)
class Measures:
    """Measurements of a rest mesh, in its own unit.

    Attributes
    ----------
    height : float
        Extent along the up axis.
    volume : float
        Enclosed volume, cubed units.
    mass : float or None
        Volume times ``DENSITY``, kilograms; None unless the unit is metres.
    """

    height: float
    volume: float
    mass: float | None


def measure(figure: Figure) -> Measures:
    """Measure the rest mesh of a figure whose blend shapes have been applied.

    Parameters
    ----------
    figure : Figure
        Figure with a mesh.

    Raises
    ------
    RigError
        If the figure has no mesh.
    """
    if figure.mesh is None:
        raise RigError(f"figure {figure.name} has no mesh to measure")
    box = bounding_box(figure.mesh.positions)
    axis = 2 if figure.up == "z" else 1
    inside = abs(volume(figure.mesh.positions, figure.mesh.triangles))
    mass = DENSITY * inside if figure.unit == "m" else None
    return Measures(float(box[1, axis] - box[0, axis]), inside, mass)
