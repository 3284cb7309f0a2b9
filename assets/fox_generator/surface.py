"""The fox's closed triangle mesh: half polygonised, remeshed, mirrored."""

import numpy as np

from .body import distance, gradient
from .polygonise import polygonise
from .remesh import drop_unused, face_normals, remesh
from .shapes import Floats

LARGEST = 0.0174  # metres; edge length on the torso and tail
GROWTH = 0.22  # metres of edge length per metre from the nearest detail
# Centre, radius and edge length of the balls that need finer triangles.
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
    """Return the edge length (N,) wanted at each point."""
    length = np.full(len(points), LARGEST)
    for centre, radius, fine in DETAILS:
        away = np.linalg.norm(points - np.asarray(centre), axis=1) - radius
        length = np.minimum(length, fine + GROWTH * np.maximum(away, 0))
    return length


def project(points: Floats) -> Floats:
    """Move points to the zero level of the distance, a few damped Newton steps."""
    for _ in range(3):
        step = np.clip(distance(points), -0.003, 0.003)
        points = points - step[:, None] * gradient(points)
    return points


def mirror(vertices: Floats, triangles: np.ndarray) -> tuple[Floats, np.ndarray, np.ndarray]:
    """Close a half mesh; also return the half's vertex that each vertex copies."""
    on_rim = vertices[:, 0] == 0
    others = np.nonzero(~on_rim)[0]
    image = np.arange(len(vertices))
    image[others] = len(vertices) + np.arange(len(others))
    both = np.concatenate([vertices, vertices[others] * [-1, 1, 1]])
    source = np.concatenate([np.arange(len(vertices)), others])
    return both, np.concatenate([triangles, image[triangles][:, ::-1]]), source


def model_half() -> tuple[Floats, np.ndarray]:
    """Return vertices and triangles of the left half, its rim exactly on x = 0."""
    vertices, triangles = polygonise()
    vertices, triangles = drop_unused(vertices, triangles)
    return remesh(vertices, triangles, wanted_length, project)


def normals(vertices: Floats, triangles: np.ndarray) -> Floats:
    """Return unit normals (V, 3): area-weighted face normals, exact mirror images."""
    total = np.zeros_like(vertices)
    faces = face_normals(vertices, triangles)
    for corner in range(3):
        np.add.at(total, triangles[:, corner], faces)
    return total / np.linalg.norm(total, axis=1, keepdims=True)
