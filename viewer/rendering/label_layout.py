"""Which of many labels are drawn, and where, so that none covers another or seems another's."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from viewer.rig.arrays import Bools, Floats, Ints

__all__ = ["Layout", "lay_out"]

_SIDE = math.sqrt(0.5)
_WAYS = np.array(
    [[1, 0], [-1, 0], [_SIDE, -_SIDE], [_SIDE, _SIDE], [-_SIDE, -_SIDE], [-_SIDE, _SIDE],
     [0, -1], [0, 1]],
    dtype=np.float64,
)  # fmt: skip
"""From a point to its label, in the order of preference; y grows downwards."""

_REACHES = (1.0, 3.0, 5.0)
"""How far labels are from their points, gaps; from the second on a line leads there."""

_ALIKE = 1.0  # pixels between points whose labels cannot be told apart by their places
_CLEARER = 1.5  # times as far from other points as from its own, a label without a line; with
# one, so many gaps
_FREE = 3.0  # the same where there is much room
_BESIDE_LINE = 0.75  # gaps between a line and other points
_IN_VAIN = 200  # labels without room in a row after which no other is tried


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """The labels that are drawn.

    Attributes
    ----------
    chosen : (M,)
        Indices of the labels, in the order in which they were placed.
    corners : (M, 2)
        Their left upper corners, whole pixels.
    ends : (M, 2)
        The point of each that is nearest to its own point, pixels.
    has_line : (M,) bool
        Whether a line has to lead there, because there was no room right beside the point.
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
    """Place labels one after the other beside their points, and leave out those without room.

    A label lies right of its point, left, askew, above or below, where the most room is; else a
    little away from it with a line. It is never nearer to another point than to its own.

    Parameters
    ----------
    anchors : (N, 2)
        The points, pixels from the picture's left and upper edge.
    order : (N,)
        Indices of the labels: those that come first are placed first.
    sizes : (N, 2)
        Width and height of the labels, pixels.
    picture : (int, int)
        Width and height of the picture; labels lie within it.
    gap : float
        Pixels between a point and its label.
    """
    places = _places(anchors[order], sizes[order], picture, gap)
    dots = _Dots(anchors[order])
    taken, apart = np.zeros(picture[::-1], dtype=bool), round(0.5 * gap)
    found: list[tuple[int, int]] = []
    n_in_vain = 0
    for row, index in enumerate(order.tolist()):
        across, down = sizes[index].tolist()
        n_in_vain += 1
        for place in _choices(places, row, dots.around(row, sizes[index], gap), gap):
            left, top = places.corners[row, place].tolist()
            # Half a gap stays free around each: two words beside each other are not one.
            around = slice(max(left - apart, 0), left + across + apart)
            path = _path(places, row, place, gap)
            if taken[top : top + down, around].any() or taken[path].any():
                continue
            taken[top : top + down, left : left + across] = True
            taken[path] = True
            found.append((row, place))
            n_in_vain = 0
            break
        if n_in_vain == _IN_VAIN:
            break  # so crowded a picture has no room for the rest either
    rows, chosen = np.array(found, dtype=np.int32).reshape(-1, 2).T
    return Layout(
        order[rows],
        places.corners[rows, chosen],
        places.ends[rows, chosen],
        chosen >= len(_WAYS),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Places:
    """Where labels may lie within the picture; the first eight places of each need no line.

    ``anchors`` (N, 2), ``sizes`` (N, 2), ``corners`` (N, P, 2), ``ends`` (N, P, 2), ``own`` (N, P):
    how far the ends are from the anchors, ``is_inside`` (N, P).
    """

    anchors: Floats
    sizes: Ints
    corners: Ints
    ends: Floats
    own: Floats
    is_inside: Bools


def _places(anchors: Floats, sizes: Ints, picture: tuple[int, int], gap: float) -> _Places:
    """Return all places of all labels."""
    ways = np.tile(_WAYS, (len(_REACHES), 1))
    nearest = anchors[:, None] + gap * np.repeat(_REACHES, len(_WAYS))[:, None] * ways
    corners = np.rint(nearest - 0.5 * (1.0 - np.sign(ways)) * sizes[:, None]).astype(np.int32)
    # What lies straight beside its point may be shifted along it to stay within the picture.
    shifted = np.clip(corners, 0, np.maximum(np.array(picture) - sizes, 0)[:, None])
    corners = np.where(ways == 0.0, shifted, corners).astype(np.int32)
    highest = corners + sizes[:, None]
    ends = np.clip(anchors[:, None], corners, highest)
    own = np.linalg.norm(ends - anchors[:, None], axis=2)
    is_inside = ((corners >= 0) & (highest <= picture)).all(axis=2) & (own > 0.0)
    return _Places(anchors, sizes, corners, ends, own, is_inside)


class _Dots:
    """The points, to be asked which others are around one of them."""

    def __init__(self, points: Floats) -> None:
        self._points = points
        # By x, so that those around a point are a slice.
        self._sorted = points[np.argsort(points[:, 0], kind="stable")]

    def around(self, row: int, size: Ints, gap: float) -> Floats:
        """Return the others that its label could be too near to: (M, 2)."""
        x, y = self._points[row].tolist()
        reach = gap * _REACHES[-1]
        wide, high = (size + reach + _FREE * gap).tolist()
        first, last = np.searchsorted(self._sorted[:, 0], (x - wide, x + wide))
        near = self._sorted[first:last]
        away = np.abs(near - (x, y))
        return near[(away[:, 1] < high) & (away.max(axis=1) >= _ALIKE)]


def _choices(places: _Places, row: int, others: Floats, gap: float) -> Iterator[int]:
    """Give the places of a label that are far enough from the other points, the best first."""
    beside, led = slice(len(_WAYS)), slice(len(_WAYS), None)
    size, own = places.sizes[row], places.own[row, beside]
    clear = _clearance(places.corners[row, beside], size, others)
    fits = places.is_inside[row, beside] & (clear >= _CLEARER * own)
    is_free = fits & (clear >= _FREE * own)
    yield from np.flatnonzero(is_free).tolist()
    yield from np.flatnonzero(fits & ~is_free).tolist()
    clear = _clearance(places.corners[row, led], size, others)
    fits = places.is_inside[row, led] & (clear >= _CLEARER * gap)
    fits &= _passes(places.anchors[row], places.ends[row, led], others, _BESIDE_LINE * gap)
    yield from (len(_WAYS) + np.flatnonzero(fits)).tolist()


def _clearance(corners: Ints, size: Ints, points: Floats) -> Floats:
    """Return how far rectangles are from the nearest of some points: (P,), inf without any."""
    low = corners[:, None] - points
    outside = np.maximum(np.maximum(low, -low - size), 0.0)
    distances = np.sqrt((outside**2).sum(axis=-1))
    return np.asarray(distances.min(axis=1, initial=np.inf))


def _passes(start: Floats, ends: Floats, points: Floats, least: float) -> Bools:
    """Return which lines from a point stay so far away from some points: (P,)."""
    along = ends - start
    squares = np.maximum((along**2).sum(axis=1), 1e-12)
    shares = np.clip((points - start) @ along.T / squares, 0.0, 1.0)  # (points, lines)
    away = (points - start)[:, None] - shares[..., None] * along
    return np.asarray(np.linalg.norm(away, axis=-1).min(axis=0, initial=np.inf) >= least)


def _path(places: _Places, row: int, place: int, gap: float) -> tuple[Ints, Ints]:
    """Return the pixels (rows, columns) of a line from beside a point to just before its label."""
    start, end = places.anchors[row], places.ends[row, place]
    length = float(places.own[row, place])
    last = length - 1.0 if place >= len(_WAYS) else 0.0  # those beside their points have none
    steps = np.arange(0.5 * gap, last)[:, None] / length
    pixels = np.floor(start + steps * (end - start)).astype(np.int32)
    return pixels[:, 1], pixels[:, 0]
