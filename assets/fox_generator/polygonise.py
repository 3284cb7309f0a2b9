"""The grid over the left half of the fox, finer at the head and paws."""

import numpy as np
from generator_tools.polygonise import planes, polygonise
from generator_tools.shapes import Floats

from .body import distance

STEPS = (0.0035, 0.0017)  # distances between grid planes, coarse and fine, metres


def polygonise_half() -> tuple[Floats, np.ndarray]:
    """Return vertices (V, 3) and triangles (T, 3) of the half x >= 0, open along x = 0."""
    axes = [
        planes(0.0, 0.130, [(0.0, 0.130)], STEPS),
        planes(-0.012, 0.69, [(-0.012, 0.045), (0.40, 0.69)], STEPS),
        planes(-0.71, 0.425, [(-0.22, -0.15), (0.09, 0.16), (0.22, 0.425)], STEPS),
    ]
    return polygonise(distance, axes)
