"""Weights as dense blocks: a few hundred vertices times the joints that any of them lists.

Neighbours in a file share their joints, so the blocks stay small, and one product of two dense
matrices per block is several times faster than summing a flat list in numpy.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from viewer.rig.arrays import Floats, Ints
from viewer.rig.memo import Memo
from viewer.rig.skin import Skin, has_influence

_VERTICES = 512  # in a block: fewer cost calls, more cost zeros (bench_deform)
_MOST = 1 << 24  # weights kept, 128 MB: a file without any order would take more


@dataclass(frozen=True, slots=True)
class Block:
    """Consecutive vertices.

    Attributes
    ----------
    rows : slice
        Their indices.
    joints : (B,) int32
        All that any of them lists.
    weights : (B, n)
        Of each joint, by vertex; 0 where a vertex does not list it.
    free : (F,) int32
        Rows within the block that nothing moves: their matrix is the identity.
    """

    rows: slice
    joints: Ints
    weights: Floats
    free: Ints


_kept: Memo[Skin, tuple[Block, ...] | None] = Memo()


def blocks_of(skin: Skin) -> Iterator[Block]:
    """Yield a skin's blocks; kept as long as the skin unless they are unusually large."""
    kept = _kept.get(skin, None, lambda: _within_limit(skin))
    yield from _blocks(skin) if kept is None else kept


def _within_limit(skin: Skin) -> tuple[Block, ...] | None:
    blocks, size = [], 0
    for block in _blocks(skin):
        size += block.weights.size
        if size > _MOST:
            return None
        blocks.append(block)
    return tuple(blocks)


def _blocks(skin: Skin) -> Iterator[Block]:
    is_free = ~has_influence(skin)
    for first in range(0, skin.n_vertices, _VERTICES):
        last = min(first + _VERTICES, skin.n_vertices)
        span = slice(skin.starts[first], skin.starts[last])
        joints, columns = np.unique(skin.joints[span], return_inverse=True)
        owners = np.repeat(np.arange(last - first), np.diff(skin.starts[first : last + 1]))
        weights = np.zeros((len(joints), last - first))
        # A joint may be listed twice by one vertex: the weights add up.
        np.add.at(weights, (columns, owners), skin.weights[span])
        free = np.flatnonzero(is_free[first:last]).astype(np.int32)
        yield Block(slice(first, last), joints, weights, free)
