"""Progress reports from slow functions to receivers such as a progress bar."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

Receiver = Callable[[int, int, str, str], None]
"""Called with the completed steps, their total (0 if unknown), their unit, and a description of the
work, empty if it is the same as before. It may raise ``Cancelled``."""

_MEGABYTE = 1_000_000

_receiver: ContextVar[Receiver | None] = ContextVar("receiver of progress", default=None)


class Cancelled(Exception):  # noqa: N818 - it is no error
    """Cancels the work in which it is raised; incomplete files are removed."""


@contextmanager
def receiving(receive: Receiver) -> Iterator[None]:
    """Pass progress reported in the block, in this thread, to a function."""
    token = _receiver.set(receive)
    try:
        yield
    finally:
        _receiver.reset(token)


def receiver() -> Receiver | None:
    """Return the function that currently receives the progress."""
    return _receiver.get()


@contextmanager
def silent() -> Iterator[None]:
    """Ignore progress reported in the block, whose caller reports the progress of the whole."""
    with receiving(lambda done, total, unit, what: None):
        yield


def report(done: int, total: int, unit: str, what: str = "") -> None:
    """Report progress to the receiver, if there is one.

    To be called between parts of the work that take a few milliseconds.
    """
    receive = _receiver.get()
    if receive is not None:
        receive(done, total, unit, what)


def report_bytes(done: int, total: int, what: str = "") -> None:
    """Report progress in megabytes."""
    report(done // _MEGABYTE, total // _MEGABYTE, "MB", what)
