"""Caches of derived results with the lifetime of the objects from which they are derived."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Hashable
from threading import Lock
from typing import Generic, TypeVar
from weakref import WeakKeyDictionary

__all__ = ["Memo"]

_Owner = TypeVar("_Owner")
_Value = TypeVar("_Value")


class Memo(Generic[_Owner, _Value]):
    """A thread-safe cache of a few results per owner, released together with the owner.

    Parameters
    ----------
    kept : int
        Maximum number of results per owner; the oldest is evicted first.
    """

    def __init__(self, kept: int = 1) -> None:
        self._kept = kept
        self._lock = Lock()
        self._values: WeakKeyDictionary[_Owner, dict[Hashable, _Value]] = WeakKeyDictionary()

    def get(self, owner: _Owner, key: Hashable, make: Callable[[], _Value]) -> _Value:
        """Return the cached result of an owner and key, calling ``make`` if there is none.

        Parameters
        ----------
        owner : object
            Immutable, compared by identity; the result must not refer to it.
        key : hashable
            Everything else that the result depends on.
        make : callable
            Called without arguments.
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
