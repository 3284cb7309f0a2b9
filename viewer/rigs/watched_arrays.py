"""Arrays that anyone may change in place, and whether anyone can have done so.

Nobody is told when an array is written. But a write needs a reference to the array, so an array of
which its owner holds the only reference, and which nobody has asked the owner for since the last
look, has its old values. A thousand such arrays need no comparison. Only a bare address is no
reference: C code that keeps one must keep the array too.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import cache
from operator import attrgetter
from typing import Any, TypeVar
from weakref import getweakrefcount

import numpy as np

_Class = TypeVar("_Class", bound=type)

# Other interpreters do not count references, and threads without a lock count them apart.
_COUNTS_REFERENCES = sys.implementation.name == "cpython" and "free-threading" not in sys.version


def watched(*names: str) -> Callable[[_Class], _Class]:
    """Return a decorator of classes whose named slots hold arrays, and whose ``handed`` is a slot.

    ``handed`` is another object whenever one of the arrays was asked for or set. ``unwatched``
    reads an array without that.
    """

    def decorate(cls: _Class) -> _Class:
        # The slot itself: setting it needs no check of the class.
        mark = vars(cls)["handed"].__set__
        for name in names:
            slot = getattr(cls, name)
            setattr(cls, f"_{name}", slot)
            setattr(cls, name, _property_of(slot, mark))
        return cls

    return decorate


def _property_of(slot: Any, mark: Callable[[Any, object], None]) -> property:
    # In this order, ``Watch`` misses no write of another thread either.
    def get(owner: Any) -> object:
        array = slot.__get__(owner)
        mark(owner, object())
        return array

    def put(owner: Any, array: object) -> None:
        slot.__set__(owner, array)
        mark(owner, object())

    return property(get, put)


@cache
def unwatched(name: str) -> Callable[[object], Any]:
    """Return a function that reads a watched array of an object; the array must not be changed."""
    return attrgetter(f"_{name}")


_handed = attrgetter("handed")
_owns_memory = attrgetter("flags.owndata")


class Watch:
    """What was seen of watched arrays of some owners at the last look."""

    def __init__(self, *names: str) -> None:
        self._arrays = [unwatched(name) for name in names]
        self._kept: list[object] | None = None
        self._seen: list[object] | None = None

    def look(self, owners: Sequence[object]) -> bool:
        """Return whether nobody can have changed the arrays since the look before.

        If not, read their values and call ``keep``; until then, they count as changed.
        """
        seen = list(map(_handed, owners))
        is_same = seen == self._kept
        # A reference that exists now may write after the values are read, and be gone at the next
        # look. Memory of others may have any number of references, and a weak one is not counted,
        # but nobody can make either without asking for the array.
        is_shared = not _COUNTS_REFERENCES or any(
            max(map(sys.getrefcount, map(array, owners)), default=0) > _own_references()
            or (not is_same and not all(map(_owns_memory, map(array, owners))))
            or (not is_same and any(map(getweakrefcount, map(array, owners))))
            for array in self._arrays
        )
        if is_shared or not is_same:
            self._kept, self._seen = None, None if is_shared else seen
        return is_same and not is_shared

    def keep(self) -> None:
        """Remember that the values at the last look are known."""
        if self._kept is None:
            self._kept = self._seen


class _Owner:
    def __init__(self) -> None:
        self._array = np.zeros(1)


@cache
def _own_references() -> int:
    """Return the number of references to an array of one owner, as ``Watch.look`` counts them."""
    # Versions of Python count the references of a running function differently.
    return max(map(sys.getrefcount, map(unwatched("array"), [_Owner()])))
