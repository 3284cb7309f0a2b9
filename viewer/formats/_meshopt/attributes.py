"""Decoder of vertex attributes compressed by meshoptimizer, versions 0 and 1.

::

    stream  header byte, block…, padding, tail
    block   up to 256 elements; version 1: 2 control bits per byte of an element; data per byte
    data    2 header bits per group of 16 elements, group…
    group   16 deltas of 0, 1, 2, 4 or 8 bits; if all bits of a delta are set, its byte follows
    tail    first element, version 1: a mode for every 4 bytes of an element

The position of a group depends on the contents of the groups before it. Group sizes are therefore
computed for all positions in advance, so that finding each group takes one look-up; then all groups
with the same number of bits are decoded together. Specification: Khronos Group,
KHR_meshopt_compression, appendix A.
"""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.rig.arrays import Bytes

__all__ = ["decoded_attributes"]

_GROUP = 16  # number of elements per group
_LARGEST_BLOCK = 256  # maximum number of elements per block
_BLOCK_BYTES = 8192
_ZERO, _LITERAL = 2, 3  # control modes: no data, and one byte per element
# Bits per delta of the four group modes: in version 0, and for control modes 0 and 1.
_BITS = ((0, 2, 4, 8), (0, 1, 2, 4), (1, 2, 4, 8))
# The four group modes in a byte of header bits.
_MODES = tuple(tuple(byte >> shift & 3 for shift in (0, 2, 4, 6)) for byte in range(256))
_PADDING = (32, 24)  # minimum size of the tail in bytes, by version


@dataclass(slots=True)
class _Groups:
    """Groups with the same number of bits per delta, above 0."""

    starts: list[int] = field(default_factory=list)
    """Positions of the groups in the stream."""
    places: list[int] = field(default_factory=list)
    """Positions of the groups in the result, in units of groups."""


def decoded_attributes(data: Bytes, count: int, stride: int) -> Bytes | None:
    """Return the decoded elements, stored consecutively: (count * stride,) uint8.

    Parameters
    ----------
    data : (M,) uint8
        The stream.
    count, stride : int
        Number of elements, and bytes per element, a multiple of 4.

    Returns
    -------
    (count * stride,) or None
        None if the stream is damaged.
    """
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
                mode for byte in range(stride // 4) for mode in _MODES[stream[place + byte]]
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
    modes = [mode for header in headers for mode in _MODES[header]]
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


def _summed(deltas: Bytes, first: Bytes, mode: int) -> NDArray[Any] | None:
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
