"""Archives of named arrays: pickles, ``.npz`` and ``.npy``, read without executing code in them.

A pickle is a program, and so is an object array inside an ``.npz``. Neither can import or call
anything: ``_pickle/`` supports the names needed for arrays and plain data, and rejects all others.
All other values are returned as ``Opaque``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Part, Phrase, wording
from viewer.errors import FormatError
from viewer.formats._source import InvalidValueError, Source
from viewer.formats._text.json_places import Keys, nearest_place
from viewer.phrases import axes, counted, printable
from viewer.rigs.arrays import Deferred, deferred

_WANTED = {"biuf": "number", "iuf": "number", "iu": "integer", "SU": "string"}
"""Names of the elements of arrays, by numpy's kind letters."""
_DTYPE = re.compile(r"[<>=|]?(?:b1|[iu][1248]|f[248]|[SU]([1-9][0-9]{0,6}))")
_MAX_SIDE = 1 << 27  # maximum rows or columns of a sparse matrix; meshes have far fewer vertices
_MAX_AXES = 32
_LONGEST_TEXT = 1 << 20  # maximum number of characters in one element
# Maximum size of an array; numpy has no larger ones, even if an axis is 0.
_MAX_BYTES = 1 << 60
_LAST_LETTER = 0x10FFFF  # last code point of Unicode; numpy stores 4 bytes without checking them


@dataclass(frozen=True, slots=True)
class Opaque:
    """A value that was not evaluated because that could run code, or because it is not needed."""

    what: Phrase
    """Description for messages: ``chumpy.ch_ops.add expression``, ``object array``."""


@dataclass(frozen=True, slots=True, eq=False)
class Sparse:
    """A checked sparse matrix in compressed columns ("csc"), rows ("csr") or as entries ("coo")."""

    shape: tuple[int, int]
    """Rows and columns as the file declares them, to be checked before a dense matrix is made."""
    data: NDArray[np.generic]
    indices: NDArray[np.integer]
    """(N,): stored values, and the row (csc, coo) or column (csr) of each."""
    indptr: NDArray[np.integer]
    """Starts of the columns (csc) or rows (csr) in ``data`` and the end of the last: (columns + 1,)
    or (rows + 1,). The column of each value (coo): (N,)."""
    layout: str
    """``"csc"``, ``"csr"`` or ``"coo"``."""

    def __post_init__(self) -> None:
        parts = (self.data, self.indices, self.indptr)
        if any(part.ndim != 1 for part in parts) or self.data.dtype.kind not in "biuf":
            raise InvalidValueError(
                "data, indices and index pointers of a sparse matrix must be one-dimensional"
            )
        if self.indices.dtype.kind not in "iu" or self.indptr.dtype.kind not in "iu":
            raise InvalidValueError(
                "expected integer indices in a sparse matrix, found non-integers"
            )
        if not all(0 <= side <= _MAX_SIDE for side in self.shape):
            raise InvalidValueError(
                "expected at most {most} rows and columns, found {shape}",
                most=_MAX_SIDE,
                shape=axes(self.shape),
            )
        if self.layout == "coo":
            self._check_indices(self.indices, self.shape[0])
            self._check_indices(self.indptr, self.shape[1])
        else:
            self._check_counts()

    def _check_counts(self) -> None:
        across, along = self.shape if self.layout == "csc" else self.shape[::-1]
        if len(self.indptr) != along + 1:
            raise InvalidValueError(
                "expected {expected} index pointers in a sparse {shape} matrix, found {found}",
                expected=along + 1,
                shape=axes(self.shape),
                found=len(self.indptr),
            )
        count = len(self.data)
        # Unsigned differences wrap around, so compare instead of subtracting.
        ordered = bool((self.indptr[1:] >= self.indptr[:-1]).all())
        if not ordered or int(self.indptr[0]) != 0 or int(self.indptr[-1]) != count:
            raise InvalidValueError(
                "expected index pointers in ascending order from 0 to {count} in a sparse matrix, "
                "found them unsorted",
                count=count,
            )
        self._check_indices(self.indices, across)

    def _check_indices(self, indices: NDArray[np.integer], across: int) -> None:
        """Check the rows or columns of all stored values."""
        count = len(self.data)
        if len(indices) != count:
            raise InvalidValueError(
                "expected {expected} indices in a sparse matrix, found {found}",
                expected=count,
                found=len(indices),
            )
        if count == 0:
            return
        low, high = int(indices.min()), int(indices.max())
        if low < 0 or high >= across:
            raise InvalidValueError(
                "expected indices 0 to {last} in a sparse matrix, found {low} to {high}",
                last=across - 1,
                low=low,
                high=high,
            )

    def entries(self) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.generic]]:
        """Return row, column and value (N,) of every entry in file order; repeated ones add up."""
        starts = self.indptr.astype(np.intp)
        if self.layout == "coo":
            return self.indices.astype(np.intp), starts, self.data
        lengths = starts[1:] - starts[:-1]
        outer = np.repeat(np.arange(len(lengths)), lengths)
        inner = self.indices.astype(np.intp)
        rows, columns = (inner, outer) if self.layout == "csc" else (outer, inner)
        return rows, columns, self.data


_Plain: TypeAlias = str | bytes | int | float | bool | None
"""Values that need no conversion; numpy's scalars are returned as these."""
Value: TypeAlias = (
    "_Plain | Deferred | Sparse | Opaque | list[Value] | tuple[Value, ...]"
    " | dict[str | bytes | int, Value]"
)
"""Any value of an archive; containers contain such values in turn."""
Axes: TypeAlias = Sequence[int | str | None]
"""An expected shape: for each axis a size, None for any, or a letter for equal sizes."""


class Archive:
    """The named values of one file, each read on demand.

    ``kind``: ``"pickle"``, ``"npz"`` or ``"npy"``. ``branch``: returns the archive of a key whose
    value is a dict or a list of dicts, None for others. ``label``: path of the names in the file,
    for messages: ``"people.3."``. ``objects``: returns the objects of an array of objects as a
    list, which ``get`` does not evaluate; None for other values.
    """

    def __init__(
        self,
        source: Source,
        kind: str,
        keys: tuple[str, ...],
        load: Callable[[str], Value],
        branch: Callable[[str], Archive | None] | None = None,
        label: str = "",
        objects: Callable[[str], Value] | None = None,
        is_list: bool = False,
        path: Keys = (),
    ) -> None:
        self.source, self.kind, self.keys = source, kind, keys
        self.label, self.is_list, self.path = label, is_list, path
        self._load, self._branch, self._objects = load, branch, objects
        self._values: dict[str, Value] = {}
        self._arrays: dict[str, Deferred | None] = {}
        self._branches: dict[str, Archive | None] = {}

    def has(self, key: str) -> bool:
        """Return whether the file has a value with this name."""
        return key in self.keys

    def get(self, key: str) -> Value:
        """Return a value: arrays as ``Deferred``, what would run code as ``Opaque``."""
        if key not in self._values:
            if key not in self.keys:
                raise self.fault("F002.no-key: {item}: key not found", item=key)
            self._values[key] = self._load(key)
        return self._values[key]

    def inside(self, key: str) -> Archive | None:
        """Return a dict, or a list of dicts by index, as an archive without reading its values."""
        if key not in self._branches:
            found = self._branch(key) if self._branch is not None and key in self.keys else None
            self._branches[key] = found
        return self._branches[key]

    def unread(self) -> set[str]:
        """Return the names of values that have not been read, including those in nested dicts."""
        found = {
            key for key in self.keys if key not in self._values and not self._branches.get(key)
        }
        for branch in self._branches.values():
            found |= branch.unread() if branch is not None else set()
        return found

    def array(self, key: str, shape: Axes | None = None, kinds: str = "biuf") -> Deferred:
        """Return an array of the given shape and ``dtype.kind``, also from nested lists or objects.

        None and empty items of lists become NaN.
        """
        value = self.get(key)
        if not isinstance(value, Deferred):
            value = self._listed(key)
        if value is None or value.dtype.kind not in kinds or not _fits(shape, value.shape):
            found = describe(self.get(key))
            raise self.fault(wording.VALUE, item=key, expected=_wanted(shape, kinds), found=found)
        return _widened(value)

    def shape(self, key: str) -> tuple[int, ...]:
        """Return the shape of an array of numbers; empty if there is no such array."""
        value = self.get(key) if key in self.keys else None
        if value is not None and not isinstance(value, Deferred):
            value = self._listed(key)
        return value.shape if isinstance(value, Deferred) and value.dtype.kind in "biuf" else ()

    def _listed(self, key: str) -> Deferred | None:
        """Return numbers in nested lists, or in an array of objects, as an array."""
        if key not in self._arrays:
            self._arrays[key] = _from_lists(self.objects(key))
        return self._arrays[key]

    def sparse(self, key: str, shape: Axes | None = None) -> Sparse:
        """Return a sparse or dense matrix as sparse, its shape checked before it is allocated."""
        value = self.get(key)
        if isinstance(value, Sparse):
            if _fits(shape, value.shape):
                return replace(value, data=_in_double(value.data))
            raise self.fault(
                wording.VALUE, item=key, expected=_wanted(shape, "biuf"), found=describe(value)
            )
        dense = self.array(key, (None, None) if shape is None else shape).values()
        rows, columns = np.nonzero(dense)
        starts = np.searchsorted(rows, np.arange(len(dense) + 1))
        return Sparse(dense.shape, dense[rows, columns], columns, starts, "csr")

    def text(self, key: str) -> str:
        """Return a single string, stored as a string, bytes, or an array of one of them."""
        found = texts_in(self.objects(key))
        if len(found) != 1:
            raise self.fault(
                "F002.text: {item}: expected a string, found {found}",
                item=key,
                found=describe(self.get(key)),
            )
        return found[0]

    def objects(self, key: str) -> Value:
        """Return a value like ``get``, but an array of objects as a list of them."""
        value = self.get(key)
        if isinstance(value, Opaque) and self._objects is not None:
            value = self._objects(key)
        return value

    def plain_text(self, key: str) -> str:
        """Return a single string, including bytes converted by ``str``; empty if there is none."""
        if not self.has(key):
            return ""
        try:
            text = self.text(key)
        except FormatError:
            return ""
        return text[2:-1] if text.startswith("b'") and text.endswith("'") else text

    def refuse(
        self,
        key: str,
        *,
        item: str,
        count: int = 1,
        part: Part = "",
        places: ArrayLike | None = None,
        **values: object,
    ) -> None:
        """Record an error in the value called ``item``; see ``Source.refuse``."""
        offset, item = self._offset(item), printable(self.label + item, 60)
        self.source.refuse(key, offset, count, part, places, item=item, **values)

    def leave_gap(self, key: str, *, item: str, **values: object) -> None:
        """Record an error in frames of ``item``, which become gaps; only the first is reported."""
        if not self.source.frame_faults:
            self.source.frame_faults.append(self.fault(key, item=item, **values).diagnostic)

    def fault(self, key: str, *, item: str, **values: object) -> FormatError:
        """Return the exception for an error in the value called ``item``; see ``Source.fault``."""
        offset, item = self._offset(item), printable(self.label + item, 60)
        return self.source.fault(key, offset, item=item, **values)

    def _offset(self, item: str) -> int | None:
        """Return the offset of a value in a JSON file, or of the dict that lacks it."""
        if self.kind != "json":
            return None
        text = self.source.data.decode("utf-8", "replace")
        place = nearest_place(text, (*self.path, int(item) if self.is_list else item))
        return None if place is None else len(text[:place].encode())


def describe(value: object) -> Phrase:
    """Return a description of a value for messages, such as ``800 x 3 float32``."""
    if isinstance(value, Deferred):
        if value.dtype.kind not in "SU":
            return Phrase("{shape} {dtype}", shape=axes(value.shape), dtype=value.dtype.name)
        return (
            Phrase("{shape} strings", shape=axes(value.shape))
            if value.shape
            else Phrase("a string")
        )
    if isinstance(value, Sparse):
        return Phrase("a sparse {shape} matrix", shape=axes(value.shape))
    if isinstance(value, Opaque):
        return Phrase("an unsupported value ({what})", what=value.what)
    if isinstance(value, list | tuple):
        return Phrase("a list of length {n}", n=len(value)) if value else Phrase("an empty list")
    if isinstance(value, dict):
        return (
            Phrase("a dict of {n}", n=counted(len(value), "value"))
            if value
            else Phrase("an empty dict")
        )
    if isinstance(value, bytes):
        return Phrase("{n} bytes", n=len(value))
    if value is None:
        return Phrase("None")
    return Phrase("{value}", value=printable(repr(value), 40))


def texts_in(value: Value) -> list[str]:
    """Return the strings in a value and its nested lists; empty if it has anything else."""
    if isinstance(value, Deferred) and value.dtype.kind in "SU":
        value = value.values().ravel().tolist()
    if isinstance(value, bytes):
        return [value.decode("utf-8", "replace")]
    if isinstance(value, str):
        return [value]
    items = [texts_in(item) for item in value] if isinstance(value, list | tuple) else []
    return [text for item in items for text in item] if all(items) else []


def _wanted(shape: Axes | None, kinds: str) -> Phrase:
    if kinds not in _WANTED:
        return Phrase("{shape} values of kind {kinds}", shape=axes(tuple(shape or ())), kinds=kinds)
    noun = _WANTED[kinds]
    if shape is None:
        return Phrase(f"an array of {noun}s")
    return (
        Phrase(f"{{shape}} {noun}s", shape=axes(tuple(shape)))
        if shape
        else Phrase(f"a single {noun}")
    )


def _fits(wanted: Axes | None, found: tuple[int, ...]) -> bool:
    if wanted is None:
        return True
    named: dict[str, int] = {}
    return len(wanted) == len(found) and all(
        axis is None or (named.setdefault(axis, size) if isinstance(axis, str) else axis) == size
        for axis, size in zip(wanted, found, strict=True)
    )


def _from_lists(value: Value) -> Deferred | None:
    """Return numbers or arrays in nested lists as an array; None if they are ragged or others."""
    try:
        items = _plain(value)
        if isinstance(items, list):
            usual = [item for item in items if not _is_missing(item)]
            if usual and len(usual) < len(items):
                missing = np.full(np.array(usual[0]).shape, np.nan)
                items = [missing if _is_missing(item) else item for item in items]
        array = np.array(items)
    except (ValueError, TypeError, OverflowError):
        return None
    if array.dtype.kind not in "biuf":
        return None
    return deferred(array)


_Numbers: TypeAlias = "list[_Numbers] | NDArray[np.generic] | float | None"


def _plain(value: Value, is_item: bool = False) -> _Numbers:
    """Return nested lists of numbers and arrays; raise ValueError for other values."""
    if isinstance(value, list | tuple):
        return [_plain(item, not is_item) for item in value]
    if isinstance(value, Deferred) and value.dtype.kind in "biuf":
        return value.values()
    if isinstance(value, int | float) or (value is None and is_item):
        return value
    raise ValueError(value)


def _is_missing(item: object) -> bool:
    """Return whether an item of a list stands for a missing frame."""
    return item is None or (isinstance(item, list) and not item)


def _widened(array: Deferred) -> Deferred:
    """Return an array whose half floats become doubles before anything overflows at 65504."""
    if array.dtype != np.float16:
        return array
    return Deferred(array.shape, np.float64, lambda: _in_double(array.values()))


def _in_double(values: NDArray[np.generic]) -> NDArray[np.generic]:
    """Return half floats as doubles, which is exact, and other values unchanged."""
    return values.astype(np.float64) if values.dtype == np.float16 else values


def array_dtype(code: str) -> np.dtype[np.generic] | None:
    """Return a numeric or string dtype by its numpy spelling; None for all others.

    >>> array_dtype(">f4"), array_dtype("|O"), array_dtype("S0")
    (dtype('>f4'), None, None)
    """
    match = _DTYPE.fullmatch(code)
    if match is None or int(match[1] or 1) > _LONGEST_TEXT:
        return None
    return np.dtype(code)


def item_count(shape: tuple[int, ...], item_size: int) -> int | None:
    """Return the number of elements of a shape, or None if numpy does not support it.

    >>> item_count((6890, 3), 8), item_count((0, 1 << 62), 8)
    (20670, None)
    """
    # An axis of length 0 makes the product 0 even if other axes are too long.
    if (
        len(shape) > _MAX_AXES
        or math.prod(max(side, 1) for side in shape) > _MAX_BYTES // item_size
    ):
        return None
    return math.prod(shape)


def shaped(
    flat: NDArray[np.generic], shape: tuple[int, ...], is_fortran: bool
) -> NDArray[np.generic]:
    """Return flat values in their shape, C order and native byte order; copied if needed."""
    if flat.dtype.kind == "b" and flat.size and int(flat.view(np.uint8).max()) > 1:
        # numpy accepts any byte as bool, and then computes wrong results.
        flat = flat.view(np.uint8) != 0
    array = flat.reshape(shape, order="F" if is_fortran else "C")
    array = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("=")).reshape(shape)
    if array.dtype.kind == "U" and array.size:
        last = int(array.reshape(-1).view(np.uint32).max())
        if last > _LAST_LETTER:
            raise InvalidValueError("invalid Unicode code point {found} in a string", found=last)
    return array
