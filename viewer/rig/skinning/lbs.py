"""Linear blend skinning, in float64: v' = sum_i w_i M_i [v 1]."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.skin import Skin
from viewer.rig.skinning._blocks import Block, blocks_of
from viewer.rig.vectors import unit

__all__ = ["blended_matrices", "deform", "move"]

_CHUNK = 1 << 14  # matrices at a time: they stay in the cache, and bound the memory
_IDENTITY = np.eye(3, 4).reshape(12)


def deform(
    positions: Floats, normals: Floats, skin: Skin, palette: Floats, share: float = 1.0
) -> tuple[Floats, Floats]:
    """Blend matrices, then move: v' = (sum_i w_i M_i) [v 1], n' = unit((sum_i w_i M_i) [n 0]).

    Normals use the blended matrix itself, not its inverse transpose: CSE169 course notes.

    Parameters
    ----------
    positions, normals : (V, 3)
        Binding space.
    skin : Skin
        Weights as stored; a vertex without any stays at its bind position.
    palette : (J, 4, 4)
        Skinning matrices, bind to posed.
    share : float
        Not used: there is nothing to mix with.

    Returns
    -------
    positions : (V, 3)
        Figure units.
    normals : (V, 3)
        Unit length.
    """
    moved, turned = move(positions, skin, palette[None], normals)
    assert turned is not None  # normals were given
    return moved[0], unit(turned[0])


def move(
    positions: Floats, skin: Skin, palettes: Floats, normals: Floats | None = None
) -> tuple[Floats, Floats | None]:
    """Skin one mesh by many palettes: one product a block for all frames.

    Parameters
    ----------
    positions : (V, 3)
        Binding space.
    skin : Skin
        Of V vertices.
    palettes : (F, J, 4, 4)
        Skinning matrices of each frame.
    normals : (V, 3), optional
        Turned as well if given; they double the work.

    Returns
    -------
    positions : (F, V, 3)
        Figure units.
    normals : (F, V, 3) or None
        Any length.
    """
    moved = np.empty((len(palettes), *positions.shape))
    turned = None if normals is None else np.empty_like(moved)
    for rows, matrices in _blended(skin, palettes):
        moved[:, rows] = _last(_product(matrices, positions[rows]) + matrices[:, :, 3])
        if normals is not None and turned is not None:
            turned[:, rows] = _last(_product(matrices, normals[rows]))
    return moved, turned


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
    for rows, matrices in _blended(skin, palette[None]):
        result[rows] = matrices[0].transpose(2, 0, 1)
    return result


def _blended(skin: Skin, palettes: Floats) -> Iterator[tuple[slice, Floats]]:
    """Yield the blended matrices, (F, 3, 4, n), of a run of vertices after the other."""
    frames, joints = palettes.shape[:2]
    # A joint's numbers lie together, so that choosing a block's joints copies whole rows.
    rows = palettes[:, :, :3, :].transpose(1, 0, 2, 3).reshape(joints, 12 * frames)
    most = max(_CHUNK // frames, 1)
    run: list[Block] = []
    for block in blocks_of(skin):
        if run and block.rows.stop - run[0].rows.start > most:
            yield _run(run, rows, frames)
            run = []
        run.append(block)
    if run:
        yield _run(run, rows, frames)


def _run(run: list[Block], rows: Floats, frames: int) -> tuple[slice, Floats]:
    first, last = run[0].rows.start, run[-1].rows.stop
    blended = np.empty((12 * frames, last - first))
    for block in run:
        part = blended[:, block.rows.start - first : block.rows.stop - first]
        np.matmul(rows[block.joints].T, block.weights, out=part)
        if len(block.free):
            part[:, block.free] = np.tile(_IDENTITY, frames)[:, None]
    return slice(first, last), blended.reshape(frames, 3, 4, last - first)


def _product(matrices: Floats, vectors: Floats) -> Floats:
    """Multiply (F, 3, 4, n) matrices with (n, 3) vectors: (F, 3, n)."""
    x, y, z = np.ascontiguousarray(vectors.T)
    product = matrices[:, :, 0] * x
    product += matrices[:, :, 1] * y
    product += matrices[:, :, 2] * z
    return product


def _last(columns: Floats) -> Floats:
    return columns.transpose(0, 2, 1)
