"""Offsets of blend shapes and pose correctives that are read on first use.

Some are mostly zero and stored without the zeros; of others only weighted sums are needed, which
the file computes without being read as a whole.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from viewer.rigs.arrays import Deferred, Floats, Ints

_DENSE = 0.25  # fraction of nonzero entries above which the whole array is stored
_FIRST = 64  # rows after which this fraction is estimated


class SparseOffsets(Deferred):
    """Offsets (P, V, 3) that are read block by block on first use, and stored without zeros."""

    __slots__ = ("_blocks", "_entries", "_lock")

    def __init__(
        self,
        shape: tuple[int, ...],
        dtype: DTypeLike,
        load: Callable[[], NDArray[Any]],
        blocks: Callable[[], Iterator[NDArray[Any]]],
    ) -> None:
        super().__init__(shape, dtype, load)
        self._blocks, self._lock = blocks, Lock()
        self._entries: _Entries | None = None

    def total(self, weights: Floats) -> Floats | None:
        """Return sum_p w_p d_p, (V, 3), for weights (P,); None if the offsets are not sparse."""
        entries = self._read_once()
        return None if entries is None else entries.total(weights)

    def of_vertices(self, vertices: Ints) -> Floats:
        """Return the offsets of some vertices: (P, N, 3)."""
        entries = self._read_once()
        if entries is None:
            return self.values()[:, vertices].astype(np.float64)
        columns = 3 * vertices.astype(np.intp)[:, None] + np.arange(3)
        return entries.columns(columns.reshape(-1), self.shape[0]).reshape(-1, len(vertices), 3)

    def _read_once(self) -> _Entries | None:
        with self._lock:
            if self._entries is None and not self.is_loaded:
                self._entries = self._read()
                if self._entries is None:
                    self.values()
            return self._entries

    def _read(self) -> _Entries | None:
        """Read the nonzero entries; None if there are too many."""
        width, count = 3 * self.shape[1], 0
        rows: list[Ints] = []
        columns: list[Ints] = []
        values: list[NDArray[Any]] = []
        for block in self._blocks():
            flat = block.reshape(-1)
            places = np.flatnonzero(flat != 0.0)  # much faster than for floats
            own = places // width
            rows.append((own + count).astype(np.int32))
            columns.append((places - own * width).astype(np.int32))
            values.append(flat[places])
            count += len(block)
            if count <= _FIRST + len(block) and sum(map(len, values)) > _DENSE * count * width:
                return None
        if not values:
            values.append(np.zeros(0, self.dtype))
            rows, columns = [np.zeros(0, np.int32)], [np.zeros(0, np.int32)]
        return _Entries(width, *(np.concatenate(part) for part in (rows, columns, values)))


class _Entries:
    """Nonzero entries of a matrix (P, W), in the order of their columns."""

    def __init__(self, width: int, rows: Ints, columns: Ints, values: NDArray[Any]) -> None:
        narrow = columns.astype(np.uint16) if width <= 1 << 16 else columns
        order = np.argsort(narrow, kind="stable")  # a radix sort for 16 bits
        self._width, self._rows, self._values = width, rows[order], values[order]
        counts = np.bincount(columns, minlength=width)
        self._columns = np.flatnonzero(counts)
        self._starts = np.cumsum(counts)[self._columns] - counts[self._columns]

    def columns(self, columns: Ints, count: int) -> Floats:
        """Return some columns of the matrix: (P, N), for its number of rows P."""
        result = np.zeros((count, len(columns)))
        ends = np.append(self._starts, len(self._values))
        for number, column in enumerate(columns.tolist()):
            place = int(np.searchsorted(self._columns, column))
            if place < len(self._columns) and self._columns[place] == column:
                own = slice(ends[place], ends[place + 1])
                result[self._rows[own], number] = self._values[own]
        return result

    def total(self, weights: Floats) -> Floats:
        """Return weights @ matrix as (W / 3, 3)."""
        result = np.zeros(self._width)
        if len(self._columns):
            products = weights[self._rows] * self._values
            result[self._columns] = np.add.reduceat(products, self._starts)
        return result.reshape(-1, 3)


class DeferredOffsets(Deferred):
    """Offsets of blend shapes whose weighted sum does not need the whole array."""

    __slots__ = ("total",)

    def __init__(
        self,
        shape: tuple[int, int, int],
        load: Callable[[], Floats],
        total: Callable[[Floats], Floats],
    ) -> None:
        super().__init__(shape, np.float64, load)
        self.total = total
