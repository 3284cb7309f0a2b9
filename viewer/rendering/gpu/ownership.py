"""Ownership of OpenGL objects, including their release when a later creation fails."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Generic, Protocol, TypeVar


class _Releasable(Protocol):
    def release(self) -> object: ...


_Item = TypeVar("_Item", bound=_Releasable)
_Key = TypeVar("_Key")


class Owner:
    """Owner of objects; it frees them in reverse order of creation."""

    def __init__(self) -> None:
        self._stack = ExitStack()

    def keep(self, item: _Item) -> _Item:
        """Take ownership of an object, and return the object."""
        self._stack.callback(item.release)
        return item

    @contextmanager
    def guard(self) -> Iterator[None]:
        """Free everything if the block fails, so that a failed upload leaks nothing."""
        try:
            yield
        except BaseException:
            self.release()
            raise

    def release(self) -> None:
        """Free all owned objects."""
        self._stack.close()


class Kept(Generic[_Key, _Item]):
    """Cache of one item per object, keyed by identity and created on first use."""

    def __init__(self) -> None:
        # References keep the objects alive, so that no other object can get the same id.
        self._items: dict[int, tuple[_Key, _Item]] = {}

    def __len__(self) -> int:
        return len(self._items)

    def get(
        self,
        of: _Key,
        make: Callable[[], _Item],
        fits: Callable[[_Item], bool] = lambda item: True,
    ) -> _Item:
        """Return an object's item, creating it if there is none that fits."""
        if id(of) in self._items and not fits(self._items[id(of)][1]):
            self.drop(of)
        if id(of) not in self._items:
            self._items[id(of)] = (of, make())
        return self._items[id(of)][1]

    def drop(self, of: _Key, before: Callable[[_Item], object] | None = None) -> None:
        """Free an object's item if there is one; ``before`` is called with it."""
        if id(of) in self._items:
            item = self._items.pop(id(of))[1]
            if before is not None:
                before(item)
            item.release()

    @contextmanager
    def guard(self) -> Iterator[None]:
        """If the block fails, free the items that were created in it."""
        before = [of for of, _ in self._items.values()]
        try:
            yield
        except BaseException:
            self.keep_only(before)
            raise

    def keep_only(
        self, those: Sequence[_Key], before: Callable[[_Item], object] | None = None
    ) -> None:
        """Free the items of all other objects; ``before`` is called with each."""
        present = {id(one) for one in those}
        for of in [of for key, (of, _) in self._items.items() if key not in present]:
            self.drop(of, before)
