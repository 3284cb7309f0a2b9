"""Conversion of skin weights to sparse matrices, vertices by joints, and back."""

from __future__ import annotations

from typing import Any

import numpy as np

from viewer.errors import RigError
from viewer.rig._scipy import scipy_part
from viewer.rig.arrays import Floats, Ints
from viewer.rig.skin import Skin, limit_influences

__all__ = ["put_rows", "scaled_rows", "skin_of", "weight_matrix"]

_NO_SUM = 1e-12  # minimum sum of weights that can be normalised


def weight_matrix(skin: Skin, triangles: Ints) -> Any:
    """Return a skin's weights as a sparse (V, J) matrix whose rows sum to 1.

    Parameters
    ----------
    skin : Skin
        Stored weights need not sum to 1; repeated weights for a joint are added, negative ones set
        to 0.
    triangles : (T, 3)
        Triangles of the same mesh. Vertices without triangles may have no weights.

    Raises
    ------
    RigError
        If the skin has fewer vertices than the triangles refer to, or the weights of a triangle
        corner sum to 0.
    """
    if triangles.max(initial=-1) >= skin.n_vertices:
        raise RigError(
            f"template: expected weights for {int(triangles.max()) + 1} vertices, "
            f"found {skin.n_vertices}"
        )
    matrix = _matrix(skin)
    sums = np.asarray(matrix.sum(axis=1)).ravel()
    empty = np.unique(triangles[sums[triangles] <= _NO_SUM])
    if len(empty):
        raise RigError(
            f"template: expected weights for every vertex, found none for {len(empty)} "
            f"of {len(sums)}, the first is vertex {empty[0]}"
        )
    return scaled_rows(matrix, np.divide(1.0, sums, out=np.zeros_like(sums), where=sums > _NO_SUM))


def skin_of(rows: Any, inverse_bind: Floats, max_influences: int | None = None) -> Skin:
    """Return a sparse (V, J) matrix of weights as a skin.

    Parameters
    ----------
    rows : sparse (V, J) in rows
        Rows that sum to 1.
    inverse_bind : (J, 4, 4)
        Bind-space-to-joint matrices.
    max_influences : int, optional
        Number of strongest influences kept per vertex, rescaled to a sum of 1; all if omitted.
    """
    rows.sort_indices()
    skin = Skin(rows.indptr, rows.indices, rows.data, inverse_bind)
    return skin if max_influences is None else limit_influences(skin, max_influences)


def scaled_rows(matrix: Any, factors: Floats) -> Any:
    """Return a sparse (V, J) matrix with its rows multiplied by (V,); 0 leaves an empty row."""
    sparse = scipy_part("sparse")
    scaled = sparse.csr_array(sparse.diags_array(factors) @ matrix)
    scaled.eliminate_zeros()
    return scaled


def put_rows(rows: Any, where: Any, values: Any) -> Any:
    """Return sparse rows; the rows at the unique indices ``where`` are replaced by ``values``."""
    sparse = scipy_part("sparse")
    kept = np.ones(rows.shape[0])
    kept[where] = 0.0
    every = np.arange(len(where))
    lift = sparse.csr_array(
        (np.ones(len(where)), (where, every)), shape=(rows.shape[0], len(where))
    )
    return sparse.csr_array(scaled_rows(rows, kept) + lift @ values)


def _matrix(skin: Skin) -> Any:
    sparse = scipy_part("sparse")
    shape = (skin.n_vertices, skin.n_joints)
    matrix = sparse.csr_array((skin.weights, skin.joints, skin.starts), shape=shape, copy=True)
    matrix.sum_duplicates()
    matrix.data = np.maximum(matrix.data, 0.0)
    matrix.eliminate_zeros()
    return matrix
