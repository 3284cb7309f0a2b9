"""Linear blend skinning, in float64: v' = sum_i w_i M_i [v 1]."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.mesh import Mesh
from viewer.rig.skin import Skin

__all__ = ["blended_matrices", "deform", "unit"]

_CHUNK = 1 << 16  # vertices at a time, which bounds the memory that large meshes take


def deform(mesh: Mesh, skin: Skin, palette: Floats) -> tuple[Floats, Floats]:
    """Blend matrices, then move: v' = (sum_i w_i M_i) [v 1], n' = unit((sum_i w_i M_i) [n 0]).

    Normals use the blended matrix itself, not its inverse transpose: CSE169 course notes.

    Parameters
    ----------
    mesh : Mesh
        V vertices in binding space.
    skin : Skin
        Weights as stored; a vertex without any stays at its bind position.
    palette : (J, 4, 4)
        Skinning matrices, bind to posed.

    Returns
    -------
    positions : (V, 3)
        Figure units.
    normals : (V, 3)
        Unit length.
    """
    positions, normals = np.empty_like(mesh.positions), np.empty_like(mesh.normals)
    for first in range(0, skin.n_vertices, _CHUNK):
        rows = slice(first, first + _CHUNK)
        blended = blended_matrices(skin, palette, rows)
        linear = blended[:, :, :3]
        positions[rows] = np.einsum("vab,vb->va", linear, mesh.positions[rows]) + blended[:, :, 3]
        normals[rows] = np.einsum("vab,vb->va", linear, mesh.normals[rows])
    return positions, unit(normals)


def blended_matrices(skin: Skin, palette: Floats, rows: slice = slice(None)) -> Floats:
    """Sum each vertex's joint matrices by weight: sum_i w_i M_i, identity without influence.

    Parameters
    ----------
    skin : Skin
        V vertices.
    palette : (J, 4, 4)
        Skinning matrices.
    rows : slice
        The vertices wanted; all if omitted.

    Returns
    -------
    (V, 3, 4)
        The affine part of the blended matrices of those vertices.
    """
    first, last, _ = rows.indices(skin.n_vertices)
    starts = skin.starts[first : last + 1]
    span = slice(starts[0], starts[-1])
    blended = np.tile(np.eye(3, 4), (last - first, 1, 1))
    weights = skin.weights[span]
    listing = np.flatnonzero(np.diff(starts) > 0)
    if len(listing):
        # Vertices that list nothing own no terms, so the others' starts delimit all terms.
        edges = starts[listing] - starts[0]
        terms = palette[skin.joints[span], :3, :] * weights[:, None, None]
        moved = np.logical_or.reduceat(weights != 0.0, edges)
        blended[listing[moved]] = np.add.reduceat(terms, edges, axis=0)[moved]
    return blended


def unit(vectors: Floats) -> Floats:
    """Return vectors of length 1; a vector of length 0 stays 0.

    Parameters
    ----------
    vectors : (..., 3)
        Any lengths.

    Returns
    -------
    (..., 3)
        Unit vectors.
    """
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(lengths == 0.0, 1.0, lengths)
