"""The fox's closed triangle mesh: one half is polygonised, remeshed and mirrored."""

import numpy as np
from generator_tools.remesh import drop_unused, remesh
from generator_tools.shapes import Floats
from generator_tools.surface import graded_length, project

from .body import distance, gradient
from .polygonise import polygonise_half

LARGEST = 0.0174  # maximum edge length, on the torso and tail, metres
GROWTH = 0.22  # growth of the edge length in metres per metre from the nearest detail
# Centre, radius and edge length of balls with finer triangles.
DETAILS = (
    ((0.0345, 0.5015, 0.3000), 0.014, 0.0038),
    ((0.0, 0.466, 0.365), 0.022, 0.0038),
    ((0.010, 0.457, 0.328), 0.026, 0.0032),
    ((0.024, 0.460, 0.305), 0.010, 0.0034),
    ((0.052, 0.600, 0.233), 0.050, 0.0052),
    ((0.0635, 0.643, 0.222), 0.006, 0.0030),
    ((0.0, 0.448, 0.358), 0.008, 0.0030),
    ((0.088, 0.448, 0.220), 0.038, 0.0056),
    ((0.053, 0.008, 0.140), 0.018, 0.0041),
    ((0.054, 0.008, -0.178), 0.018, 0.0041),
    ((0.053, 0.080, 0.100), 0.040, 0.0080),
    ((0.055, 0.100, -0.225), 0.040, 0.0080),
    ((0.0, 0.300, -0.685), 0.012, 0.0060),
    ((0.0, 0.320, 0.205), 0.070, 0.0105),
)


def wanted_length(points: Floats) -> Floats:
    """Return the target edge length (N,) at each point."""
    return graded_length(points, LARGEST, GROWTH, DETAILS)


def _to_surface(points: Floats) -> Floats:
    return project(points, distance, gradient)


def model_half() -> tuple[Floats, np.ndarray]:
    """Return vertices and triangles of the left half, with its rim exactly on x = 0."""
    vertices, triangles = polygonise_half()
    vertices, triangles = drop_unused(vertices, triangles)
    return remesh(vertices, triangles, wanted_length, _to_surface)
