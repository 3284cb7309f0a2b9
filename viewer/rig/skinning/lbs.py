"""Linear blend skinning, in float64: v' = sum_i w_i M_i [v 1]."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.geometry.vectors import unit
from viewer.rig.skin import Skin
from viewer.rig.skinning._blocks import Block, blocks_of
from viewer.rig.skinning._normals import inverse_transposed, rigid_vertices

__all__ = ["blended_matrices", "deform", "move"]

# Number of matrices per chunk, which fits into the processor's cache and limits the memory.
_CHUNK = 1 << 14
_IDENTITY = np.eye(3, 4).reshape(12)


def deform(
    positions: Floats,
    normals: Floats,
    skin: Skin,
    palette: Floats,
    blend_factor: float | None = 1.0,
) -> tuple[Floats, Floats]:
    """Transform by blended matrices: v' = B [v 1], n' = unit(B [n 0]), with B = sum_i w_i M_i.

    If all joints of a vertex are rigid, its normal uses the blended matrix itself (CSE169 course
    notes). If one of them scales or shears, it uses the inverse transpose, n' = unit(B^-T n).

    Parameters
    ----------
    positions, normals : (V, 3)
        In the bind pose.
    skin : Skin
        Weights as stored; a vertex without influence stays at its bind position.
    palette : (J, 4, 4)
        Skinning matrices, bind to posed.
    blend_factor : float
        Unused; part of the signature of every method.

    Returns
    -------
    positions : (V, 3)
        Figure units.
    normals : (V, 3)
        Unit length.
    """
    moved, rotated = move(positions, skin, palette, normals)
    assert rotated is not None  # normals were given
    return moved, unit(rotated)


def move(
    positions: Floats, skin: Skin, palette: Floats, normals: Floats | None = None
) -> tuple[Floats, Floats | None]:
    """Transform positions, and normals if given, by blended matrices.

    Frames of a clip are best transformed one by one: their matrices stay in the processor's cache,
    which is twice as fast as one large product (``tests/bench/bench_deform.py``).

    Parameters
    ----------
    positions : (V, 3)
        In the bind pose.
    skin : Skin
        Influences of V vertices.
    palette : (J, 4, 4)
        Skinning matrices.
    normals : (V, 3), optional
        Normals, optional because they double the work.

    Returns
    -------
    positions : (V, 3)
        Figure units.
    normals : (V, 3) or None
        Not normalised.
    """
    moved = np.empty(positions.shape)
    rotated = None if normals is None else np.empty(positions.shape)
    others = np.zeros(0, dtype=np.intp)
    if normals is not None:
        others = np.flatnonzero(~rigid_vertices(skin, palette))
    for rows, matrices in _blended(skin, palette):
        moved[rows] = (_product(matrices, positions[rows]) + matrices[:, 3]).T
        if normals is not None and rotated is not None:
            rotated[rows] = _product(matrices, normals[rows]).T
            first, last = np.searchsorted(others, [rows.start, rows.stop])
            affine = others[first:last]
            if len(affine):
                linear = matrices[:, :3, affine - rows.start]
                rotated[affine] = inverse_transposed(linear, normals[affine])
    return moved, rotated


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
    result = np.empty((skin.n_vertices, 3, 4))
    for rows, matrices in _blended(skin, palette):
        result[rows] = matrices.transpose(2, 0, 1)
    return result


def _blended(skin: Skin, palette: Floats) -> Iterator[tuple[slice, Floats]]:
    """Yield runs of consecutive vertices and their blended matrices, (3, 4, n)."""
    # One row per joint, so that selecting a block's joints copies contiguous memory.
    rows = palette[:, :3, :].reshape(len(palette), 12)
    run: list[Block] = []
    for block in blocks_of(skin):
        if run and block.rows.stop - run[0].rows.start > _CHUNK:
            yield _run(run, rows)
            run = []
        run.append(block)
    if run:
        yield _run(run, rows)


def _run(run: list[Block], rows: Floats) -> tuple[slice, Floats]:
    """Blend the matrices of consecutive blocks: one dense product per block."""
    first, last = run[0].rows.start, run[-1].rows.stop
    blended = np.empty((12, last - first))
    for block in run:
        part = blended[:, block.rows.start - first : block.rows.stop - first]
        np.matmul(rows[block.joints].T, block.weights, out=part)
        if len(block.free):
            part[:, block.free] = _IDENTITY[:, None]
    return slice(first, last), blended.reshape(3, 4, last - first)


def _product(matrices: Floats, vectors: Floats) -> Floats:
    """Multiply (3, 4, n) matrices with (n, 3) vectors: (3, n)."""
    x, y, z = np.ascontiguousarray(vectors.T)
    product = matrices[:, 0] * x
    product += matrices[:, 1] * y
    product += matrices[:, 2] * z
    return product
