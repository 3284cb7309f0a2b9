"""Rotations written out without code of the viewer, and figures that many folders use."""

import math
from pathlib import Path

import numpy as np
from formats.synthetic_smpl import model

import viewer
from viewer.rigs.figure import Figure


def rotation(vector) -> np.ndarray:
    """Return the matrix of a rotation vector, I + sin K + (1 - cos) K^2 (Rodrigues' formula)."""
    angle = math.sqrt(sum(n * n for n in vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = np.asarray(vector) / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross


def axis_turn(axis: int, angle: float) -> np.ndarray:
    """Return the rotation by an angle in radians about a coordinate axis."""
    c, s = math.cos(angle), math.sin(angle)
    turns = [
        [[1, 0, 0], [0, c, -s], [0, s, c]],
        [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    ]
    return np.array(turns[axis], dtype=float)


def quaternions(vectors) -> np.ndarray:
    """Return the quaternions (..., 4) of rotation vectors (..., 3) as (x, y, z, w)."""
    angles = np.linalg.norm(vectors, axis=-1, keepdims=True)
    axes = vectors / np.where(angles > 0, angles, 1.0)
    return np.concatenate([axes * np.sin(angles / 2), np.cos(angles / 2)], axis=-1)


def quaternion_matrix(quaternion) -> np.ndarray:
    """Return the matrix of a unit quaternion (x, y, z, w)."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def family_figure(kind: str, folder: Path, n_vertices: int = 96, **changes) -> Figure:
    """Return the figure of ``synthetic_smpl.model``; an array set to None is left out."""
    arrays = {**model(kind, n_vertices), **changes}
    path = folder / f"{kind}.npz"
    np.savez(path, **{key: value for key, value in arrays.items() if value is not None})
    return viewer.load(path).actors[0].figure
