"""Offsets of blend shapes and pose correctives that are read on first use.

Some are mostly zero and stored without the zeros; of others only weighted sums are needed, which
the file computes without being read as a whole.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from viewer.rigs.arrays import Deferred, Floats, Ints

if TYPE_CHECKING:
    from scipy.sparse import csc_array

_DENSE = 0.25  # fraction of nonzero entries above which the whole array is stored
_FIRST = 64  # rows after which this fraction is estimated


class SparseOffsets(Deferred):
    """Offsets (P, V, 3) that are read block by block on first use, and stored without zeros."""

    __slots__ = ("_blocks", "_entries", "_lock")

    is_sparse = True

    def __init__(
        self,
        shape: tuple[int, ...],
        dtype: DTypeLike,
        load: Callable[[], NDArray[Any]],
        blocks: Callable[[], Iterator[NDArray[Any]]],
    ) -> None:
        super().__init__(shape, dtype, load)
        self._blocks, self._lock = blocks, Lock()
        self._entries: csc_array | None = None

    def total(self, weights: Floats) -> Floats | None:
        """Return sum_p w_p d_p, (V, 3), for weights (P,); None if there are too few zeros."""
        entries = self._read_once()
        return None if entries is None else np.reshape(entries.T @ weights, (-1, 3))

    def check(self) -> None:
        """Read the offsets; raises ``FormatError`` if they are damaged."""
        self._read_once()

    def columns(self, indices: Ints) -> Floats:
        """Return the offsets of some vertices: (P, N, 3)."""
        entries = self._read_once()
        if entries is None:
            return super().columns(indices)
        columns = 3 * indices.astype(np.intp)[:, None] + np.arange(3)
        return np.reshape(entries[:, columns.reshape(-1)].toarray(), (-1, len(indices), 3))

    def _read_once(self) -> csc_array | None:
        with self._lock:
            if self._entries is None and not self.is_loaded:
                self._entries = self._read()
                if self._entries is None:
                    self.values()
            return self._entries

    def _read(self) -> csc_array | None:
        """Read the nonzero entries as a matrix (P, 3 V); None if there are too many."""
        from scipy import sparse  # loads for 0.2 s, and few body models need it

        width, count = 3 * self.shape[1], 0
        starts = [np.zeros(1, np.intp)]
        columns = [np.zeros(0, np.int32)]
        values = [np.zeros(0)]
        for block in self._blocks():
            flat = block.reshape(-1)
            places = np.flatnonzero(flat != 0.0)  # much faster than for floats
            rows = places // width
            starts.append(starts[-1][-1] + np.cumsum(np.bincount(rows, minlength=len(block))))
            columns.append((places - rows * width).astype(np.int32))
            values.append(flat[places].astype(np.float64))
            count += len(block)
            if count <= _FIRST + len(block) and starts[-1][-1] > _DENSE * count * width:
                return None
        entries = (np.concatenate(part) for part in (values, columns, starts))
        return sparse.csr_array(tuple(entries), shape=(count, width)).tocsc()


class DeferredOffsets(Deferred):
    """Offsets of blend shapes whose weighted sum does not need the whole array."""

    __slots__ = ("_total",)

    def __init__(
        self,
        shape: tuple[int, int, int],
        load: Callable[[], Floats],
        total: Callable[[Floats], Floats],
    ) -> None:
        super().__init__(shape, np.float64, load)
        self._total = total

    def total(self, weights: Floats) -> Floats:
        """Return sum_s w_s d_s, (V, 3), for weights (S,)."""
        return self._total(weights)
