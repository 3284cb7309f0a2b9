"""Places of the vertices' influence counts in a ``skinweights`` section."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.rig.arrays import Floats

__all__ = ["find_heads"]

_LEAP = 16  # vertices that one step of the Python loop passes over
_SMALL = 1 << 29  # numbers for which three times their count is an int32


def find_heads(values: Floats, count: int) -> NDArray[np.integer] | None:
    """Return the places of the vertices' counts, (V,), or None if they do not fill the block.

    Each count determines the place of the next, so they must be followed one by one. Squaring
    the map "place to next place" four times makes each step of that loop pass 16 vertices.
    """
    size = len(values)
    if count == 0:
        return None if size else np.zeros(0, np.int32)
    # Two places behind the last: the end of the block, and beyond it; they lead to the latter.
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
