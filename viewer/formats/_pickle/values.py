"""Inert values on the stack of the pickle machine that represent classes and objects.

Numbers, None, lists, tuples and dicts are plain Python objects. Everything that a pickle names is
an instance of a class in this module, created for each file, so that no pickle can affect another.
"""

from __future__ import annotations

import codecs
import io
from collections.abc import Callable
from dataclasses import field
from functools import partial
from typing import TypeGuard

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase
from viewer.formats._archive.values import array_dtype, item_count, shaped
from viewer.formats._archive.zip import Data
from viewer.formats._source import InvalidValueError
from viewer.phrases import axes
from viewer.rigs.arrays import Deferred

_MOST_AXES = 32
_PIECE = 1 << 20  # number of bytes converted at a time
_LONGEST_SIDE = 1 << 62  # maximum length of an axis, so that products of sizes can be printed


class Span:
    """Bytes or a string in the file, copied only on demand.

    ``data``: the file, or bytes decoded from it. ``start``, ``stop``: the range of the bytes.
    ``coding``: encoding of a string. ``"latin-1"`` marks a string of Python 2, which may be text or
    bytes.
    """

    __slots__ = ("_packed", "_text", "coding", "data", "start", "stop")

    def __init__(self, data: Data, start: int, stop: int, coding: str | None = None) -> None:
        self.data, self.start, self.stop, self.coding = data, start, stop, coding
        self._text: str | None = None
        self._packed: Span | None = None

    def __len__(self) -> int:
        return self.stop - self.start

    def raw(self) -> bytes:
        """Return a copy of the bytes."""
        return self.data[self.start : self.stop]

    def view(self) -> memoryview:
        """Return the bytes, without copying them if they are in memory."""
        if isinstance(self.data, bytes):
            return memoryview(self.data)[self.start : self.stop]
        return memoryview(self.raw())

    def text(self) -> str:
        """Return the string, which is decoded only once; ValueError if that is impossible."""
        if self._text is None:
            self._text = self._decoded()
        return self._text

    def packed(self) -> Span:
        """Return the bytes of an array, which Python 3 may write as characters 0 to 255."""
        if self.coding in (None, "latin-1"):
            return self
        if self._packed is None:
            data = self._recoded()
            self._packed = Span(data, 0, len(data))
        return self._packed

    def _recoded(self) -> bytes:
        """Return the characters as bytes; decoding in pieces avoids doubling the memory."""
        decoder = codecs.getincrementaldecoder(self.coding or "latin-1")()
        packed = io.BytesIO()
        for start in range(self.start, self.stop, _PIECE):
            stop = min(start + _PIECE, self.stop)
            letters = decoder.decode(self.data[start:stop], stop == self.stop)
            packed.write(letters.encode("latin-1"))
        return packed.getvalue()

    def _decoded(self) -> str:
        errors = "surrogatepass" if self.coding == "utf-8" else "strict"
        return self.raw().decode(self.coding or "latin-1", errors)


@dataclass(slots=True, eq=False)
class StandIn:
    """An inert stand-in for a class or function in the table of allowed names."""

    name: str  # name for messages, such as "scipy.sparse.csc.csc_matrix"
    role: str


@dataclass(slots=True, eq=False)
class Instance:
    """An object of one of the classes, with its state from the pickle."""

    of: StandIn
    state: dict[str | bytes | int, object] | None = None


@dataclass(slots=True, eq=False)
class Dtype:
    """A numpy element type: kind and size, and the byte order."""

    code: str
    order: str = "="

    def dtype(self) -> np.dtype[np.generic] | None:
        """Return numpy's type, or None if its elements are neither numbers nor strings."""
        return array_dtype(self.order + self.code)

    def what(self) -> Phrase:
        """Return the reason why it is not evaluated."""
        known = {"O": Phrase("object array"), "V": Phrase("structured array")}
        return known.get(self.code[:1]) or Phrase("array of type {dtype}", dtype=self.code[:20])


@dataclass(slots=True, eq=False)
class Array:
    """A numpy array whose values stay in the file until they are needed."""

    shape: tuple[int, ...] = ()
    """Shape of the stored values."""
    dtype: np.dtype[np.generic] | None = None
    """Element type; None if the array is not evaluated, with the reason in ``what``."""
    payload: Span | None = None
    is_fortran: bool = False
    axes: tuple[int, ...] | None = None
    """Order of the stored axes in the array."""
    items: list[object] | None = None
    """Objects of an object array, which is not evaluated otherwise."""
    what: Phrase = field(default_factory=lambda: Phrase("uninitialised array"))

    def fill(self, shape: tuple[int, ...], dtype: Dtype, is_fortran: bool, payload: Span) -> None:
        """Set shape and values, whose sizes in bytes must agree."""
        found = dtype.dtype()
        if found is None:
            self.what = dtype.what()
            return
        packed = payload.packed()
        n_items = item_count(shape, found.itemsize)
        if n_items is None or n_items * found.itemsize != len(packed):
            size = len(packed)
            raise InvalidValueError(
                "expected {shape} {dtype}, found {found} bytes",
                shape=axes(shape),
                dtype=found.name,
                found=size,
            )
        self.shape, self.dtype, self.payload = shape, found, packed
        self.is_fortran = is_fortran

    def deferred(self, fail: Callable[[Phrase], Exception]) -> Deferred | None:
        """Return the deferred array, or None if it is not evaluated."""
        if self.dtype is None or self.payload is None:
            return None
        shape = self.shape
        if self.axes is not None:
            shape = tuple(shape[axis] for axis in self.axes)
        return Deferred(shape, self.dtype.newbyteorder("="), partial(self._load, fail))

    def values(self) -> NDArray[np.generic]:
        """Return the values, as a view of the file if byte and memory order allow it."""
        if self.payload is None or self.dtype is None:
            raise InvalidValueError("expected an array of numbers, found {found}", found=self.what)
        flat = np.empty(0, self.dtype)
        if len(self.payload):  # numpy cannot create a view of zero bytes
            n_items = len(self.payload) // self.dtype.itemsize
            payload = self.payload
            if isinstance(payload.data, bytes):
                flat = np.frombuffer(payload.data, self.dtype, n_items, payload.start)
            else:
                flat = np.frombuffer(payload.raw(), self.dtype, n_items)
        array = shaped(flat, self.shape, self.is_fortran)
        return array if self.axes is None else np.ascontiguousarray(array.transpose(self.axes))

    def _load(self, fail: Callable[[Phrase], Exception]) -> NDArray[np.generic]:
        try:
            return self.values()
        except InvalidValueError as problem:
            raise fail(problem.problem) from None


def is_sizes(value: object) -> TypeGuard[tuple[int, ...]]:
    """Return whether a value is a valid shape of an array."""
    return (
        isinstance(value, tuple)
        and len(value) <= _MOST_AXES
        and all(type(side) is int and 0 <= side < _LONGEST_SIDE for side in value)
    )


def noun(value: object) -> Phrase:
    """Return a description of a value on the stack for messages: ``a list``, ``numpy.ndarray``."""
    if isinstance(value, StandIn):
        return Phrase("{name}", name=value.name)
    if isinstance(value, Instance):
        return Phrase("an instance of {name}", name=value.of.name)
    if isinstance(value, Span):
        return Phrase("bytes") if value.coding is None else Phrase("a string")
    if isinstance(value, bool | int | float):
        return Phrase("a number")
    if value is None:
        return Phrase("None")
    if isinstance(value, Array):
        return Phrase("an array")
    return Phrase("a {kind}", kind=type(value).__name__.lower())
