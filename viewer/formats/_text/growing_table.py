"""Tables that grow while a file is read."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

_GROWTH = 1.1  # growth factor of the capacity; new rows take memory even before they are used


class GrowingTable:
    """A table to which rows are added, in little more memory than they take; it widens its type."""

    def __init__(self, shape: tuple[int, ...] = (), kind: DTypeLike = np.int64) -> None:
        self._rows: NDArray[Any] = np.empty((0, *shape), kind)
        self._count = 0

    def add(self, rows: NDArray[Any]) -> None:
        """Append rows: (N, *shape)."""
        kind = np.result_type(self._rows, rows)
        if kind != self._rows.dtype:
            self._rows = self._rows.astype(kind)
        last = self._count + len(rows)
        if last > len(self._rows):
            self._resize(max(last, int(_GROWTH * len(self._rows))))
        self._rows[self._count : last] = rows
        self._count = last

    def rows(self) -> NDArray[Any]:
        """Return all rows; none can be added afterwards."""
        self._resize(self._count)
        return self._rows

    def _resize(self, count: int) -> None:
        # No other array uses this memory before the table is complete.
        self._rows.resize((count, *self._rows.shape[1:]), refcheck=False)
