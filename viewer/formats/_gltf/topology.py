"""Triangles of a primitive: lists, strips and fans, with or without indices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viewer.formats._gltf.document import Document
from viewer.formats._gltf.elements import Element
from viewer.rig.arrays import Ints

__all__ = ["TRIANGLES", "read_triangles"]

_LIST, _STRIP, _FAN = 4, 5, 6
TRIANGLES = (_LIST, _STRIP, _FAN)
"""Modes that draw triangles; all others draw points or lines."""


def read_triangles(
    document: Document,
    primitive: Element,
    n_vertices: int,
    decoded: NDArray[np.int64] | None = None,
) -> Ints:
    """Return the triangles of a primitive: (T, 3) int32.

    Parameters
    ----------
    document : Document
        The document.
    primitive : Element
        A primitive whose mode is in ``TRIANGLES``.
    n_vertices : int
        Number of its vertices.
    decoded : (T, 3), optional
        Triangles that are already decoded.

    Raises
    ------
    FormatError
        If the indices are malformed, or refer to missing vertices.
    """
    if decoded is not None:
        return _checked(document, primitive, decoded.reshape(-1), n_vertices).reshape(-1, 3)
    corners = _corners(document, primitive, n_vertices)
    mode = primitive.whole("mode", _LIST)
    if mode == _STRIP:
        return _strip(corners)
    if mode == _FAN:
        return _fan(corners)
    if len(corners) % 3:
        primitive.warn("G002.corners", "indices", n=len(corners), left=len(corners) % 3)
    return corners[: len(corners) // 3 * 3].reshape(-1, 3)


def _corners(document: Document, primitive: Element, n_vertices: int) -> Ints:
    """Return vertex indices in drawing order: (N,) int32."""
    accessors = document.accessors
    index = primitive.index("indices", len(accessors), "accessors")
    if index < 0:
        document.spend(n_vertices * 4, primitive.pointer)
        return np.arange(n_vertices, dtype=np.int32)
    corners = accessors.integers(index, ("SCALAR",), primitive.at("indices"))[:, 0]
    return _checked(document, primitive, corners, n_vertices)


def _checked(
    document: Document, primitive: Element, corners: NDArray[np.int64], n_vertices: int
) -> Ints:
    """Return vertex indices after checking that all exist: (N,) int32."""
    if len(corners) and int(corners.max()) >= n_vertices:
        bad = corners >= n_vertices
        entry = int(bad.argmax())
        document.source.refuse(
            "F002.gltf-corner",
            primitive.at("indices"),
            entry=entry,
            vertices=n_vertices,
            found=int(corners[entry]),
        )
        corners = np.where(bad, 0, corners)
    return corners.astype(np.int32)


def _strip(corners: Ints) -> Ints:
    """Return the triangles of a strip, every other one reversed (glTF 2.0, 3.7.2.1).

    Degenerate triangles, which connect parts of a strip, are omitted.

    >>> _strip(np.array([0, 1, 2, 3], dtype=np.int32)).tolist()
    [[0, 1, 2], [1, 3, 2]]
    """
    if len(corners) < 3:
        return np.zeros((0, 3), dtype=np.int32)
    triangles = np.column_stack([corners[:-2], corners[1:-1], corners[2:]])
    triangles[1::2] = triangles[1::2][:, [0, 2, 1]]
    a, b, c = triangles.T
    return triangles[(a != b) & (b != c) & (c != a)]


def _fan(corners: Ints) -> Ints:
    """Return the triangles of a fan around its first corner (glTF 2.0, 3.7.2.1).

    >>> _fan(np.array([0, 1, 2, 3], dtype=np.int32)).tolist()
    [[1, 2, 0], [2, 3, 0]]
    """
    if len(corners) < 3:
        return np.zeros((0, 3), dtype=np.int32)
    center = np.full(len(corners) - 2, corners[0])
    return np.column_stack([corners[1:-1], corners[2:], center])
