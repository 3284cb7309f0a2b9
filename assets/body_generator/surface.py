"""The figure's closed triangle mesh: one half is polygonised, remeshed and mirrored."""

import numpy as np
from generator_tools.polygonise import planes, polygonise
from generator_tools.remesh import drop_unused, remesh
from generator_tools.shapes import Floats
from generator_tools.surface import graded_length, mirror

from .figure import distance, project

STEPS = (0.0056, 0.0026)  # distances between grid planes, coarse and fine, metres
LARGEST = 0.0245  # maximum edge length, on the trunk and thighs, metres
GROWTH = 0.20  # growth of the edge length in metres per metre from the nearest detail
# Centre, radius and edge length of balls with finer triangles.
DETAILS = (
    ((0.0315, 1.5910, 0.0930), 0.0160, 0.0027),
    ((0.0100, 1.5250, 0.1000), 0.0180, 0.0033),
    ((0.0060, 1.5530, 0.1150), 0.0140, 0.0034),
    ((0.0000, 1.5600, 0.0800), 0.0550, 0.0074),
    ((0.0000, 1.4900, 0.0850), 0.0200, 0.0070),
    ((0.0820, 1.5780, -0.0060), 0.0320, 0.0046),
    ((0.0000, 1.6100, 0.0000), 0.0950, 0.0125),
    ((0.7600, 1.3720, -0.0190), 0.0450, 0.0095),
    ((0.8300, 1.3650, -0.0120), 0.0550, 0.0066),
    ((0.7650, 1.3540, 0.0500), 0.0250, 0.0075),
    ((0.7930, 1.3500, 0.0680), 0.0060, 0.0046),
    ((0.8640, 1.3510, 0.0250), 0.0060, 0.0044),
    ((0.8790, 1.3530, -0.0050), 0.0060, 0.0044),
    ((0.8670, 1.3500, -0.0400), 0.0060, 0.0044),
    ((0.8390, 1.3500, -0.0650), 0.0060, 0.0042),
    ((0.1250, 0.0120, 0.1300), 0.0350, 0.0066),
    ((0.1180, 0.0100, 0.1480), 0.0150, 0.0052),
    ((0.1420, 0.0100, 0.1290), 0.0150, 0.0052),
    ((0.1650, 0.0080, 0.1160), 0.0080, 0.0045),
    ((0.1050, 0.0120, 0.1560), 0.0060, 0.0048),
    ((0.1150, 0.0350, 0.0300), 0.0800, 0.0145),
    ((0.1020, 0.0150, -0.0900), 0.0250, 0.0100),
    ((0.0780, 0.0840, -0.0300), 0.0120, 0.0090),
    ((0.1380, 0.0730, -0.0410), 0.0120, 0.0090),
    ((0.4400, 1.3720, -0.0300), 0.0500, 0.0145),
    ((0.1000, 0.4870, 0.0000), 0.0600, 0.0165),
    ((0.1500, 1.3200, -0.0200), 0.0600, 0.0165),
    ((0.0300, 1.3900, 0.0200), 0.0300, 0.0110),
    ((0.0900, 1.4050, 0.0050), 0.0400, 0.0145),
    ((0.0000, 1.0350, 0.1070), 0.0050, 0.0070),
    ((0.0300, 0.8200, 0.0000), 0.0600, 0.0165),
    ((0.0000, 0.7950, 0.0000), 0.0250, 0.0100),
)


def wanted_length(points: Floats) -> Floats:
    """Return the target edge length (N,) at each point."""
    return graded_length(points, LARGEST, GROWTH, DETAILS)


def _grid() -> list[Floats]:
    return [
        planes(0.0, 0.90, [(0.0, 0.10), (0.70, 0.90)], STEPS),
        planes(-0.012, 1.715, [(-0.012, 0.04), (1.335, 1.40), (1.48, 1.63)], STEPS),
        planes(-0.175, 0.20, [(-0.07, 0.20)], STEPS),
    ]


def model() -> tuple[Floats, np.ndarray, np.ndarray]:
    """Return vertices (V, 3), triangles (F, 3) and the mirror counterpart of each vertex (V,)."""
    half, triangles = drop_unused(*polygonise(distance, _grid()))
    half, triangles = remesh(half, triangles, wanted_length, project)
    vertices, triangles, source = mirror(half, triangles)
    partner = np.arange(len(vertices))
    partner[len(half) :] = source[len(half) :]
    partner[source[len(half) :]] = np.arange(len(half), len(vertices))
    # Euler's formula for a closed mesh without tunnels.
    if len(vertices) - len(triangles) // 2 != 2:
        raise ValueError("the surface has a tunnel")
    return vertices, triangles, partner
