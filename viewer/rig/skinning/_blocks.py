"""Weights as dense blocks: a few hundred vertices times the joints that influence any of them.

Vertices that are close to each other in a file usually have the same joints, so the blocks stay
small, and one product of two dense matrices per block is several times faster than summing a flat
list in numpy.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats, Ints
from viewer.rig.memo import Memo
from viewer.rig.skin import Skin, has_influence

# Vertices per block: smaller blocks need more calls, larger ones contain more zeros (bench_deform).
_VERTICES = 512
# Weights cached per skin (128 MB); only files with a random vertex order need more.
_MOST = 1 << 24


@dataclass(frozen=True, slots=True)
class Block:
    """The weights of consecutive vertices.

    Attributes
    ----------
    rows : slice
        Indices of the vertices.
    joints : (B,) int32
        Joints that influence any of these vertices.
    weights : (B, n)
        Weight of each joint for each vertex; 0 without influence.
    free : (F,) int32
        Rows within the block without influence, whose matrix is the identity.
    """

    rows: slice
    joints: Ints
    weights: Floats
    free: Ints


_kept: Memo[Skin, tuple[Block, ...] | None] = Memo()


def blocks_of(skin: Skin) -> Iterator[Block]:
    """Yield a skin's blocks, cached for the skin's lifetime unless they are unusually large."""
    kept = _kept.get(skin, None, lambda: _within_limit(skin))
    yield from _blocks(skin) if kept is None else kept


def _within_limit(skin: Skin) -> tuple[Block, ...] | None:
    """Return all blocks of a skin, or None if they are too large to be cached."""
    blocks, size = [], 0
    for block in _blocks(skin):
        size += block.weights.size
        if size > _MOST:
            return None
        blocks.append(block)
    return tuple(blocks)


def _blocks(skin: Skin) -> Iterator[Block]:
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
        yield Block(slice(first, last), joints, weights, free)
