"""Layout of labels: choice and placement without overlap or ambiguity."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.overlay.label_candidates import (
    Places,
    clear_places,
    crowded,
    crowded_lines,
    line_pixels,
    places_of,
)
from viewer.rendering.overlay.label_cells import Cells, Dots
from viewer.rig.arrays import Bools, Floats, Ints

__all__ = ["Layout", "lay_out"]

_FEWEST, _MOST = 256, 1024  # number of labels in the first batch, and maximum of later batches
_CELL = 0.5  # side length of a cell in gaps, unless this gives too many cells
# Maximum numbers of cells, above which a grid costs more than it saves.
_CELLS_PER_LABEL, _MANY_CELLS = 40, 300_000
_SAMPLES = 5  # number of columns of a label that are tested first, which detects most overlaps


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """The placed labels.

    Attributes
    ----------
    chosen : (M,)
        Indices of the placed labels, in the order of placement.
    corners : (M, 2)
        Top left corners of the labels, integer pixels.
    ends : (M, 2)
        Point on each label that is nearest to the labelled point, pixels.
    has_line : (M,) bool
        Whether the label needs a leader line because there was no room next to its point.
    """

    chosen: Ints
    corners: Ints
    ends: Floats
    has_line: Bools


def lay_out(
    anchors: Floats,
    order: Ints,
    sizes: Ints,
    picture: tuple[int, int],
    gap: float,
) -> Layout:
    """Place labels next to their points in order, and omit those without room.

    A label is placed right or left of its point, diagonally, above or below, whichever position has
    the most room; otherwise at a distance, with a leader line. It is never closer to another point
    than to its own; distances are accurate to a quarter of a pixel.

    Parameters
    ----------
    anchors : (N, 2)
        The points, pixels from the image's left and upper edge.
    order : (N,)
        Indices of the labels in the order of placement.
    sizes : (N, 2)
        Width and height of the labels, pixels, 1 or more.
    picture : (int, int)
        Width and height of the image; labels stay within it.
    gap : float
        Pixels between a point and its label.
    """
    n_cells = min(_CELLS_PER_LABEL * max(len(order), 1), _MANY_CELLS)
    side = max(int(_CELL * gap), math.ceil(math.sqrt(math.prod(picture) / n_cells)))
    cells = Cells(picture, side)
    dots, taken = Dots(cells, anchors[order]), _Taken(picture, gap)
    chosen, corners = [np.zeros(0, np.int32)], [np.zeros((0, 2), np.int32)]
    ends, has_line = [np.zeros((0, 2))], [np.zeros(0, np.bool_)]
    for some in _portions(order):
        places = places_of(anchors[some], sizes[some], picture, gap)
        # Vectorized rejection of most positions that overlap others.
        may = np.flatnonzero(~crowded(places, anchors[some], dots, gap))
        places = places.take(may[taken.may_be_open(places.low[may], places.high[may])])
        places = places.take(_with_free_lines(places, taken, dots, gap))
        places = clear_places(places, dots, gap)
        found = places.take(_settle(places, taken, gap))
        chosen.append(some[found.labels])
        corners.append(found.low)
        ends.append(found.ends)
        has_line.append(found.has_line)
    return Layout(
        np.concatenate(chosen), np.concatenate(corners), np.concatenate(ends),
        np.concatenate(has_line),
    )  # fmt: skip


def _portions(order: Ints) -> Iterator[Ints]:
    """Yield batches of growing size, as fewer positions remain free for later labels."""
    first, count = 0, _FEWEST
    while first < len(order):
        yield order[first : first + count]
        first, count = first + count, min(2 * count, _MOST)


def _with_free_lines(places: Places, taken: _Taken, dots: Dots, gap: float) -> Ints:
    """Return the indices of positions without a leader line or with a clear path for it: (M,)."""
    rows = np.flatnonzero(places.has_line)
    led = places.take(rows)
    pixels, are_part = line_pixels(led, gap)
    is_crowded = crowded_lines(led, pixels, are_part, dots, gap)
    free = ~(taken.at(pixels) & are_part).any(axis=1) & ~is_crowded
    return np.delete(np.arange(len(places.labels)), rows[~free])


def _settle(places: Places, taken: _Taken, gap: float) -> Ints:
    """Choose the first free position of each label; return indices of positions: (M,)."""
    found: list[int] = []
    settled = -1  # the most recently placed label
    # Occupied positions, shared by labels of coincident points.
    closed: set[tuple[int, ...]] = set()
    pixels, are_part = line_pixels(places, gap)
    corners = list(map(tuple, np.hstack([places.low, places.high]).tolist()))
    for row, label in enumerate(places.labels.tolist()):
        if label == settled or corners[row] in closed:
            continue
        if not taken.is_open(corners[row]):
            closed.add(corners[row])
            continue
        path = pixels[row, are_part[row]]
        if not taken.at(path).any():
            taken.take(corners[row], path)
            found.append(row)
            settled = label
    return np.array(found, dtype=np.int32)


class _Taken:
    """Mask of the pixels occupied by labels and lines.

    ``picture`` is the width and height, pixels; ``gap`` is the number of pixels between a point and
    its label.
    """

    def __init__(self, picture: tuple[int, int], gap: float) -> None:
        self._pixels = np.zeros(picture[::-1], dtype=np.bool_)
        # Half a gap stays free on both sides, so that adjacent labels are not read as one.
        self._apart = round(0.5 * gap)

    def may_be_open(self, low: Ints, high: Ints) -> Bools:
        """Return a mask of rectangles that may be free: (M,); all others are certainly occupied."""
        # Labels have the same height, so an overlap always covers a pixel of the upper or lower
        # edge.
        left = np.maximum(low[:, :1] - self._apart, 0)
        right = np.minimum(high[:, :1] + self._apart, self._pixels.shape[1]) - 1
        columns = left + (right - left) * np.arange(_SAMPLES) // (_SAMPLES - 1)
        edges = self._pixels[low[:, 1:], columns] | self._pixels[high[:, 1:] - 1, columns]
        return ~edges.any(axis=1)

    def at(self, pixels: Ints) -> Bools:
        """Return whether pixels, given as column and row, are occupied: (...,)."""
        return self._pixels[pixels[..., 1], pixels[..., 0]]

    def is_open(self, corners: tuple[int, ...]) -> bool:
        """Return whether the rectangle of a label is free; corners are left, top, right, bottom."""
        left, top, right, bottom = corners
        around = slice(max(left - self._apart, 0), right + self._apart)
        return not self._pixels[top:bottom, around].any()

    def take(self, corners: tuple[int, ...], path: Ints) -> None:
        """Mark the rectangle of a label and the pixels (S, 2) of its line as occupied."""
        left, top, right, bottom = corners
        self._pixels[path[:, 1], path[:, 0]] = True
        self._pixels[top:bottom, left:right] = True
