"""Shapes defined by cross-sections, and the parts from which a figure is blended."""

from dataclasses import dataclass

import numpy as np
from generator_tools.shapes import FAR, Ellipsoid, Floats, Tube, smooth_max
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

CAP = 0.012  # rounding radius of a loft's flat ends, metres


@dataclass(frozen=True, slots=True, eq=False)
class Loft:
    """A limb or trunk along a coordinate axis, between cross-sections of four quarter ovals.

    Parameters
    ----------
    axis : int
        The coordinate along which the sections are stacked; the other two, in ascending order, are
        the coordinates of a section.
    places : (S,)
        Ascending positions of the sections along the axis.
    sections : callable
        Maps positions (N,) to rows (N, 7): centre (2), radii towards +first, -first, +second,
        -second (4), and the exponent: 2 gives an ellipse, larger ones are boxier.
    reach : (2, 3)
        Box outside which the distance is only approximate, see `FAR`.
    """

    axis: int
    places: Floats
    sections: PchipInterpolator
    reach: Floats

    def distance(self, points: Floats) -> Floats:
        """Return the first-order distance to the section at each point's axis coordinate."""
        result = np.full(len(points), FAR)
        near = np.all((points > self.reach[0]) & (points < self.reach[1]), axis=1)
        if not near.any():
            return result
        inner = points[near]
        along = inner[:, self.axis]
        low, high = self.places[[0, -1]]
        rows = self.sections(np.clip(along, low, high))
        across = np.delete(inner, self.axis, axis=1) - rows[:, :2]
        radii = np.where(across > 0, rows[:, 2:6:2], rows[:, 3:6:2])
        power = rows[:, 6:7]
        unit = np.maximum(np.abs(across) / radii, 1e-9)
        level = np.sum(unit**power, axis=1, keepdims=True) ** (1 / power)
        slope = np.linalg.norm((unit / level) ** (power - 1) / radii, axis=1)
        side = (level[:, 0] - 1) / slope
        ends = np.abs(along - (low + high) / 2) - (high - low) / 2
        result[near] = smooth_max(side, ends, CAP)
        return result


def loft(axis: int, rows: ArrayLike) -> Loft:
    """Build a loft from rows (place, middle 2, radii 4, exponent)."""
    table = np.asarray(rows, dtype=float)
    widest = table[:, 3:7].max() + FAR
    low, high = np.empty(3), np.empty(3)
    low[axis], high[axis] = table[0, 0] - FAR, table[-1, 0] + FAR
    others = [i for i in range(3) if i != axis]
    low[others] = table[:, 1:3].min(axis=0) - widest
    high[others] = table[:, 1:3].max(axis=0) + widest
    return Loft(
        axis, table[:, 0], PchipInterpolator(table[:, 0], table[:, 1:]), np.stack([low, high])
    )


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A shape in its own frame: rotated by ``rotation`` (3, 3), then moved to ``origin``."""

    shape: "Shape"
    rotation: Floats
    origin: Floats

    def distance(self, points: Floats) -> Floats:
        """Return the shape's distance at the points, transformed to its frame."""
        return self.shape.distance((points - self.origin) @ self.rotation)


Shape = Tube | Ellipsoid | Loft | Placed


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A shape, the width of its blend with the previous parts, and whether it is subtracted."""

    shape: Shape
    blend: float
    cut: bool = False


def ball(
    x: float, y: float, z: float, radii: float | tuple[float, float, float], pitch: float = 0.0
) -> Ellipsoid:
    """Return an ellipsoid at a point; with a single radius, a sphere."""
    three = radii if isinstance(radii, tuple) else (radii,) * 3
    return Ellipsoid((x, y, z), three, pitch)


def turn(axis: int, degrees: float) -> Floats:
    """Return the rotation (3, 3) about a coordinate axis."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


def placed(parts: list[Part], rotation: Floats, origin: ArrayLike) -> list[Part]:
    """Place parts that were modelled in their own frame."""
    at = np.asarray(origin, dtype=float)
    return [Part(Placed(part.shape, rotation, at), part.blend, part.cut) for part in parts]
