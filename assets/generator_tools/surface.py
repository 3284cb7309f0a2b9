"""Operations on a surface that is modelled as one half and mirrored."""

from collections.abc import Callable, Sequence

import numpy as np

from .remesh import face_normals
from .shapes import Floats

Detail = tuple[tuple[float, float, float], float, float]


def graded_length(
    points: Floats, largest: float, growth: float, details: Sequence[Detail]
) -> Floats:
    """Return the target edge length (N,) at each point.

    The length is ``largest``, or less near the balls of ``details`` (centre, radius, edge length
    inside), away from which the length grows by ``growth`` metres per metre.
    """
    length = np.full(len(points), largest)
    for centre, radius, fine in details:
        away = np.linalg.norm(points - np.asarray(centre), axis=1) - radius
        length = np.minimum(length, fine + growth * np.maximum(away, 0))
    return length


def project(points: Floats, distance: Callable, gradient: Callable) -> Floats:
    """Move points to the zero level of the distance by a few damped Newton steps."""
    for _ in range(3):
        step = np.clip(distance(points), -0.003, 0.003)
        points = points - step[:, None] * gradient(points)
    return points


def mirror(vertices: Floats, triangles: np.ndarray) -> tuple[Floats, np.ndarray, np.ndarray]:
    """Return the closed mesh of a half, and the vertex of the half that each vertex copies."""
    on_rim = vertices[:, 0] == 0
    others = np.nonzero(~on_rim)[0]
    image = np.arange(len(vertices))
    image[others] = len(vertices) + np.arange(len(others))
    both = np.concatenate([vertices, vertices[others] * [-1, 1, 1]])
    source = np.concatenate([np.arange(len(vertices)), others])
    return both, np.concatenate([triangles, image[triangles][:, ::-1]]), source


def normals(vertices: Floats, triangles: np.ndarray) -> Floats:
    """Return unit normals (V, 3): area-weighted face normals, exact mirror images."""
    total = np.zeros_like(vertices)
    faces = face_normals(vertices, triangles)
    for corner in range(3):
        np.add.at(total, triangles[:, corner], faces)
    return total / np.linalg.norm(total, axis=1, keepdims=True)
