"""Who frees what: OpenGL objects that belong to one Python object, also if making it fails."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Protocol, TypeVar

__all__ = ["Owner"]


class _Releasable(Protocol):
    def release(self) -> object: ...


_Item = TypeVar("_Item", bound=_Releasable)


class Owner:
    """Frees what it was given, the last first."""

    def __init__(self) -> None:
        self._stack = ExitStack()

    def keep(self, item: _Item) -> _Item:
        """Take an object over and return it."""
        self._stack.callback(item.release)
        return item

    @contextmanager
    def guard(self) -> Iterator[None]:
        """Free everything if what is inside fails: a refused upload leaves nothing behind."""
        try:
            yield
        except BaseException:
            self.release()
            raise

    def release(self) -> None:
        """Free everything that was taken over."""
        self._stack.close()
