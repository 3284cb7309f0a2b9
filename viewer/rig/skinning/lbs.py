"""Linear blend skinning, in float64: v' = sum_i w_i M_i [v 1]."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.mesh import Mesh
from viewer.rig.skin import Skin, has_influence

__all__ = ["blended_matrices", "deform", "unit"]


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
    blended = blended_matrices(skin, palette)
    positions = np.einsum("vab,vb->va", blended[:, :, :3], mesh.positions) + blended[:, :, 3]
    normals = np.einsum("vab,vb->va", blended[:, :, :3], mesh.normals)
    return positions, unit(normals)


def blended_matrices(skin: Skin, palette: Floats) -> Floats:
    """Sum each vertex's joint matrices by weight: sum_i w_i M_i, identity without influence.

    Parameters
    ----------
    skin : Skin
        V vertices.
    palette : (J, 4, 4)
        Skinning matrices.

    Returns
    -------
    (V, 3, 4)
        The affine part of the blended matrices.
    """
    blended = np.zeros((skin.n_vertices, 3, 4))
    filled = np.diff(skin.starts) > 0
    if filled.any():
        terms = palette[skin.joints, :3, :] * skin.weights[:, None, None]
        # Vertices that list nothing own no terms, so the filled ones' starts delimit all terms.
        blended[filled] = np.add.reduceat(terms, skin.starts[:-1][filled], axis=0)
    blended[~has_influence(skin)] = np.eye(3, 4)
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
