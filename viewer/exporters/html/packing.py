"""Arrays as compressed text: rounded to integers, as differences, in planes of bytes, deflated.

Differences are those of consecutive rows or, for values of the vertices of a mesh, from the fourth
corner of a parallelogram (Touma and Gotsman 1998, "Triangle Mesh Compression", section 3): row r is
stored as x_r - (x_a + x_b - x_c), where a, b, c < r are corners of two triangles with a common edge
a b. This halves the bytes of smooth values.

``decode.js`` is the reader of the page; ``unpacked`` reads the same text for the measured losses.
"""

from __future__ import annotations

import base64
import json
import zlib

import numpy as np
from numpy.typing import ArrayLike, NDArray

from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.file_record import Json

_LARGEST = 2.0**30  # differences of two such integers fit into 32 bits
_CORNER_BITS = 30.0  # of a row of ``near``, at most about 10 for each number
_MOST_DIFFERENCES = 2  # speeds of smooth motions change little, so their second differences do not


class Packer:
    """Collects arrays and files, equal ones once; each is referred to by its index in ``items``."""

    def __init__(self) -> None:
        self.items: list[Json] = []
        self._parts: list[bytes] = []
        self._size = 0
        self._known: dict[tuple[str, bytes], int] = {}

    def add(
        self, values: ArrayLike, step: ArrayLike = 1.0, near: NDArray[np.int32] | None = None
    ) -> int:
        """Add an array (N,) or (N, C), rounded to multiples of ``step``, one or (C,).

        ``near``: the ``earlier_corners`` of its rows, if these are vertices of a mesh.
        """
        rows = np.asarray(values, dtype=np.float64)
        rows = rows[:, None] if rows.ndim == 1 else rows.reshape(len(rows), -1)
        steps = np.broadcast_to(np.asarray(step, dtype=np.float64), rows.shape[1:])
        low, high = (
            (rows.min(axis=0), rows.max(axis=0)) if rows.size else (np.zeros(rows.shape[1]),) * 2
        )
        # Steps that would need more than 32 bits grow; the losses of the export show the effect.
        steps = np.maximum(steps, (high - low) / _LARGEST)
        middle = np.round((0.5 * low + 0.5 * high) / steps)
        middle = np.where(np.abs(middle) < _LARGEST, 0.0, middle)
        integers = np.round(rows / steps - middle).astype(np.int32)
        order, coded, bits = _shortest(integers)
        along: Json = {}
        if near is not None and len(integers):
            predicted = integers[near[:, 0]] + integers[near[:, 1]] - integers[near[:, 2]]
            predicted[0] = 0
            other = _unsigned(integers - predicted)
            if _bits(other) + _CORNER_BITS * len(near) < bits:
                order, coded = 0, other
                along = {"near": self.add(np.arange(len(near))[:, None] - near)}
        n_planes = max(1, -(-int(coded.max(initial=0)).bit_length() // 8))
        # The same byte of all numbers of a column: high bytes are nearly all 0.
        planes = coded.T.astype("<u4").copy().view(np.uint8).reshape(-1, 4)[:, :n_planes]
        item: Json = {
            "shape": [*rows.shape],
            "order": order,
            "planes": n_planes,
            "step": _short(steps),
            "origin": _short(middle * steps),
            **along,
        }
        return self._append(item, np.ascontiguousarray(planes.T).tobytes())

    def add_file(self, data: bytes, kind: str) -> int:
        """Add the bytes of a picture of a media type."""
        return self._append({"type": kind, "size": len(data)}, data)

    def _append(self, item: Json, data: bytes) -> int:
        # People in a capture are often the same body, and materials share images.
        key = json.dumps(item), data
        if key not in self._known:
            self._known[key] = len(self.items)
            self.items.append({**item, "at": self._size})
            self._parts.append(data)
            self._size += len(data)
        return self._known[key]

    def text(self) -> str:
        """Return all bytes, deflated, in base64."""
        return base64.b64encode(zlib.compress(b"".join(self._parts), 9)).decode("ascii")


def unpacked(items: list[Json], text: str) -> list[Floats]:
    """Return the arrays, (N, C) each, that ``decode.js`` reads from a text; empty for files."""
    data = zlib.decompress(base64.b64decode(text))
    found: list[Floats] = []
    for item in items:
        if "shape" not in item:
            found.append(np.zeros((0, 0)))
            continue
        n_rows, n_columns = item["shape"]
        count, n_planes = n_rows * n_columns, item["planes"]
        planes = np.frombuffer(data, np.uint8, count * n_planes, item["at"]).reshape(n_planes, -1)
        coded = np.zeros(count, np.uint32)
        for plane, values in enumerate(planes):
            coded |= values.astype(np.uint32) << np.uint32(8 * plane)
        integers = (coded >> 1).astype(np.int32) ^ -(coded & 1).astype(np.int32)
        columns = integers.reshape(n_columns, n_rows)
        if "near" in item:
            near = np.arange(n_rows)[:, None] - np.round(found[item["near"]]).astype(np.int64)
            rows = columns.T.copy()
            for row, (a, b, c) in enumerate(near[1:].tolist(), 1):
                rows[row] += rows[a] + rows[b] - rows[c]
            columns = rows.T
        for _ in range(item["order"]):
            columns = np.cumsum(columns, axis=1, dtype=np.int32)
        found.append(columns.T * np.array(item["step"]) + np.array(item["origin"]))
    return found


def earlier_corners(triangles: Ints, count: int) -> NDArray[np.int32]:
    """Return the rows a, b, c < r from which each vertex r of a mesh is predicted: (V, 3).

    Without two triangles before it, b = c, and a is a neighbour or the vertex before; 0 in row 0.
    """
    near = np.maximum(np.arange(count, dtype=np.int32) - 1, 0)[:, None].repeat(3, axis=1)
    edges = np.concatenate([np.roll(triangles, -side, axis=1) for side in range(3)])
    low, high, corner = edges[:, :2].min(axis=1), edges[:, :2].max(axis=1), edges[:, 2]
    nearest = np.full(count, -1, np.int32)
    proper = low < high
    np.maximum.at(nearest, high[proper], low[proper])
    near[nearest >= 0] = nearest[nearest >= 0, None]
    order = np.lexsort((corner, high, low))
    low, high, corner = low[order], high[order], corner[order]
    is_shared = (low[:-1] == low[1:]) & (high[:-1] == high[1:])
    first, second = corner[:-1][is_shared], corner[1:][is_shared]  # ascending
    a, b = low[:-1][is_shared], high[:-1][is_shared]
    last = (second > b) & (second > first)
    near[second[last]] = np.stack([a, b, first], axis=1)[last]
    return near


def _bits(coded: NDArray[np.uint32]) -> float:
    """Return about how many bits numbers need."""
    return float(np.log2(coded.astype(np.float64) + 1.0).sum())


def _shortest(integers: NDArray[np.int32]) -> tuple[int, NDArray[np.uint32], float]:
    """Return the number of differences that needs the fewest bits, these coded, and the bits."""
    best, found, fewest = 0, _unsigned(integers), np.inf
    for order in range(_MOST_DIFFERENCES + 1):
        if order:
            # The first row is its difference from 0. Sums wrap around as in 32-bit arithmetic.
            integers = np.diff(integers, axis=0, prepend=np.zeros((1, integers.shape[1]), "i4"))
        coded = _unsigned(integers)
        bits = _bits(coded)
        if bits < fewest:
            best, found, fewest = order, coded, bits
    return best, found, fewest


def _unsigned(integers: NDArray[np.int32]) -> NDArray[np.uint32]:
    """Return 0, -1, 1, -2 ... as 0, 1, 2, 3 ..., so that small numbers have few bits."""
    return ((integers << 1) ^ (integers >> 31)).view(np.uint32)


def _short(values: Floats) -> float | list[float]:
    """Return one number if all are equal."""
    numbers: list[float] = values.tolist()
    return numbers[0] if len(set(numbers)) == 1 else numbers
