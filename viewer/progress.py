"""Progress of slow work and its cancellation: one protocol for terminal, window and batch.

Slow functions call ``report`` between parts of their work that take a few milliseconds. Whoever
shows the progress calls them within ``receiving``. The receiver cancels the work by raising
``Cancelled`` when a report arrives, a deferred signal by raising ``Interrupted``; the work then
cleans up as after any exception.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from typing import NamedTuple

from viewer.interrupts import poll

Receiver = Callable[[int, int, str, str], None]
"""Called with the completed steps, their total (0 if unknown), their unit, and a description of the
work, empty if it is the same as before. It may raise ``Cancelled``."""

_MEGABYTE = 1_000_000


class Cancelled(Exception):  # noqa: N818 - it is no error
    """Cancels the work in which it is raised; incomplete files are removed."""


class _Part(NamedTuple):
    """The part of the receiver's work that is in progress."""

    receive: Receiver
    title: str = ""
    span: tuple[float, float] | None = None
    take: Callable[[object], None] | None = None
    """Called with intermediate results."""

    def pass_on(self, done: float, total: float, unit: str, what: str) -> None:
        """Report steps of the part to the receiver, as a percentage of its whole work if known."""
        if self.title and what:
            what = f"{self.title}: {what}"
        if self.span is not None:
            low, high = self.span
            done, total, unit = 100.0 * (low + (high - low) * done / (total or 1)), 100, ""
        self.receive(round(done), round(total), unit, what)


_part: ContextVar[_Part | None] = ContextVar("part of the work in progress", default=None)


@contextmanager
def _within(part: _Part | None) -> Iterator[None]:
    token = _part.set(part)
    try:
        yield
    finally:
        _part.reset(token)


def receiving(
    receive: Receiver, take: Callable[[object], None] | None = None
) -> AbstractContextManager[None]:
    """Pass progress and intermediate results of the block, in this thread, to functions."""
    return _within(_Part(receive, take=take))


def receiver() -> Receiver | None:
    """Return the function that currently receives the progress."""
    part = _part.get()
    return None if part is None else part.pass_on


def silent() -> AbstractContextManager[None]:
    """Ignore progress reported in the block, whose caller reports the progress of the whole."""
    return _within(None)


@contextmanager
def part_of_work(title: str = "", span: tuple[float, float] | None = None) -> Iterator[None]:
    """Pass progress reported in the block on as that of a part of the work."""
    # The title stands before the descriptions of its steps. The span is the fractions of the whole
    # work at which the part begins and ends; its steps then become percentages of the whole.
    outer = _part.get()
    if outer is None:
        yield
        return
    if span is not None:
        low, high = outer.span or (0.0, 1.0)
        span = low + (high - low) * span[0], low + (high - low) * span[1]
    part = _Part(outer.receive, title or outer.title, span or outer.span, outer.take)
    with _within(part):
        if title and span is not None:
            part.receive(round(100.0 * span[0]), 100, "", title)
        yield


def report(done: int, total: int, unit: str = "", what: str = "") -> None:
    """Report the completed steps to the receiver, if there is one; the work may end here."""
    if not total or done < total:  # after the last step, the result may be complete
        poll()
    part = _part.get()
    if part is not None:
        part.pass_on(done, total, unit, what)


def report_fraction(fraction: float, what: str = "") -> None:
    """Report the completed fraction as a percentage."""
    part = _part.get()
    if part is not None:
        part._replace(span=part.span or (0.0, 1.0)).pass_on(fraction, 1, "", what)


def offer(found: object) -> None:
    """Give an intermediate result, of a type of its own, to the receiver, which may show it."""
    part = _part.get()
    if part is not None and part.take is not None:
        part.take(found)


def report_bytes(done: int, total: int, what: str = "") -> None:
    """Report progress in megabytes."""
    report(done // _MEGABYTE, total // _MEGABYTE, "MB", what)
