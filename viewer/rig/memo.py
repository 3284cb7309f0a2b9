"""Results that are remembered as long as what they were made from is in use."""

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
    """A few results per owner; they go when the owner does. Threads may share it.

    Parameters
    ----------
    kept : int
        How many of one owner; the oldest makes room.
    """

    def __init__(self, kept: int = 1) -> None:
        self._kept = kept
        self._lock = Lock()
        self._values: WeakKeyDictionary[_Owner, dict[Hashable, _Value]] = WeakKeyDictionary()

    def get(self, owner: _Owner, key: Hashable, make: Callable[[], _Value]) -> _Value:
        """Return what ``make`` gave for this owner and key, calling it the first time.

        Parameters
        ----------
        owner : object
            Frozen, told apart by identity; ``make``'s result must not refer to it.
        key : hashable
            What else the result depends on.
        make : callable
            Without arguments.
        """
        known = self._values.setdefault(owner, {})
        if key in known:
            with contextlib.suppress(KeyError):  # another thread made room meanwhile
                return known[key]
        value = make()
        with self._lock:
            while len(known) >= self._kept and key not in known:
                del known[next(iter(known))]
            known[key] = value
        return value
