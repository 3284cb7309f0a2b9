"""Positions of the vertices' influence counts in a ``skinweights`` section."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.rig.arrays import Floats

__all__ = ["find_heads"]

_LEAP = 16  # number of vertices that each step of the Python loop skips
_SMALL = 1 << 29  # maximum count of numbers for which three times the count fits into an int32


def find_heads(values: Floats, count: int) -> NDArray[np.integer] | None:
    """Return the positions of the vertices' counts, (V,); None if they do not fill the block.

    Each count determines the position of the next, so they form a linked list. Composing the map
    from each position to the next with itself four times lets each step of the loop skip 16
    vertices.
    """
    size = len(values)
    if count == 0:
        return None if size else np.zeros(0, np.int32)
    # There are two extra positions, the end of the block and one beyond it; both map to the second.
    kind: type[np.int32] | type[np.int64] = np.int32 if size < _SMALL else np.int64
    after = np.full(size + 2, size + 1, dtype=kind)
    counts: NDArray[Any] = np.clip(values, 0, size).astype(kind)
    is_count = counts == values
    counts *= 2
    counts += np.arange(1, size + 1, dtype=kind)
    is_count &= counts <= size
    np.copyto(after[:size], counts, where=is_count)
    leap = after
    for _ in range(_LEAP.bit_length() - 1):
        leap = leap[leap]
    anchors = [0]
    for _ in range((count - 1) // _LEAP):
        anchors.append(int(leap[anchors[-1]]))
    columns = [np.array(anchors, dtype=kind)]
    for _ in range(_LEAP - 1):
        columns.append(after[columns[-1]])
    heads = np.stack(columns, axis=1).ravel()[:count]
    fills = heads[-1] < size and after[heads[-1]] == size
    return heads if fills else None
