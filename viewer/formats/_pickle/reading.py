"""Reader of pickles with arrays and plain data, which runs no code.

::

    reading.py  this file: the pickle must be a dict of named values, or a list of such dicts, whose
                values are converted to arrays, sparse matrices and plain data, key by key
    machine.py  Python's unpickler with other steps; the budget; arrays of joblib
    names.py    the allowed names and their arguments
    values.py   inert values that represent these names
    tensors.py  tensors of torch

Arrays are views of the file's bytes. They are often unaligned, so an array that is used in a loop
should be copied first.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Phrase, wording
from viewer.errors import FormatError
from viewer.formats._archive.values import Archive, Opaque, Sparse, Value
from viewer.formats._archive.zip import value_fault
from viewer.formats._pickle.machine import Machine
from viewer.formats._pickle.names import SPARSE
from viewer.formats._pickle.tensors import Storage, Tensor
from viewer.formats._pickle.values import Array, Dtype, Instance, Span, StandIn, is_sizes, noun
from viewer.formats._source import InvalidValueError, Source
from viewer.formats._text.json_places import Keys
from viewer.phrases import counted, printable
from viewer.rigs.arrays import Deferred


def warn_of_rest(machine: Machine) -> None:
    """Record a note about bytes after the end of a pickle."""
    rest = machine.end - machine.at
    if rest:
        machine.source.warn(
            "F006.pickle-rest: ignored {n} after the end of the pickle", n=counted(rest, "byte")
        )


def named_archive(source: Source, kind: str, size: int, whole: object) -> Archive:
    """Return the dict with string keys, or the dicts, that a pickle builds, as an archive."""
    found = _objects(whole)
    is_list = not isinstance(found, dict)
    return _archive(source, kind, size, _named(source, found), (), is_list)


def nested_archive(
    source: Source, kind: str, size: int, whole: object, path: Keys
) -> Archive | None:
    """Return the archive of a pickle at ``path`` in another one; None if it has no names."""
    found = _items(_objects(whole))
    if found is None:
        return None
    is_list = not isinstance(_objects(whole), dict)
    return _archive(source, kind, size, _strings(source, found), path, is_list)


def listed(source: Source, size: int, key: str, whole: object) -> Value:
    """Return the objects of an array of objects in nested lists; None for other values."""
    if not isinstance(whole, Array) or whole.items is None:
        return None
    items, (_, *sides) = whole.items, whole.shape or (1,)
    if sides and (whole.is_fortran or math.prod(whole.shape) != len(items) or not items):
        return None
    for side in reversed(sides):
        items = [items[start : start + side] for start in range(0, len(items), side)]
    return resolve(source.path, size, key, items)


def has_names(whole: object) -> bool:
    """Return whether an array of objects contains one dict, or only dicts."""
    return _items(_objects(whole)) is not None


def _objects(whole: object) -> object:
    """Return the objects of an array of objects; a single one is returned unchanged."""
    if not isinstance(whole, Array) or whole.items is None:
        return whole
    return whole.items[0] if len(whole.items) == 1 else whole.items


def _archive(
    source: Source,
    kind: str,
    size: int,
    values: dict[str, object],
    path: Keys,
    is_list: bool,
) -> Archive:
    label = "".join(f"{key}." for key in path)

    def load(key: str) -> Value:
        return resolve(source.path, size, label + key, values[key])

    def branch(key: str) -> Archive | None:
        inner = (*path, int(key) if is_list else key)
        return nested_archive(source, kind, size, values[key], inner)

    def objects(key: str) -> Value:
        return listed(source, size, label + key, values[key])

    keys = tuple(values)
    return Archive(source, kind, keys, load, branch, label, objects, is_list, path)


def _items(value: object) -> Mapping[str | bytes | int, object] | None:
    """Return a dict, or by index the dicts of a list (None for missing frames); else None."""
    if isinstance(value, dict):
        return value
    if isinstance(value, list | tuple) and any(map(_has_dict, value)) and all(map(_is_nest, value)):
        return dict(enumerate(value))
    return None


def _has_dict(item: object) -> bool:
    return isinstance(item, dict) or (isinstance(item, list | tuple) and any(map(_has_dict, item)))


def _is_nest(item: object) -> bool:
    """Return whether an item of a list is a dict, None, or a list of these, which may be empty."""
    if isinstance(item, list | tuple):
        return all(inner is None or isinstance(inner, dict) for inner in item)
    return item is None or isinstance(item, dict)


def _named(source: Source, whole: object) -> dict[str, object]:
    """Return the values by name; numbers are names only of dicts, such as people."""
    found = _items(whole)
    if found is None:
        raise source.fault(
            "F002.pickle-named: expected a dict with string keys, found {found}", found=noun(whole)
        )
    is_lost = any(isinstance(value, dict | list | tuple) for value in found.values())
    for key, value in found.items():
        if is_lost and value is None:
            continue  # a frame without people
        if isinstance(key, int) and not isinstance(value, dict | list | tuple):
            raise source.fault(
                "F002.pickle-key: expected a dict with string keys, found the key {found}",
                found=key,
            )
    return _strings(source, found)


def _strings(source: Source, found: Mapping[str | bytes | int, object]) -> dict[str, object]:
    """Return values by name; names may be bytes, as Python 3 writes strings of Python 2."""
    values: dict[str, object] = {}
    for key, value in found.items():
        name = key.decode("latin-1") if isinstance(key, bytes) else str(key)
        if name in values:
            raise source.fault(
                "F002.pickle-twice: {item}: expected a single value with this name, found two",
                item=printable(name, 60),
            )
        values[name] = value
    return values


# Conversion of the values that a pickle builds to those of an archive, one key at a time.
#
# Values are converted on demand, so a key that is not needed costs nothing and cannot invalidate
# the others. Shared and self-containing values are traversed within limits of budget and depth.

_DEEPEST = 32  # maximum depth of nested containers
_DEEPEST_EXPRESSION = 8  # maximum depth of nested expressions; a released model has two levels
_SMALLEST_BUDGET = 1000
_NUMBERS = "biuf"


class _EndlessError(Exception):
    """A value that contains itself, or expands far beyond the size of its file."""


def resolve(path: Path, size: int, key: str, value: object) -> Value:
    """Return a value of a pickle of ``size`` bytes as specified by ``Archive.get``."""
    try:
        return _Resolver(path, key, max(size, _SMALLEST_BUDGET)).value(value, 0)
    except _EndlessError:
        return Opaque(Phrase("circular data"))


class _Resolver:
    def __init__(self, path: Path, key: str, budget: int) -> None:
        self.path, self.key, self.budget = path, key, budget

    def fail(self, problem: str | Phrase, **values: object) -> FormatError:
        return value_fault(self.path, self.key, problem, values)

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
            raise self.fail(wording.PICKLE_BYTES) from None

    def thing(self, value: object) -> Deferred | Sparse | Opaque:
        if isinstance(value, Array):
            return value.deferred(self.fail) or Opaque(value.what)
        if isinstance(value, Tensor):
            return value.deferred(self.fail)
        if isinstance(value, Storage):
            return Opaque(Phrase("storage of a tensor"))
        if isinstance(value, Instance) and value.of.role == "joblib":
            return Opaque(Phrase("{name}", name=value.of.name))
        if isinstance(value, Instance) and value.of.role in SPARSE:
            return self.sparse(value)
        if isinstance(value, Instance):
            return self.expression(value, 0)
        if isinstance(value, StandIn | Dtype):
            if isinstance(value, Dtype):
                return Opaque(Phrase("element type"))
            return Opaque(Phrase("{name}", name=value.name))
        raise self.fail("unexpected object in the pickle")

    def sparse(self, matrix: Instance) -> Sparse:
        state = matrix.state or {}
        shape = state.get("_shape", state.get("shape"))
        if not is_sizes(shape) or len(shape) != 2:
            raise self.fail("expected a sparse matrix with a shape, found none")
        names = ("row", "col") if matrix.of.role == "coo" else ("indices", "indptr")
        coordinates = state.get("coords")  # rows and columns, since SciPy 1.13
        if names[0] == "row" and isinstance(coordinates, tuple) and len(coordinates) == 2:
            state = {**state, **dict(zip(names, coordinates, strict=True))}
        data, indices, indptr = (self.part(state, name) for name in ("data", *names))
        try:
            return Sparse((shape[0], shape[1]), data, indices, indptr, matrix.of.role)
        except InvalidValueError as problem:
            raise self.fail(problem.problem) from None

    def part(self, state: dict[str | bytes | int, object], name: str) -> NDArray[Any]:
        array = state.get(name)
        later = array.deferred(self.fail) if isinstance(array, Array) else None
        if later is None:
            raise self.fail("expected a sparse matrix with {part}, found none", part=name)
        return later.values()

    def expression(self, value: Instance, depth: int) -> Deferred | Opaque:
        """Return the array that a chumpy object represents, if it is known without evaluation."""
        state = value.state or {}
        name = value.of.name
        if depth > _DEEPEST_EXPRESSION:
            return Opaque(Phrase("circular {name} expression", name=name))
        if value.of.role == "expression":
            return Opaque(Phrase("{name} expression", name=name))
        inner = state.get("x" if value.of.role == "Ch" else "a")
        if isinstance(inner, Instance) and inner.of.role not in SPARSE:
            found: Deferred | Opaque = self.expression(inner, depth + 1)
        elif isinstance(inner, Array):
            found = inner.deferred(self.fail) or Opaque(inner.what)
        elif isinstance(inner, float):
            number = np.array(inner)
            found = Deferred((), number.dtype, lambda: number)
        else:
            found = Opaque(Phrase("{name} without values", name=name))
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
            return Opaque(Phrase("{name} with unsupported indices", name=name))
        wanted = shape if is_sizes(shape) else chosen.shape
        count, found = math.prod(wanted), math.prod(chosen.shape)
        if count != found:
            values = {"expected": printable(count, 40), "name": name, "found": found}
            raise self.fail("expected {expected} indices in {name}, found {found}", **values)
        return Deferred(wanted, whole.dtype, partial(self.take, whole, chosen, wanted))

    def take(
        self, whole: Deferred, chosen: Deferred, shape: tuple[int, ...]
    ) -> NDArray[np.generic]:
        flat, indices = whole.values().reshape(-1), chosen.values()
        if indices.size and (int(indices.min()) < 0 or int(indices.max()) >= len(flat)):
            low, high = int(indices.min()), int(indices.max())
            raise self.fail(
                "expected indices 0 to {last}, found {low} to {high}",
                last=len(flat) - 1,
                low=low,
                high=high,
            )
        return flat.take(indices.reshape(-1).astype(np.intp)).reshape(shape)
