"""Accessors of a glTF document: typed arrays in buffer views, with sparse replacements."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.formats.gltf.buffers import Buffers, View
from viewer.formats.gltf.elements import Element, Table
from viewer.phrases import counted, one_of
from viewer.rigs.arrays import Floats, Ints

_COMPONENTS: dict[int, np.dtype[np.number]] = {
    5120: np.dtype("<i1"),
    5121: np.dtype("<u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    5125: np.dtype("<u4"),
    5126: np.dtype("<f4"),
}

# Columns and rows; a vector is one column.
_TYPES = {
    "SCALAR": (1, 1),
    "VEC2": (1, 2),
    "VEC3": (1, 3),
    "VEC4": (1, 4),
    "MAT2": (2, 2),
    "MAT3": (3, 3),
    "MAT4": (4, 4),
}
_INDEX_TYPES = (5121, 5123, 5125)


@dataclass(frozen=True, slots=True)
class _Layout:
    """Layout of an accessor's elements: type, component type and position in the buffer."""

    element: Element
    kind: str
    dtype: np.dtype[np.number]
    count: int
    is_normalized: bool

    @property
    def columns(self) -> tuple[int, int]:
        """Number of columns, and of components per column."""
        return _TYPES[self.kind]

    @property
    def column_size(self) -> int:
        """Bytes from one column of a matrix to the next; columns are aligned to 4 bytes."""
        n_columns, n_rows = self.columns
        size = n_rows * self.dtype.itemsize
        return size if n_columns == 1 else size + -size % 4

    @property
    def size(self) -> int:
        """Bytes of one element, including padding."""
        return self.columns[0] * self.column_size

    @property
    def extent(self) -> int:
        """Bytes of one element, excluding padding after its last column."""
        n_columns, n_rows = self.columns
        return (n_columns - 1) * self.column_size + n_rows * self.dtype.itemsize

    @property
    def width(self) -> int:
        """Components of one element."""
        n_columns, n_rows = self.columns
        return n_columns * n_rows


class Accessors:
    """Arrays of a document; ``spend`` counts the bytes that are about to be decoded."""

    def __init__(self, table: Table, buffers: Buffers, spend: Callable[[int, str], None]) -> None:
        self._table, self._buffers, self._spend = table, buffers, spend

    def __len__(self) -> int:
        return len(self._table)

    def __getitem__(self, index: int) -> Element:
        """Return the JSON object of an accessor."""
        return self._table[index]

    def count(self, index: int) -> int:
        """Return the number of elements that an accessor declares."""
        return self._table[index].whole("count")

    def floats(
        self,
        index: int,
        kinds: Sequence[str],
        user: str,
        rows: Ints | None = None,
        decoded: NDArray[np.number] | None = None,
    ) -> Floats:
        """Return an accessor as numbers (N, C), possibly infinite or NaN, or its ``rows`` (M, C).

        Normalised integers become fractions; the components of a matrix are in column order.
        ``kinds`` are the expected types, such as ``"VEC3"``; ``decoded`` (N, C), already decoded
        components, replaces the buffer view.
        """
        layout = self._layout(index, kinds, user)
        values = self._picked(layout, rows, decoded)
        if layout.is_normalized and values.dtype.kind != "f":
            # The lowest signed integer is clamped to -1 (glTF 2.0, 3.6.2.2).
            return np.maximum(values / np.iinfo(values.dtype.str).max, -1.0)
        with np.errstate(invalid="ignore"):  # signalling NaNs
            return values.astype(np.float64)

    def stored(self, index: int, kinds: Sequence[str], user: str) -> NDArray[np.number] | None:
        """Return float32 numbers (N, C) as in the file, not copied; None for any other storage."""
        layout = self._layout(index, kinds, user)
        is_plain = layout.element.has("bufferView") and not layout.element.has("sparse")
        return self._values(layout) if is_plain and layout.dtype.kind == "f" else None

    def fractions(
        self,
        index: int,
        kinds: Sequence[str],
        user: str,
        rows: Ints | None = None,
        decoded: NDArray[np.number] | None = None,
    ) -> Floats:
        """Return an accessor like ``floats``; integers must be normalised, or cause a warning."""
        values = self.floats(index, kinds, user, rows, decoded)
        layout = self._layout(index, kinds, user)
        if layout.is_normalized or layout.dtype.kind == "f":
            return values
        layout.element.warn(
            "G002.normalized: expected normalised integers, found none marked as normalised: "
            "normalised"
        )
        return np.maximum(values / np.iinfo(layout.dtype.str).max, -1.0)

    def integers(
        self,
        index: int,
        kinds: Sequence[str],
        user: str,
        rows: Ints | None = None,
        decoded: NDArray[np.number] | None = None,
    ) -> NDArray[np.int64]:
        """Return an accessor like ``floats``, as whole numbers (N, C) or (M, C)."""
        layout = self._layout(index, kinds, user)
        if layout.dtype.kind == "f" or layout.is_normalized:
            found = "normalised integers" if layout.is_normalized else "floating-point numbers"
            source = layout.element.source
            raise source.fault(
                "F002.gltf-whole: expected whole numbers, found {found} in accessor {accessor}",
                user,
                found=found,
                accessor=index,
            )
        return self._picked(layout, rows, decoded).astype(np.int64)

    def components(self, index: int) -> Floats | None:
        """Return components as stored (N, C), not normalised; None if compressed with Draco."""
        if not self._table[index].has("bufferView") and not self._table[index].has("sparse"):
            return None
        pointer = self._table[index].pointer
        layout = self._layout(index, tuple(_TYPES), pointer)
        values = self._picked(layout, None, None)
        size = values.itemsize if not layout.element.has("bufferView") else 0
        self._spend(-values.size * (8 + size), pointer)
        with np.errstate(invalid="ignore"):  # signalling NaN
            return values.astype(np.float64)

    def matrices(self, index: int, user: str) -> Floats:
        """Return MAT4 elements as matrices (N, 4, 4) with the translation in the last column."""
        columns = self.floats(index, ("MAT4",), user).reshape(-1, 4, 4)
        return np.ascontiguousarray(columns.transpose(0, 2, 1))

    def _picked(
        self, layout: _Layout, rows: Ints | None, decoded: NDArray[np.number] | None
    ) -> NDArray[np.number]:
        if decoded is None:
            values = self._values(layout)
        elif decoded.shape[1] == layout.width:
            values = decoded.astype(layout.dtype)
        else:
            raise layout.element.fault(
                "F002.gltf-decoded-width: expected {expected}, found {found} in compressed data",
                expected=counted(layout.width, "component"),
                found=decoded.shape[1],
            )
        if rows is not None:
            values = values[rows]
        # Computations use double precision.
        self._spend(values.size * 8, layout.element.pointer)
        return values

    def _layout(self, index: int, kinds: Sequence[str], user: str) -> _Layout:
        element = self._table[index]
        kind = element.choice("type", tuple(_TYPES))
        code = element.choice("componentType", tuple(_COMPONENTS))
        if kind not in kinds:
            raise element.source.fault(
                "F002.gltf-kind: expected {wanted}, found {found} in accessor {accessor}",
                user,
                wanted=one_of(list(kinds)),
                found=kind,
                accessor=index,
            )
        normalized = element.flag("normalized")
        return _Layout(element, kind, _COMPONENTS[code], element.whole("count"), normalized)

    def _values(self, layout: _Layout) -> NDArray[np.number]:
        element = layout.element
        place = element.index("bufferView", self._buffers.n_views, "bufferViews")
        if place < 0:
            self._spend(layout.count * layout.width * layout.dtype.itemsize, element.pointer)
            values = np.zeros((layout.count, layout.width), layout.dtype)
        else:
            view = self._buffers.view(place)
            values = _elements(view, layout, element, element.whole("byteOffset", 0))
        sparse = element.part("sparse")
        return values if sparse is None else self._replaced(values, layout, sparse)

    def _replaced(
        self, values: NDArray[np.number], layout: _Layout, sparse: Element
    ) -> NDArray[np.number]:
        """Return values in which the elements listed by a sparse accessor are replaced."""
        count = sparse.whole("count")
        if count > layout.count:
            raise sparse.fault(
                "F002.gltf-sparse: expected at most {most} replaced elements, found {found}",
                "count",
                most=layout.count,
                found=count,
            )
        items = sparse.part("indices")
        if items is None:
            raise sparse.wrong("indices", "an object")
        code = items.choice("componentType", _INDEX_TYPES)
        packed = _Layout(items, "SCALAR", _COMPONENTS[code], count, False)
        view = self._sparse_view(items)
        indices = _elements(view, packed, items, items.whole("byteOffset", 0))[:, 0]
        if count and int(indices.max()) >= layout.count:
            first = int((indices >= layout.count).argmax())
            raise items.fault(
                "F002.gltf-sparse-index: entry {entry}: expected an index below {count}, found "
                "{found}",
                count=layout.count,
                entry=first,
                found=int(indices[first]),
            )
        if (indices[1:] <= indices[:-1]).any():
            items.warn("G002.sparse-order: sparse indices are not in increasing order")
        items = sparse.part("values")
        if items is None:
            raise sparse.wrong("values", "an object")
        view = self._sparse_view(items)
        packed = _Layout(layout.element, layout.kind, layout.dtype, count, False)
        result = values.copy()
        result[indices] = _elements(view, packed, items, items.whole("byteOffset", 0))
        return result

    def _sparse_view(self, items: Element) -> View:
        place = items.required_index("bufferView", self._buffers.n_views, "bufferViews")
        return self._buffers.view(place)


def _elements(view: View, layout: _Layout, element: Element, offset: int) -> NDArray[np.number]:
    """Return the elements in a buffer view, column by column: (N, C); a view if possible."""
    size = layout.size
    stride = view.stride or size
    if stride < size:
        raise element.fault(
            "F002.gltf-stride: expected a stride of at least {expected} bytes, found {found}",
            expected=size,
            found=stride,
        )
    needed = offset + stride * (layout.count - 1) + layout.extent if layout.count else 0
    if needed > len(view.data):
        raise element.fault(
            "F002.gltf-accessor: {count}: expected {expected} in the buffer view, found {found}",
            count=counted(layout.count, "element"),
            expected=counted(needed, "byte"),
            found=len(view.data),
        )
    unit = layout.dtype.itemsize
    if (view.offset + offset) % unit or stride % unit:
        element.warn(
            "G002.alignment: components of {size} bytes are misaligned: at {at}, stride {stride}",
            size=unit,
            at=view.offset + offset,
            stride=stride,
        )
    shape = (layout.count, *layout.columns)
    strides = (stride, layout.column_size, unit)
    if not layout.count:
        return np.zeros((0, layout.width), layout.dtype)
    values = np.ndarray(shape, layout.dtype, view.data.data, offset, strides)
    return values.reshape(layout.count, layout.width)
