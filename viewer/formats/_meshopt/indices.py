"""Decoders of vertex indices compressed by meshoptimizer: triangles, and any sequence.

Each triangle depends on those before it, so triangles are decoded one by one. Specification:
Khronos Group, KHR_meshopt_compression, appendix A, modes 1 and 2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viewer.rig.arrays import Bytes

__all__ = ["decoded_indices", "decoded_triangles"]

_TRIANGLES, _INDICES = 0xE1, 0xD1  # first bytes of the streams
_TABLE = 16  # size of the table at the end of the triangles, bytes
_TAIL = 4  # size of the tail at the end of the indices, bytes
_WRAP = 0xFFFFFFFF
_MOST_BYTES = 5  # maximum length of a number with 7 bits per byte, bytes
_KEPT = 1 << 16  # maximum length of a queue; then its oldest entries are dropped, as 16 are in use


class _Numbers:
    """Data of triangles whose code does not fit into one byte."""

    __slots__ = ("data", "last", "place")

    def __init__(self, data: bytes, place: int) -> None:
        self.data, self.place, self.last = data, place, 0

    def byte(self) -> int:
        value = self.data[self.place]
        self.place += 1
        return value

    def index(self) -> int:
        """Return the next index, stored as the difference from the previous one."""
        value = shift = 0
        for _ in range(_MOST_BYTES):
            byte = self.byte()
            value |= (byte & 127) << shift
            if byte < 128:
                break
            shift += 7
        else:
            raise IndexError
        value &= _WRAP
        self.last = self.last + (value >> 1 ^ -(value & 1)) & _WRAP
        return self.last


def decoded_triangles(data: Bytes, count: int, stride: int) -> Bytes | None:
    """Return the decoded vertex indices of triangles: (count * stride,) uint8.

    Parameters
    ----------
    data : (M,) uint8
        The stream.
    count, stride : int
        Number of indices, and bytes per index, 2 or 4.

    Returns
    -------
    (count * stride,) or None
        None if the stream is damaged.
    """
    n_triangles, rest = divmod(count, 3)
    if rest or len(data) < 1 + n_triangles + _TABLE or data[0] != _TRIANGLES:
        return None
    stream = data.tobytes()
    numbers = _Numbers(stream[:-_TABLE], 1 + n_triangles)
    try:
        corners = _corners(stream[1 : 1 + n_triangles], numbers, stream[-_TABLE:])
    except IndexError:
        return None
    if numbers.place != len(numbers.data):
        return None
    return np.array(corners, dtype=np.int64).astype(f"<u{stride}").view(np.uint8)


def _corners(codes: bytes, numbers: _Numbers, table: bytes) -> list[int]:
    """Return the vertex indices of all triangles; raise IndexError if the stream is damaged."""
    corners: list[int] = []
    vertices: list[int] = []
    edges: list[tuple[int, int]] = []
    following = 0
    for code in codes:
        if code < 0xF0:
            a, b = edges[-1 - (code >> 4)]
            kind = code & 15
            if kind == 0:
                c = following
                following += 1
                vertices.append(c)
            elif kind < 13:
                c = vertices[-1 - kind]
            else:
                c = _free(numbers, kind)
                vertices.append(c)
            edges.append((c, b))
        else:
            a, b, c, following = _new(code, numbers, table, vertices, following)
            edges.append((b, a))
            edges.append((c, b))
        edges.append((a, c))
        corners += a, b, c
        if len(edges) > _KEPT:
            del edges[:-16], vertices[:-16]
    return corners


def _free(numbers: _Numbers, kind: int) -> int:
    """Return a third vertex: adjacent to the last one, or a stored one."""
    if kind == 15:
        return numbers.index()
    numbers.last = numbers.last + (1 if kind == 14 else -1) & _WRAP
    return numbers.last


def _new(
    code: int, numbers: _Numbers, table: bytes, vertices: list[int], following: int
) -> tuple[int, int, int, int]:
    """Return a triangle without a known edge, and the next new vertex."""
    pair = numbers.byte() if code >= 0xFE else table[code & 15]
    if code >= 0xFE and pair == 0:
        following = 0
    fresh: list[int] = []
    if code == 0xFF:
        a = numbers.index()
    else:
        a, following = following, following + 1
    fresh.append(a)
    corners = []
    for kind in (pair >> 4, pair & 15):
        if kind == 0:
            corner, following = following, following + 1
            fresh.append(corner)
        elif kind == 15 and code >= 0xFE:
            corner = numbers.index()
            fresh.append(corner)
        else:
            # Vertices of this triangle are added after all of them are known.
            corner = vertices[-kind]
        corners.append(corner)
    vertices += fresh
    return a, corners[0], corners[1], following


def decoded_indices(data: Bytes, count: int, stride: int) -> Bytes | None:
    """Return decoded vertex indices in any order; see ``decoded_triangles``."""
    if len(data) < 1 + count + _TAIL or data[0] != _INDICES:
        return None
    numbers = _varints(data[1:-_TAIL], count)
    if numbers is None:
        return None
    # Each index is stored as the difference from one of two previous ones, chosen by the lowest
    # bit.
    second = (numbers & 1).astype(np.bool_)
    steps = numbers >> 2 ^ -(numbers >> 1 & 1)
    sums = [np.cumsum(np.where(second == kind, steps, 0)) for kind in (False, True)]
    indices = np.where(second, sums[1], sums[0]) & _WRAP
    return indices.astype(f"<u{stride}").view(np.uint8)


def _varints(data: Bytes, count: int) -> NDArray[np.int64] | None:
    """Return numbers stored as 7 bits per byte; the eighth bit is set in all but the last byte."""
    ends = np.nonzero(data < 128)[0]
    if len(ends) != count or (count and ends[-1] != len(data) - 1) or (not count and len(data)):
        return None
    starts = np.concatenate([[0], ends[:-1] + 1]) if count else ends
    lengths = ends - starts + 1
    if (lengths > _MOST_BYTES).any():
        return None
    shifts = 7 * (np.arange(len(data)) - np.repeat(starts, lengths))
    parts = (data & 127).astype(np.int64) << shifts
    return np.add.reduceat(parts, starts) & _WRAP if count else parts
