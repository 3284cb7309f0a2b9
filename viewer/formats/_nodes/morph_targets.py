"""Morph targets of a primitive: only the vertices that each target moves are stored."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from viewer.rig.arrays import Floats

__all__ = ["MorphTargets"]


Moved: TypeAlias = tuple[NDArray[np.intp], Floats]


class MorphTargets:
    """Offsets of the positions or normals of V vertices for each of S morph targets.

    Parameters
    ----------
    n_vertices : int
        V.
    offsets : iterable of S (V, 3) or None
        As in the file, of any floating-point type, possibly parts of the file's bytes; None for a
        target that moves nothing. They are converted when they are first used.
    rows : (V,) int, optional
        Vertices of the offsets that are used; all if omitted.
    """

    __slots__ = ("_parts", "_rows", "n_vertices")

    def __init__(
        self,
        n_vertices: int,
        offsets: Iterable[NDArray[Any] | None],
        rows: NDArray[np.integer] | None = None,
    ) -> None:
        self.n_vertices, self._rows = n_vertices, rows
        self._parts: list[NDArray[Any] | Moved | None] = [*offsets]

    def __len__(self) -> int:
        return len(self._parts)

    def moved(self, target: int) -> Moved:
        """Return the vertices that a target moves, and their offsets: (M,), (M, 3)."""
        part = self._parts[target]
        if not isinstance(part, tuple):
            self._parts[target] = part = self._compressed(part)
        return part

    def _compressed(self, offsets: NDArray[Any] | None) -> Moved:
        if offsets is None:
            return np.zeros(0, dtype=np.intp), np.zeros((0, 3))
        offsets = offsets if self._rows is None else offsets[self._rows]
        x, y, z = offsets.T
        vertices = np.flatnonzero((x != 0.0) | (y != 0.0) | (z != 0.0))
        return vertices, offsets[vertices].astype(np.float64)

    def weighted(self, weights: Floats) -> Floats:
        """Return the sum of all targets, w_s d_s: (V, 3)."""
        total = np.zeros((self.n_vertices, 3))
        for target in np.flatnonzero(weights).tolist():
            vertices, offsets = self.moved(target)
            if len(vertices) == self.n_vertices:
                total += weights[target] * offsets
            else:
                total[vertices] += weights[target] * offsets
        return total

    def dense(self) -> Floats:
        """Return the offsets of all vertices: (S, V, 3)."""
        result = np.zeros((len(self), self.n_vertices, 3))
        for target in range(len(self)):
            vertices, offsets = self.moved(target)
            result[target, vertices] = offsets
        return result
