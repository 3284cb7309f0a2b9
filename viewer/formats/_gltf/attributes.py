"""Vertex attributes of a primitive: positions, normals, texture coordinates and colours."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.errors import FormatError
from viewer.formats._gltf.document import Document
from viewer.formats._gltf.elements import Element
from viewer.rig.arrays import Bools, Floats, Ints

__all__ = [
    "Attributes",
    "read_colors",
    "read_normals",
    "read_positions",
    "read_uvs",
    "tangents_of",
]

_MOST_UVS = 8  # maximum number of texture coordinate sets
_NUMBERED = re.compile(r"([A-Z]+)_(0|[1-9][0-9]{0,3})")


@dataclass(frozen=True, slots=True, eq=False)
class Attributes:
    """Attributes of a primitive, or of one of its morph targets.

    Attributes
    ----------
    document : Document
        The document.
    element : Element
        Accessor indices by name.
    n_vertices : int
        Number of elements that each accessor must have.
    rows : (V,) int32 or None
        Vertices to read, if other primitives use the remaining ones; None for all.
    decoded : dict
        Components of the attributes that are compressed with Draco.
    """

    document: Document
    element: Element
    n_vertices: int
    rows: Ints | None = None
    decoded: Mapping[str, NDArray[Any]] = field(default_factory=dict)

    @property
    def n_rows(self) -> int:
        """Number of vertices that are read, V."""
        return self.n_vertices if self.rows is None else len(self.rows)

    def accessor(self, name: str) -> int:
        """Return the index of an attribute's accessor, -1 if the attribute is missing.

        Raises
        ------
        FormatError
            If there is no such accessor, or it has a different number of elements.
        """
        accessors = self.document.accessors
        index = self.element.index(name, len(accessors), "accessors")
        if index < 0:
            return index
        # The counts of accessors may be wrong if the data are compressed.
        decoded, expected = self.decoded.get(name), self.n_vertices
        found = accessors.count(index) if decoded is None else len(decoded)
        if found != expected:
            raise self.element.fault("F002.gltf-vertices", name, expected=expected, found=found)
        return index

    def floats(self, name: str, *kinds: str) -> Floats | None:
        """Return an attribute, (V, C); None if it is missing; errors as of ``accessor``."""
        index = self.accessor(name)
        if index < 0:
            return None
        read, user = self.document.accessors.floats, self.element.at(name)
        return read(index, kinds, user, self.rows, self.decoded.get(name))

    def stored(self, name: str, *kinds: str) -> NDArray[Any] | None:
        """Return the finite numbers of all vertices as in the file, without copying them.

        None if the attribute is missing, or if its data must be decoded or corrected; see
        ``floats``.
        """
        index = self.accessor(name)
        if index < 0 or name in self.decoded:
            return None
        values = self.document.accessors.stored(index, kinds, self.element.at(name))
        return values if values is not None and _is_finite(values) else None

    def fractions(self, name: str, *kinds: str) -> Floats | None:
        """Return an attribute of normalised integers; shape and errors as for ``floats``."""
        index = self.accessor(name)
        if index < 0:
            return None
        read, user = self.document.accessors.fractions, self.element.at(name)
        return read(index, kinds, user, self.rows, self.decoded.get(name))

    def integers(self, name: str, *kinds: str) -> NDArray[np.int64] | None:
        """Return an attribute of whole numbers; shape and errors as for ``floats``."""
        index = self.accessor(name)
        if index < 0:
            return None
        read, user = self.document.accessors.integers, self.element.at(name)
        return read(index, kinds, user, self.rows, self.decoded.get(name))

    def sets(self, name: str) -> list[int]:
        """Return the set numbers of attributes such as ``TEXCOORD_0``, in ascending order."""
        found = (_NUMBERED.fullmatch(key) for key in self.element.values)
        return sorted(int(match[2]) for match in found if match and match[1] == name)

    def vertex(self, row: int) -> int:
        """Return the index in the file of a vertex that was read."""
        return row if self.rows is None else int(self.rows[row])

    def finite(self, name: str, values: Floats) -> Floats:
        """Return values with non-finite ones set to 0 and a warning recorded."""
        bad = _not_finite(values)
        if not bad.any():
            return values
        first = int(bad.argmax())
        self.element.warn("G002.finite", name, n=int(bad.sum()), vertex=self.vertex(first))
        return np.where(bad[:, None], 0.0, values)


def read_positions(attributes: Attributes) -> Floats:
    """Return the positions: (V, 3).

    Raises
    ------
    FormatError
        If the positions are missing, malformed or not finite.
    """
    positions = attributes.floats("POSITION", "VEC3")
    if positions is None:
        raise attributes.element.wrong("POSITION", "the index of an accessor")
    bad = _not_finite(positions)
    if bad.any():
        vertex, pointer = attributes.vertex(int(bad.argmax())), attributes.element.at("POSITION")
        source, n = attributes.element.source, int(bad.sum())
        source.refuse("F003.gltf-positions", pointer, n=n, vertex=vertex)
        positions = np.where(bad[:, None], 0.0, positions)
    return positions


def read_normals(attributes: Attributes) -> Floats | None:
    """Return the normals: (V, 3); None if there are none."""
    normals = attributes.floats("NORMAL", "VEC3")
    return None if normals is None else attributes.finite("NORMAL", normals)


def tangents_of(attributes: Attributes) -> Callable[[], Floats | None] | None:
    """Return a function that reads the tangents, (V, 4); None if there are none.

    They are not drawn, but written back. The function returns None if they are invalid.
    """
    if not attributes.element.has("TANGENT"):
        return None

    def read() -> Floats | None:
        try:
            rows = attributes.floats("TANGENT", "VEC4")
        except FormatError:  # lint reports it
            return None
        return None if rows is None or _not_finite(rows).any() else rows

    return read


def read_uvs(attributes: Attributes) -> tuple[Floats, ...]:
    """Return the texture coordinates, each (V, 2), with v = 0 at the bottom row of an image."""
    numbers = [number for number in attributes.sets("TEXCOORD") if number < _MOST_UVS]
    found = []
    for number in range(max(numbers, default=-1) + 1):
        name = f"TEXCOORD_{number}"
        uvs = attributes.floats(name, "VEC2")
        if uvs is None:
            # Materials refer to sets by number, so gaps in the numbers are preserved.
            uvs = np.zeros((attributes.n_rows, 2))
        uvs = attributes.finite(name, uvs)
        found.append(np.column_stack([uvs[:, 0], 1.0 - uvs[:, 1]]))
    return tuple(found)


def read_colors(attributes: Attributes) -> Floats | None:
    """Return the vertex colours, linear with opacity: (V, 4); None if there are none."""
    colors = attributes.fractions("COLOR_0", "VEC3", "VEC4")
    if colors is None:
        return None
    colors = attributes.finite("COLOR_0", colors)
    if colors.shape[1] == 4:
        return colors
    return np.column_stack([colors, np.ones(len(colors))])


def _is_finite(values: NDArray[Any]) -> bool:
    """Return whether all numbers are finite and the sum of their squares does not overflow."""
    flat = values.ravel()
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(np.dot(flat, flat)))


def _not_finite(values: Floats) -> Bools:
    """Return a mask of the rows that are not finite: (V,)."""
    # The sum is quick to compute; rows are tested only if it is not finite.
    with np.errstate(invalid="ignore"):
        if np.isfinite(values.sum()):
            return np.zeros(len(values), dtype=np.bool_)
    return np.asarray(~np.isfinite(values).all(axis=1))
