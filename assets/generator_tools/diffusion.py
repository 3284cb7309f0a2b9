"""Heat diffusion over a triangle mesh, and the distances from which it starts."""

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags

from .shapes import Floats


def segment_distances(points: Floats, starts: Floats, ends: Floats) -> Floats:
    """Return the distance (V, J) from each point to each segment."""
    along = ends - starts
    offset = points[:, None] - starts
    t = np.einsum("vjk,jk->vj", offset, along) / np.einsum("jk,jk->j", along, along)
    offset -= np.clip(t, 0, 1)[..., None] * along
    return np.linalg.norm(offset, axis=2)


def cotangent_stiffness(vertices: Floats, triangles: np.ndarray) -> tuple[csr_matrix, Floats]:
    """Return the cotangent Laplacian (V, V), positive semidefinite, and the areas (V,)."""
    n = len(vertices)
    rows, columns, values = [], [], []
    for corner in range(3):
        i, j, k = (triangles[:, (corner + s) % 3] for s in range(3))
        u, v = vertices[i] - vertices[k], vertices[j] - vertices[k]
        double_area = np.linalg.norm(np.cross(u, v), axis=1)
        cotangent = np.maximum(np.einsum("ti,ti->t", u, v) / double_area, 0.02)
        rows += [i, j]
        columns += [j, i]
        values += [0.5 * cotangent] * 2
    links = coo_matrix(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(n, n)
    ).tocsr()
    stiffness = diags(np.asarray(links.sum(axis=1)).ravel()) - links
    areas = np.bincount(triangles.ravel(), np.repeat(double_area / 6, 3), minlength=n)
    return stiffness.tocsr(), areas


def averaging(triangles: np.ndarray, n: int) -> csr_matrix:
    """Return the matrix (n, n) that averages each value with the mean of its neighbours."""
    i = np.concatenate([triangles, np.roll(triangles, -1, axis=1)], axis=1).ravel()
    j = np.concatenate([np.roll(triangles, -1, axis=1), triangles], axis=1).ravel()
    links = coo_matrix((np.ones(len(i)), (i, j)), shape=(n, n)).tocsr()
    links.data[:] = 1
    valence = np.asarray(links.sum(axis=1)).ravel()
    return (0.5 * (diags(1 / valence) @ links + diags(np.ones(n)))).tocsr()
