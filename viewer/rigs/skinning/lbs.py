"""Linear blend skinning, in float64: v' = sum_i w_i M_i [v 1].

Many vertices are blended by dense blocks of weights: a few hundred vertices times the joints that
influence any of them. Vertices that are close to each other in a file usually have the same joints,
so the blocks stay small, and one product of two dense matrices per block is several times faster
than summing a flat list in numpy.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.vectors import inverse_transposed, unit
from viewer.rigs.kinematics import are_alike, rigid_sizes
from viewer.rigs.memo import Memo
from viewer.rigs.skin import Skin, has_influence

# Number of matrices per chunk, which fits into the processor's cache and limits the memory.
_CHUNK = 1 << 14

# Vertices per block: smaller blocks need more calls, larger ones contain more zeros (bench_deform).
_VERTICES = 512

# Weights cached per skin (128 MB); only files with a random vertex order need more.
_MOST = 1 << 24
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
    """
    moved, rotated = move(positions, skin, palette, normals)
    assert rotated is not None  # normals were given
    return moved, unit(rotated)


def move(
    positions: Floats, skin: Skin, palette: Floats, normals: Floats | None = None
) -> tuple[Floats, Floats | None]:
    """Transform positions (V, 3), and normals if given, by blended matrices; not normalised.

    Frames of a clip are best transformed one by one: their matrices stay in the processor's cache,
    which is twice as fast as one large product (``tests/bench/bench_deform.py``).
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
    """Return the affine part (V, 3, 4) of sum_i w_i M_i, the identity without influence."""
    result = np.empty((skin.n_vertices, 3, 4))
    for rows, matrices in _blended(skin, palette):
        result[rows] = matrices.transpose(2, 0, 1)
    return result


def _blended(skin: Skin, palette: Floats) -> Iterator[tuple[slice, Floats]]:
    """Yield runs of consecutive vertices and their blended matrices, (3, 4, n)."""
    # One row per joint, so that selecting a block's joints copies contiguous memory.
    rows = palette[:, :3, :].reshape(len(palette), 12)
    run: list[_Block] = []
    for block in blocks_of(skin):
        if run and block.rows.stop - run[0].rows.start > _CHUNK:
            yield _run(run, rows)
            run = []
        run.append(block)
    if run:
        yield _run(run, rows)


def _run(run: list[_Block], rows: Floats) -> tuple[slice, Floats]:
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


@dataclass(frozen=True, slots=True)
class _Block:
    """The weights of consecutive vertices."""

    rows: slice
    """Indices of the vertices."""
    joints: Ints
    """(B,) int32. Joints that influence any of these vertices."""
    weights: Floats
    """(B, n). Weight of each joint for each vertex; 0 without influence."""
    free: Ints
    """(F,) int32. Rows within the block without influence, whose matrix is the identity."""


_kept: Memo[Skin, tuple[_Block, ...] | None] = Memo()


def blocks_of(skin: Skin) -> Iterator[_Block]:
    """Yield a skin's blocks, cached for the skin's lifetime unless they are unusually large."""
    kept = _kept.get(skin, None, lambda: _within_limit(skin))
    yield from _blocks(skin) if kept is None else kept


def _within_limit(skin: Skin) -> tuple[_Block, ...] | None:
    """Return all blocks of a skin, or None if they are too large to be cached."""
    blocks, size = [], 0
    for block in _blocks(skin):
        size += block.weights.size
        if size > _MOST:
            return None
        blocks.append(block)
    return tuple(blocks)


def _blocks(skin: Skin) -> Iterator[_Block]:
    """Compute the blocks of a skin one by one."""
    is_free = ~has_influence(skin)
    for first in range(0, skin.n_vertices, _VERTICES):
        last = min(first + _VERTICES, skin.n_vertices)
        span = slice(skin.starts[first], skin.starts[last])
        joints, columns = np.unique(skin.joints[span], return_inverse=True)
        owners = np.repeat(np.arange(last - first), np.diff(skin.starts[first : last + 1]))
        weights = np.zeros((len(joints), last - first))
        # A vertex may list a joint twice: the weights are summed.
        np.add.at(weights, (columns, owners), skin.weights[span])
        free = np.flatnonzero(is_free[first:last]).astype(np.int32)
        yield _Block(slice(first, last), joints, weights, free)


def rigid_vertices(skin: Skin, palette: Floats) -> Bools:
    """Return which vertices (V,) have only joints that rotate, up to one common scale.

    Their normals follow the blended matrix, others the inverse transpose.
    """
    sizes = rigid_sizes(palette)
    rigid = np.ones(skin.n_vertices, dtype=np.bool_)
    if len(sizes) == 0 or are_alike(sizes.min(), sizes.max()):
        return rigid
    moving = np.flatnonzero(np.diff(skin.starts) > 0)
    if len(moving):
        own, is_used = sizes[skin.joints], skin.weights != 0.0
        edges = skin.starts[moving]
        lowest = np.minimum.reduceat(np.where(is_used, own, np.inf), edges)
        highest = np.maximum.reduceat(np.where(is_used, own, -np.inf), edges)
        with np.errstate(invalid="ignore"):
            rigid[moving] = are_alike(lowest, highest) | (lowest > highest)
    return rigid
