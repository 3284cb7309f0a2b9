"""Progress of long work, from the functions that do it to whoever waits for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

__all__ = ["Cancelled", "Receiver", "receiving", "report"]

Receiver = Callable[[int, int, str], None]
"""Called with the bytes or steps done, their total, 0 if unknown, and a description of the work,
empty if it has not changed. It may raise ``Cancelled``."""

_receiver: ContextVar[Receiver | None] = ContextVar("receiver of progress", default=None)


class Cancelled(Exception):  # noqa: N818 - no error
    """Ends the work in which it is raised; files that are being written are removed."""


@contextmanager
def receiving(receive: Receiver) -> Iterator[None]:
    """Pass the progress of all work in the block, in this thread, to a function."""
    token = _receiver.set(receive)
    try:
        yield
    finally:
        _receiver.reset(token)


def report(done: int, total: int, what: str = "") -> None:
    """Report progress, if anybody waits for it; see ``Receiver``.

    Called between parts of the work that take a few milliseconds.
    """
    receive = _receiver.get()
    if receive is not None:
        receive(done, total, what)
