"""Noise stretched along the fur, for strokes and for frayed edges between colours."""

import numpy as np
from generator_tools.shapes import Floats
from scipy.ndimage import map_coordinates

LATTICE = np.random.default_rng(20).standard_normal((48, 48, 48))


def rise(low: float, high: float, value: Floats) -> Floats:
    """Rise smoothly from 0 at ``low`` to 1 at ``high``; ``low`` may be greater than ``high``."""
    t = np.clip((value - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def noise(points: Floats, size: float) -> Floats:
    """Return smooth random values (N,) of about unit spread, with features ``size`` metres wide."""
    return 1.6 * map_coordinates(LATTICE, (points / size).T, order=1, mode="grid-wrap")


def strokes(points: Floats, along: Floats, width: float, length: float) -> Floats:
    """Average noise along the unit directions (N, 3), which smears it into hairs."""
    steps = np.linspace(-0.5, 0.5, 9) * length
    return sum(noise(points + step * along, width) for step in steps) / np.sqrt(len(steps))


def fur_direction(points: Floats, normals: Floats) -> Floats:
    """Return the unit tangents (N, 3) along which the fur lies."""
    _, y, z = points.T
    flow = np.tile([0.0, -0.45, -1.0], (len(points), 1))
    zones = (
        (rise(0.28, 0.20, y) * rise(-0.25, -0.23, z), [0, -1, -0.15]),
        (rise(-0.22, -0.28, z), [0, -0.1, -1]),
        (rise(0.08, 0.17, z) * rise(0.50, 0.44, y), [0, -1, -0.45]),
        (rise(0.19, 0.23, z) * rise(0.41, 0.45, y), 12 * (points - [0.0, 0.475, 0.400])),
        (rise(0.54, 0.57, y), [0, 1, 0]),
    )
    for cover, direction in zones:
        flow += cover[:, None] * (direction - flow)
    flow -= np.einsum("ni,ni->n", flow, normals)[:, None] * normals
    return flow / np.maximum(np.linalg.norm(flow, axis=1, keepdims=True), 1e-6)
