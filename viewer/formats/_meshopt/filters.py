"""Filters of compressed attributes: unit vectors, quaternions, floats and colours.

Specification: Khronos Group, KHR_meshopt_compression, appendix B.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viewer.rig.arrays import Bytes, Floats

__all__ = ["FILTERS", "filtered"]

FILTERS = ("NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR")
"""Names of the filters."""


def filtered(data: Bytes, name: str, stride: int) -> Bytes:
    """Return elements with a filter applied.

    Parameters
    ----------
    data : (N,) uint8
        Decoded elements.
    name : str
        Entry of ``FILTERS``.
    stride : int
        Bytes of an element; 4 or 8 for unit vectors and colours, 8 for quaternions.
    """
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
    channels = [luma + orange - green, luma + green, luma - orange - green, own << 1 | own & 1]
    scaled = np.stack(channels, axis=1) * (np.iinfo(rows.dtype).max / most)[:, None]
    return _stored(scaled, rows)
