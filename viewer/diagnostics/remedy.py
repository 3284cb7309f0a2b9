"""Remedies that differ between the window and the command line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from viewer.data_classes import dataclass

_open_windows: list[None] = []
_is_data = ContextVar("is_data", default=False)


@dataclass(frozen=True, slots=True)
class Remedy:
    """Words of a sentence that name a control in the window, and an option elsewhere."""

    in_window: str
    elsewhere: str

    def __str__(self) -> str:
        """Return the words for the place where the sentence is shown."""
        return self.in_window if is_in_window() else self.elsewhere


def is_in_window() -> bool:
    """Return whether sentences are worded for the window."""
    return bool(_open_windows) and not _is_data.get()


@contextmanager
def in_window() -> Iterator[None]:
    """Word all messages for the window, in every thread: remedies name its controls."""
    _open_windows.append(None)
    try:
        yield
    finally:
        _open_windows.pop()


@contextmanager
def as_data() -> Iterator[None]:
    """Word the messages of this thread for the command line, even while a window is open.

    For JSON and records of runs, which are read elsewhere: programs that compare them find one
    wording, and ``render --panels`` opens a window's interface without a user in front of it.
    """
    before = _is_data.set(True)
    try:
        yield
    finally:
        _is_data.reset(before)
