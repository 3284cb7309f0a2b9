"""Posing of a body in SMPL's layout, without its blend shapes."""

import numpy as np
from generator_tools.shapes import Floats

from .joints import PARENTS


def rotation(vectors: Floats) -> Floats:
    """Convert axis-angle vectors (..., 3) to matrices (..., 3, 3)."""
    vectors = np.asarray(vectors, dtype=float)
    square = np.sum(vectors**2, axis=-1)[..., None, None]
    angle = np.sqrt(np.maximum(square, 1e-30))
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1)
    cross = cross.reshape(*vectors.shape[:-1], 3, 3)
    first = np.sin(angle) / angle
    second = 2 * (np.sin(angle / 2) / angle) ** 2
    return np.eye(3) + first * cross + second * (cross @ cross)


def world(matrices: Floats, centres: Floats) -> Floats:
    """Return the joints' transforms (J, 4, 4) that map the rest figure to the pose."""
    frames = np.empty((len(PARENTS), 4, 4))
    for j, parent in enumerate(PARENTS):
        local = np.eye(4)
        local[:3, :3] = matrices[j]
        local[:3, 3] = centres[j] if parent < 0 else centres[j] - centres[parent]
        frames[j] = local if parent < 0 else frames[parent] @ local
    moved = frames.copy()
    moved[:, :3, 3] -= np.einsum("jab,jb->ja", frames[:, :3, :3], centres)
    return moved


def skin(vertices: Floats, weights: Floats, transforms: Floats) -> tuple[Floats, Floats]:
    """Return the linear blend skinned vertices (V, 3) and their matrices (V, 4, 4)."""
    blended = np.einsum("vj,jab->vab", weights, transforms)
    moved = np.einsum("vab,vb->va", blended[:, :3, :3], vertices) + blended[:, :3, 3]
    return moved, blended
