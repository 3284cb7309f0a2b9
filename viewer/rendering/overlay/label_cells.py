"""Uniform grid over an image, for fast queries of the points within many rectangles."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from viewer.rig.arrays import Floats, Ints

__all__ = ["Cells", "Dots", "summed", "sums_within"]

_FINE = 4  # number of subdivisions of a pixel per axis; each subdivision contains at most one dot
_BLOCK = 4  # number of cells per axis of a block
_DENSE = 8  # mean number of dots per block above which dots are split into layers
_PAIRS = 1 << 18  # number of pairs of a rectangle and a dot per batch


class Cells:
    """The cells: 1 to ``n`` per axis within the image; 0 and ``n + 1`` are outside it.

    Parameters
    ----------
    picture : (int, int)
        Width and height, pixels.
    side : int
        Side length of a cell, pixels.

    Attributes
    ----------
    shape : (int, int)
        Rows and columns of an array with one element per cell.
    """

    def __init__(self, picture: tuple[int, int], side: int) -> None:
        self.side = side
        # Numbers of columns and rows.
        self._counts = np.array([-(-length // side) for length in picture])
        self.shape = int(self._counts[1]) + 2, int(self._counts[0]) + 2

    def of(self, points: Floats) -> Ints:
        """Return the cells that contain points: (..., 2), column and row."""
        found = np.clip(np.floor(points / self.side) + 1.0, 0, self._counts + 1)
        return np.asarray(found.astype(np.int32))

    def within(self, low: Floats, high: Floats) -> tuple[Ints, Ints]:
        """Return the half-open ranges of cells within rectangles, first and end: (..., 2)."""
        first = np.clip(np.ceil(low / self.side) + 1.0, 1, self._counts + 1)
        after = np.clip(np.floor(high / self.side) + 1.0, first, self._counts + 1)
        return first.astype(np.int32), after.astype(np.int32)

    def touching(self, low: Floats, high: Floats) -> tuple[Ints, Ints]:
        """Return the half-open ranges of cells that rectangles touch, first and end: (..., 2)."""
        return self.of(low), self.of(high) + np.int32(1)


def summed(table: Ints) -> Ints:
    """Return the summed-area table of an array, one row and column larger.

    Four of its elements give the sum over a rectangle (Crow 1984, Summed-area tables for texture
    mapping).
    """
    sums = np.zeros((table.shape[0] + 1, table.shape[1] + 1), dtype=np.int32)
    table.cumsum(axis=0, out=sums[1:, 1:], dtype=np.int32)
    sums[1:, 1:].cumsum(axis=1, out=sums[1:, 1:])
    return sums


def sums_within(sums: Ints, first: Ints, after: Ints) -> Ints:
    """Return the sums over rectangles of cells: (...,).

    Parameters
    ----------
    sums : (rows + 1, columns + 1)
        Result of ``summed``.
    first, after : (..., 2)
        Column and row of the first cell and the cell after the last; empty if they are equal.
    """
    flat, width = sums.ravel(), sums.shape[1]
    low, high = first[..., 1] * width, after[..., 1] * width
    left, right = first[..., 0], after[..., 0]
    return flat[high + right] - flat[high + left] - flat[low + right] + flat[low + left]


class Dots:
    """Points sorted into grid cells.

    Parameters
    ----------
    cells : Cells
        Grid over the image.
    points : (N, 2)
        Pixels from the image's left and upper edge. Points within the same quarter of a pixel
        are merged: otherwise all joints of a distant figure would be compared with each other.
    """

    def __init__(self, cells: Cells, points: Floats) -> None:
        self.cells = cells
        points = points[_firsts(np.floor(points * _FINE))]
        places = cells.of(points)
        numbers = places[:, 1] * np.int64(cells.shape[1]) + places[:, 0]
        counts = np.bincount(numbers, minlength=math.prod(cells.shape)).astype(np.int32)
        self._counts = counts.reshape(cells.shape)
        self._sums = summed(self._counts)
        order = np.argsort(numbers, kind="stable")
        levels = _levels(places)[order]
        points, numbers = points[order], numbers[order]
        self._layers = [
            (points[levels == level], self._starts(numbers[levels == level]))
            for level in range(int(levels.max(initial=0)) + 1)
        ]

    @property
    def n_layers(self) -> int:
        """Number of layers; the first layer's few dots suffice to reject most crowded positions."""
        return len(self._layers)

    def _starts(self, places: Ints) -> Ints:
        """Return the index of each cell's first dot, followed by the number of dots."""
        counts = np.bincount(places, minlength=math.prod(self.cells.shape))
        return np.concatenate([[0], counts.cumsum()]).astype(np.int32)

    def count_at(self, pixels: Ints) -> Ints:
        """Return the number of dots in the cells of pixels within the image: (...,)."""
        places = pixels // self.cells.side + 1
        return self._counts[places[..., 1], places[..., 0]]

    def fewest_within(self, low: Floats, high: Floats) -> Ints:
        """Return lower bounds of the number of dots within rectangles: (M,)."""
        return sums_within(self._sums, *self.cells.within(low, high))

    def most_within(self, low: Floats, high: Floats) -> Ints:
        """Return upper bounds of the number of dots within rectangles: (M,)."""
        return sums_within(self._sums, *self.cells.touching(low, high))

    def pairs(self, low: Floats, high: Floats, layer: int) -> Iterator[tuple[Ints, Floats]]:
        """Yield batches of pairs of a rectangle and a dot of one layer in the cells it touches.

        Parameters
        ----------
        low, high : (M, 2)
            Corners of the rectangles.
        layer : int
            Index of the layer, less than ``n_layers``.

        Yields
        ------
        owners : (P,)
            Indices of rectangles.
        dots : (P, 2)
            A point in or near each of these rectangles, pixels.
        """
        points, begins = self._layers[layer]
        first, after = self.cells.touching(low, high)
        owners, rows = spread(first[:, 1], after[:, 1] - first[:, 1])
        rows = rows * self.cells.shape[1]
        starts = begins[rows + first[owners, 0]]
        counts = begins[rows + after[owners, 0]] - starts
        some = np.flatnonzero(counts)
        part = (counts[some].cumsum() - 1) // _PAIRS
        for ranges in np.split(some, np.flatnonzero(np.diff(part)) + 1):
            ranks, places = spread(starts[ranges], counts[ranges])
            yield owners[ranges[ranks]], points[places]


def _levels(places: Ints) -> Ints:
    """Return layers of dots, (N,): 0 for one dot per block, 1 for one per cell, otherwise 2."""
    firsts = _firsts(places // _BLOCK)
    if len(places) < _DENSE * len(firsts):
        return np.zeros(len(places), dtype=np.int32)
    levels = np.full(len(places), 2, dtype=np.int32)
    levels[_firsts(places)] = 1
    levels[firsts] = 0
    return levels


def _firsts(rows: Floats | Ints) -> Ints:
    """Return the indices of the first occurrence of each distinct row of two integers: (M,)."""
    # Complex numbers are sorted faster than rows.
    pairs = rows.astype(np.float64).view(np.complex128)[:, 0]
    return np.unique(pairs, return_index=True)[1].astype(np.int32)


def spread(starts: Ints, counts: Ints) -> tuple[Ints, Ints]:
    """Return the owners and the integers of ranges, concatenated: (P,) each."""
    owners = np.repeat(np.arange(len(counts)), counts)
    before = starts - (counts.cumsum() - counts)
    numbers = np.arange(len(owners)) + before[owners]
    return owners.astype(np.int32), numbers.astype(np.int32)
