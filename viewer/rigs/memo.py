"""Caches of derived results that live as long as what they derive from, and keys of arrays."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Hashable
from threading import Lock
from typing import Generic, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from viewer.rigs.arrays import Floats

_Owner = TypeVar("_Owner")
_Value = TypeVar("_Value")


class Memo(Generic[_Owner, _Value]):
    """A thread-safe cache of a few results per owner, released together with the owner."""

    def __init__(self, kept: int = 1) -> None:
        self._kept = kept
        self._lock = Lock()
        self._values: WeakKeyDictionary[_Owner, dict[Hashable, _Value]] = WeakKeyDictionary()

    def get(self, owner: _Owner, key: Hashable, make: Callable[[], _Value]) -> _Value:
        """Return the result of an owner and key, calling ``make`` if there is none.

        The owner is immutable, compared by identity; the result must not refer to it.
        """
        known = self._values.setdefault(owner, {})
        if key in known:
            # Another thread may already have evicted the result.
            with contextlib.suppress(KeyError):
                return known[key]
        value = make()
        with self._lock:
            while len(known) >= self._kept and key not in known:
                del known[next(iter(known))]
            known[key] = value
        return value


class NumberKey:
    """A snapshot of the contents of some arrays; equal contents make equal keys."""

    __slots__ = ("_parts",)

    def __init__(self, *arrays: Floats) -> None:
        self._parts = tuple(map(bytearray, arrays))

    def updated(self, *arrays: Floats) -> NumberKey:
        """Return this key if arrays are bitwise equal, or one that copies changed ones."""
        old = self._parts
        if len(arrays) != len(old):
            return NumberKey(*arrays)
        changed = False
        parts = []
        for part, array in zip(old, arrays, strict=True):
            packed = array if array.flags.c_contiguous else np.ascontiguousarray(array)
            # A bytearray compares with the array's memory directly, without a temporary array.
            if part != packed:
                part, changed = bytearray(packed), True
            parts.append(part)
        if not changed:
            return self
        key = NumberKey()
        key._parts = tuple(parts)
        return key

    def array(self, index: int) -> Floats:
        """Return a flat copy of the contents of one of the arrays: (N,)."""
        return np.array(np.frombuffer(self._parts[index]))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, NumberKey):
            return NotImplemented
        return self is other or self._parts == other._parts

    def __hash__(self) -> int:
        return hash(tuple(map(bytes, self._parts)))
