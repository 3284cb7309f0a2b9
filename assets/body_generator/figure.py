"""The whole figure as a signed distance; metres, +Y up, facing +Z, standing on y = 0."""

import numpy as np
from generator_tools.shapes import Floats, fold, smooth_max, smooth_min

from . import extremities, head, limbs, trunk
from .loft import Part

SOLE = 0.010  # rounding radius of the edge of the sole, metres
PARTS: list[Part] = trunk.PARTS + limbs.PARTS + head.PARTS + extremities.PARTS


def distance(points: Floats) -> Floats:
    """Return the signed distance (N,) to the figure."""
    folded = fold(points)
    field = np.full(len(points), 1.0)
    for part in PARTS:
        d = part.shape.distance(folded)
        field = smooth_max(field, -d, part.blend) if part.cut else smooth_min(field, d, part.blend)
    return smooth_max(field, -points[:, 1], SOLE)


def gradient(points: Floats) -> Floats:
    """Return the gradient (N, 3) of `distance` by central differences."""
    step = 2e-4  # step in metres, well below the smallest feature and well above rounding errors
    slopes = np.empty_like(points)
    for axis in range(3):
        shift = np.zeros(3)
        shift[axis] = step
        slopes[:, axis] = distance(points + shift) - distance(points - shift)
    return slopes / (2 * step)


def project(points: Floats) -> Floats:
    """Move points onto the surface by a few damped Newton steps."""
    for _ in range(3):
        slope = gradient(points)
        square = np.maximum(np.einsum("ni,ni->n", slope, slope), 0.25)
        step = np.clip(distance(points) / square, -0.003, 0.003)
        points = points - step[:, None] * slope
    return points
