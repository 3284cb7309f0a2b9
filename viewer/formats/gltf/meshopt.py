"""Compressed buffer views (EXT_meshopt_compression and KHR_meshopt_compression).

A view holds vertex attributes, the indices of triangles, or any sequence of indices. Each has its
own decoder; attributes may also be filtered. Specification: Khronos Group, KHR_meshopt_compression,
appendix A (decoders) and B (filters).

Attributes are compressed by meshoptimizer, versions 0 and 1::

    stream  header byte, block…, padding, tail
    block   up to 256 elements; version 1: 2 control bits per byte of an element; data per byte
    data    2 header bits per group of 16 elements, group…
    group   16 deltas of 0, 1, 2, 4 or 8 bits; if all bits of a delta are set, its byte follows
    tail    first element, version 1: a mode for every 4 bytes of an element

The position of a group depends on the contents of the groups before it. Group sizes are therefore
computed for all positions in advance, so that finding each group takes one look-up; then all groups
with the same number of bits are decoded together. Triangles are decoded one by one, because each
depends on those before it.

meshoptimizer's own decoder is 95 times faster (200,000 elements of 16 bytes in 1 ms instead of 91),
but its Python package needs a C++ compiler: there are no wheels. These files open without it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import wording
from viewer.formats.gltf.elements import Element
from viewer.rigs.arrays import Bytes, Floats

_NAMES = ("KHR_meshopt_compression", "EXT_meshopt_compression")
_MODES = ("ATTRIBUTES", "TRIANGLES", "INDICES")
_STRIDES = {"OCTAHEDRAL": (4, 8), "QUATERNION": (8,), "COLOR": (4, 8)}
_LARGEST_STRIDE = 256

_FILTERS = ("NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR")

# Attributes.
_GROUP = 16  # number of elements per group
_LARGEST_BLOCK = 256  # maximum number of elements per block
_BLOCK_BYTES = 8192
_ZERO, _LITERAL = 2, 3  # control modes: no data, and one byte per element

# Bits per delta of the four group modes: in version 0, and for control modes 0 and 1.
_BITS = ((0, 2, 4, 8), (0, 1, 2, 4), (1, 2, 4, 8))

# The four group modes in a byte of header bits.
_PREDICTIONS = tuple(tuple(byte >> shift & 3 for shift in (0, 2, 4, 6)) for byte in range(256))
_PADDING = (32, 24)  # minimum size of the tail in bytes, by version

# Triangles and indices.
_TRIANGLES, _INDICES = 0xE1, 0xD1  # first bytes of the streams
_TABLE = 16  # size of the table at the end of the triangles, bytes
_TAIL = 4  # size of the tail at the end of the indices, bytes
_WRAP = 0xFFFFFFFF
_MOST_BYTES = 5  # maximum length of a number with 7 bits per byte, bytes
_KEPT = 1 << 16  # maximum length of a queue; then its oldest entries are dropped, as 16 are in use


def meshopt_of(view: Element) -> Element | None:
    """Return the extension that describes the compressed form of a buffer view, if it has one."""
    if not view.has("extensions"):
        return None
    found = (view.extension(name) for name in _NAMES)
    return next((part for part in found if part is not None), None)


def decoded_view(compressed: Element, data: Bytes, spend: Callable[[int, str], None]) -> Bytes:
    """Return the contents of a compressed buffer view (N,), read-only."""
    mode = compressed.choice("mode", _MODES)
    kind = compressed.choice("filter", _FILTERS, "NONE")
    count, stride = compressed.whole("count"), compressed.whole("byteStride")
    if mode != "ATTRIBUTES":
        if stride not in (2, 4):
            raise compressed.wrong("byteStride", "2 or 4")
        if kind != "NONE":
            raise compressed.wrong("filter", f"no filter in mode {mode}")
    elif stride % 4 or not 0 < stride <= _LARGEST_STRIDE:
        raise compressed.wrong("byteStride", f"a multiple of 4 up to {_LARGEST_STRIDE}")
    elif kind in _STRIDES and stride not in _STRIDES[kind]:
        raise compressed.wrong("byteStride", " or ".join(map(str, _STRIDES[kind])))
    spend(count * stride, compressed.pointer)
    if mode == "ATTRIBUTES":
        decoded = decoded_attributes(data, count, stride)
    elif mode == "TRIANGLES":
        decoded = decoded_triangles(data, count, stride)
    else:
        decoded = decoded_indices(data, count, stride)
    if decoded is None:
        raise compressed.fault(wording.GLTF_COMPRESSED)
    result = filtered(decoded, kind, stride)
    result.flags.writeable = False
    return result


@dataclass(slots=True)
class _Groups:
    """Groups with the same number of bits per delta, above 0."""

    starts: list[int] = field(default_factory=list)
    """Positions of the groups in the stream."""
    places: list[int] = field(default_factory=list)
    """Positions of the groups in the result, in units of groups."""


def decoded_attributes(data: Bytes, count: int, stride: int) -> Bytes | None:
    """Return the consecutive elements (count * stride,); None if the stream is damaged."""
    version = int(data[0]) - 0xA0 if len(data) else -1
    tail = stride + (stride // 4 if version == 1 else 0)
    if version not in (0, 1) or len(data) < 1 + tail:
        return None
    end = len(data) - max(tail, _PADDING[version])
    deltas = _deltas(data, count, stride, version, end)
    if deltas is None:
        return None
    first = data[len(data) - tail :][:stride]
    channels = data[len(data) - tail + stride :].tolist() or [0] * (stride // 4)
    result = np.empty((count, stride), dtype=np.uint8)
    for channel, mode in enumerate(channels):
        columns = slice(channel * 4, channel * 4 + 4)
        values = _summed(deltas[:, columns], first[columns], mode)
        if values is None:
            return None
        result[:, columns] = values
    return result.reshape(-1)


def _deltas(data: Bytes, count: int, stride: int, version: int, end: int) -> Bytes | None:
    """Return the deltas of all elements, (count, stride); None if the stream is damaged."""
    block = min(_BLOCK_BYTES // stride & ~15, _LARGEST_BLOCK)
    n_blocks = -(-count // block)
    per_block = block // _GROUP
    found: dict[int, _Groups] = {bits: _Groups() for bits in (1, 2, 4, 8)}
    literals: list[tuple[int, int, int]] = []
    try:
        place = _scan(data, (count, stride, version, block), found, literals)
    except IndexError:
        return None
    if place != end:
        return None
    groups = np.zeros((n_blocks * stride * per_block, _GROUP), dtype=np.uint8)
    for bits, some in found.items():
        if some.starts:
            groups[some.places] = _unpacked(data, np.array(some.starts), bits)
    flat = groups.reshape(-1)
    for start, first, size in literals:
        flat[first * _GROUP : first * _GROUP + size] = data[start : start + size]
    shape = (n_blocks, stride, per_block * _GROUP)
    return groups.reshape(shape).transpose(0, 2, 1).reshape(-1, stride)[:count]


def _scan(
    data: Bytes,
    layout: tuple[int, int, int, int],
    found: dict[int, _Groups],
    literals: list[tuple[int, int, int]],
) -> int:
    """Find all groups and return their end; raise IndexError past the end of the stream."""
    count, stride, version, block = layout
    sizes = _sizes(data)
    stream = data.tobytes()
    per_block = block // _GROUP
    tables = [[(sizes[bits], found.get(bits)) for bits in row] for row in _BITS]
    place, group = 1, 0
    for left in range(count, 0, -block):
        n_elements = min(left, block)
        n_groups = -(-n_elements // _GROUP)
        controls = [0] * stride
        if version == 1:
            controls = [
                mode for byte in range(stride // 4) for mode in _PREDICTIONS[stream[place + byte]]
            ]
            place += stride // 4
        for control in controls:
            if control == _LITERAL:
                literals.append((place, group, n_elements))
                place += n_elements
            elif control != _ZERO:
                place = _find_groups(stream, place, group, n_groups, tables[version + control])
            group += per_block
    return place


def _find_groups(
    stream: bytes,
    place: int,
    group: int,
    n_groups: int,
    table: list[tuple[bytes, _Groups | None]],
) -> int:
    """Find the groups of one byte position in a block's elements, and return their end."""
    n_headers = -(-n_groups // 4)
    headers = stream[place : place + n_headers]
    place += n_headers
    modes = [mode for header in headers for mode in _PREDICTIONS[header]]
    for number in range(n_groups):
        sizes, groups = table[modes[number]]
        if groups is not None:
            groups.starts.append(place)
            groups.places.append(group + number)
        place += sizes[place]
    return place


def _sizes(data: Bytes) -> dict[int, bytes]:
    """Return the size of a group that begins at each byte, by its bits per delta."""
    result = {0: bytes(len(data)), 8: bytes([_GROUP]) * len(data)}
    for bits in (1, 2, 4):
        packed = 2 * bits
        sums = np.cumsum(np.concatenate([[0], _SENTINELS[bits][data], np.zeros(packed, np.int64)]))
        result[bits] = (packed + sums[packed:] - sums[:-packed])[: len(data)].astype("u1").tobytes()
    return result


def _parts(bits: int) -> Bytes:
    """Return the deltas in each possible byte: (256, 8 / bits), in the order of elements."""
    shifts = np.arange(0, 8, bits)
    if bits > 1:
        shifts = shifts[::-1]
    return (np.arange(256)[:, None] >> shifts & ((1 << bits) - 1)).astype(np.uint8)


_PARTS = {bits: _parts(bits) for bits in (1, 2, 4)}

# Number of deltas with all bits set in each possible byte.
_SENTINELS = {bits: (parts == (1 << bits) - 1).sum(axis=1) for bits, parts in _PARTS.items()}


def _unpacked(data: Bytes, starts: NDArray[np.int64], bits: int) -> Bytes:
    """Return the deltas of groups: (N, 16)."""
    if bits == 8:
        return data[starts[:, None] + np.arange(_GROUP)]
    packed = 2 * bits
    deltas = _PARTS[bits][data[starts[:, None] + np.arange(packed)]].reshape(-1, _GROUP)
    is_whole = deltas == (1 << bits) - 1
    rows = np.nonzero(is_whole)[0]
    order = np.cumsum(is_whole, axis=1)[is_whole] - 1
    deltas[is_whole] = data[starts[rows] + packed + order]
    return deltas


def _summed(deltas: Bytes, first: Bytes, mode: int) -> NDArray[np.number] | None:
    """Return the values of 4 bytes of all elements, (N, 4); None if the mode is unknown."""
    kind, rotation = mode & 15, mode >> 4
    if kind > 2 or (rotation and kind != 2):
        return None
    dtype = ("u1", "<u2", "<u4")[kind]
    steps = np.ascontiguousarray(deltas).view(dtype)
    start = np.ascontiguousarray(first).view(dtype)
    if kind == 2:
        if rotation:
            steps = steps >> rotation | steps << (32 - rotation)
        steps[:1] ^= start
        return np.bitwise_xor.accumulate(steps, axis=0).view("u1")
    # Differences are zigzag-encoded: the lowest bit is the sign.
    steps = steps >> 1 ^ (0 - (steps & 1)).astype(dtype)
    steps[:1] += start
    return np.cumsum(steps, axis=0, dtype=dtype).view("u1")


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
    """Return vertex indices of 2 or 4 bytes (count * stride,); None if the stream is damaged."""
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


def filtered(data: Bytes, name: str, stride: int) -> Bytes:
    """Return decoded elements of ``stride`` bytes with a filter, an entry of ``_FILTERS``: (N,)."""
    if name == "OCTAHEDRAL":
        return _octahedral(data.view(f"<i{stride // 4}").reshape(-1, 4))
    if name == "QUATERNION":
        return _quaternions(data.view("<i2").reshape(-1, 4))
    if name == "EXPONENTIAL":
        return _exponential(data.view("<i4"))
    if name == "COLOR":
        return _colors(data.view(f"<u{stride // 4}").reshape(-1, 4))
    return data


def _stored(values: Floats, like: NDArray[np.integer]) -> Bytes:
    """Return values as the bytes of integers, rounded to nearest with halves away from zero."""
    rounded = np.trunc(values + np.copysign(0.5, values))
    limits = np.iinfo(like.dtype)
    return np.clip(rounded, limits.min, limits.max).astype(like.dtype).view(np.uint8).reshape(-1)


def _octahedral(rows: NDArray[np.signedinteger]) -> Bytes:
    """Return the unit vectors of octahedral coordinates."""
    # The third component stores the value of 1, which damaged data may set to 0.
    one = np.where(rows[:, 2] == 0, 1, rows[:, 2]).astype(np.float64)
    x, y = rows[:, 0] / one, rows[:, 1] / one
    z = 1.0 - np.abs(x) - np.abs(y)
    # The lower half of the octahedron is folded outwards.
    fold = np.maximum(-z, 0.0)
    vectors = np.stack([x - np.copysign(fold, x), y - np.copysign(fold, y), z], axis=1)
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    units = vectors / np.where(lengths == 0.0, 1.0, lengths) * np.iinfo(rows.dtype).max
    return _stored(np.column_stack([units, rows[:, 3]]), rows)


def _quaternions(rows: NDArray[np.signedinteger]) -> Bytes:
    """Return quaternions whose largest component is not stored."""
    # The fourth number has the index of the largest component in its two lowest bits; with these
    # set, it is the value of 1. No other component exceeds sqrt(1/2), which is the scale, and the
    # largest follows from the unit length; a quaternion and its negative are the same rotation.
    one = (rows[:, 3] | 3).astype(np.float64)
    small = rows[:, :3] / one[:, None] * np.sqrt(0.5)
    large = np.sqrt(np.maximum(0.0, 1.0 - np.einsum("nc,nc->n", small, small)))
    largest = rows[:, 3] & 3
    columns = (largest[:, None] + np.arange(4)) % 4
    result = np.empty((len(rows), 4))
    np.put_along_axis(result, columns, np.column_stack([large, small]), axis=1)
    return _stored(result * 32767.0, rows)


def _exponential(values: NDArray[np.signedinteger]) -> Bytes:
    """Return floats from an exponent of 8 bits and a mantissa of 24 bits, both signed."""
    exponents, mantissas = values >> 24, values << 8 >> 8
    return np.ldexp(mantissas.astype(np.float64), exponents).astype("<f4").view(np.uint8)


def _colors(rows: NDArray[np.unsignedinteger]) -> Bytes:
    """Return colours from luma and two chroma differences; alpha determines the number of bits."""
    signed = rows.astype(np.dtype(f"<i{rows.dtype.itemsize}")).astype(np.int64)
    alpha = rows[:, 3].astype(np.int64)
    luma = rows[:, 0].astype(np.int64)
    orange, green = signed[:, 1], signed[:, 2]
    # The highest set bit of alpha is a marker; the bits below it are the value of alpha.
    bits = np.frexp(np.maximum(alpha, 1).astype(np.float64))[1]
    most = (1 << bits) - 1
    own = alpha & most >> 1
    # YCoCg: red = Y + Co - Cg, green = Y + Cg, blue = Y - Co - Cg. Alpha has one bit less than the
    # colours, so its lowest bit is repeated.
    channels = [luma + orange - green, luma + green, luma - orange - green, own << 1 | own & 1]
    scaled = np.stack(channels, axis=1) * (np.iinfo(rows.dtype).max / most)[:, None]
    return _stored(scaled, rows)
