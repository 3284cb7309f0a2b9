"""Conversion of the values that a pickle builds to those of an archive, one key at a time.

Values are converted on demand, so a key that is not needed costs nothing and cannot invalidate the
others. Shared and self-containing values are traversed within limits of budget and depth.
"""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Diagnostic, Phrase
from viewer.errors import FormatError
from viewer.formats._archive.values import Opaque, Sparse, Value
from viewer.formats._misfit import MisfitError
from viewer.formats._pickle.names import SPARSE
from viewer.formats._pickle.tensors import Storage, Tensor
from viewer.formats._pickle.values import Array, Dtype, Instance, Span, StandIn, is_sizes
from viewer.phrases import printable
from viewer.rig.arrays import Deferred

__all__ = ["resolve"]

_DEEPEST = 32  # maximum depth of nested containers
_DEEPEST_EXPRESSION = 8  # maximum depth of nested expressions; a released model has two levels
_SMALLEST_BUDGET = 1000
_NUMBERS = "biuf"


class _EndlessError(Exception):
    """A value that contains itself, or expands far beyond the size of its file."""


def resolve(path: Path, size: int, key: str, value: object) -> Value:
    """Return a value of the pickle as specified by ``Archive.get``.

    Parameters
    ----------
    path : Path
        The file, for messages.
    size : int
        Length of the file in bytes; without shared values, no value can have more items.
    key : str
        The name of the value, for messages.
    value : object
        Value built by the machine.

    Raises
    ------
    FormatError
        If an array, matrix or expression is inconsistent, or a string cannot be decoded.
    """
    try:
        return _Resolver(path, key, max(size, _SMALLEST_BUDGET)).value(value, 0)
    except _EndlessError:
        return Opaque(Phrase("unread-endless"))


class _Resolver:
    def __init__(self, path: Path, key: str, budget: int) -> None:
        self.path, self.key, self.budget = path, key, budget

    def fail(self, problem: Phrase) -> FormatError:
        values = {"item": printable(self.key, 60), "problem": problem}
        return FormatError(Diagnostic("F002.archive-value", self.path, values=values))

    def value(self, value: object, depth: int) -> Value:
        self.budget -= 1
        if depth > _DEEPEST or self.budget < 0:
            raise _EndlessError
        if value is None or isinstance(value, bool | int | float | Opaque | str | bytes):
            return value
        if isinstance(value, list):
            return [self.value(item, depth + 1) for item in value]
        if isinstance(value, tuple):
            return tuple(self.value(item, depth + 1) for item in value)
        if isinstance(value, dict):
            return {key: self.value(item, depth + 1) for key, item in value.items()}
        if isinstance(value, Span):
            return self.text(value)
        return self.thing(value)

    def text(self, span: Span) -> str | bytes:
        if span.coding is None:
            self.budget -= len(span)  # bytes are copied for each use, whereas a string is shared
            return span.raw() if self.budget >= 0 else b""
        try:
            return span.text()
        except UnicodeError:
            raise self.fail(Phrase("pickle-bytes")) from None

    def thing(self, value: object) -> Deferred | Sparse | Opaque:
        if isinstance(value, Array):
            return value.deferred(self.fail) or Opaque(value.what)
        if isinstance(value, Tensor):
            return value.deferred(self.fail)
        if isinstance(value, Storage):
            return Opaque(Phrase("unread-storage"))
        if isinstance(value, Instance) and value.of.role == "joblib":
            return Opaque(Phrase("unread-name", name=value.of.name))
        if isinstance(value, Instance) and value.of.role in SPARSE:
            return self.sparse(value)
        if isinstance(value, Instance):
            return self.expression(value, 0)
        if isinstance(value, StandIn | Dtype):
            if isinstance(value, Dtype):
                return Opaque(Phrase("unread-element-type"))
            return Opaque(Phrase("unread-name", name=value.name))
        raise self.fail(Phrase("pickle-other"))

    def sparse(self, matrix: Instance) -> Sparse:
        state = matrix.state or {}
        shape = state.get("_shape", state.get("shape"))
        if not is_sizes(shape) or len(shape) != 2:
            raise self.fail(Phrase("sparse-no-shape"))
        names = ("row", "col") if matrix.of.role == "coo" else ("indices", "indptr")
        coordinates = state.get("coords")  # rows and columns, since SciPy 1.13
        if names[0] == "row" and isinstance(coordinates, tuple) and len(coordinates) == 2:
            state = {**state, **dict(zip(names, coordinates, strict=True))}
        data, indices, indptr = (self.part(state, name) for name in ("data", *names))
        try:
            return Sparse((shape[0], shape[1]), data, indices, indptr, matrix.of.role)
        except MisfitError as problem:
            raise self.fail(problem.problem) from None

    def part(self, state: dict[str | bytes | int, object], name: str) -> NDArray[Any]:
        array = state.get(name)
        later = array.deferred(self.fail) if isinstance(array, Array) else None
        if later is None:
            raise self.fail(Phrase("sparse-no-part", part=name))
        return later.values()

    def expression(self, value: Instance, depth: int) -> Deferred | Opaque:
        """Return the array that a chumpy object represents, if it is known without evaluation."""
        state = value.state or {}
        name = value.of.name
        if depth > _DEEPEST_EXPRESSION:
            return Opaque(Phrase("unread-expression-endless", name=name))
        if value.of.role == "expression":
            return Opaque(Phrase("unread-expression", name=name))
        inner = state.get("x" if value.of.role == "Ch" else "a")
        if isinstance(inner, Instance) and inner.of.role not in SPARSE:
            found: Deferred | Opaque = self.expression(inner, depth + 1)
        elif isinstance(inner, Array):
            found = inner.deferred(self.fail) or Opaque(inner.what)
        elif isinstance(inner, float):
            number = np.array(inner)
            found = Deferred((), number.dtype, lambda: number)
        else:
            found = Opaque(Phrase("unread-chumpy", name=name))
        if isinstance(found, Opaque) or value.of.role == "Ch":
            return found
        return self.selection(state, found, name)

    def selection(
        self, state: dict[str | bytes | int, object], whole: Deferred, name: str
    ) -> Deferred | Opaque:
        """Return ``whole.ravel()[idxs].reshape(preferred_shape)``, evaluated on demand."""
        idxs, shape = state.get("idxs"), state.get("preferred_shape")
        chosen = idxs.deferred(self.fail) if isinstance(idxs, Array) else None
        if chosen is None or chosen.dtype.kind not in "iu" or whole.dtype.kind not in _NUMBERS:
            return Opaque(Phrase("unread-indices", name=name))
        wanted = shape if is_sizes(shape) else chosen.shape
        count, found = math.prod(wanted), math.prod(chosen.shape)
        if count != found:
            values = {"expected": printable(count, 40), "name": name, "found": found}
            raise self.fail(Phrase("pickle-selection", **values))
        return Deferred(wanted, whole.dtype, partial(self.take, whole, chosen, wanted))

    def take(self, whole: Deferred, chosen: Deferred, shape: tuple[int, ...]) -> NDArray[Any]:
        flat, indices = whole.values().reshape(-1), chosen.values()
        if indices.size and (int(indices.min()) < 0 or int(indices.max()) >= len(flat)):
            low, high = int(indices.min()), int(indices.max())
            raise self.fail(
                Phrase("pickle-selection-range", last=len(flat) - 1, low=low, high=high)
            )
        return flat.take(indices.reshape(-1).astype(np.intp)).reshape(shape)
