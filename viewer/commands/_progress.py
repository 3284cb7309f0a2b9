"""One line of progress at a terminal, for work that takes longer than a second."""

from __future__ import annotations

import sys
import time

from viewer.errors import printable

__all__ = ["Progress"]

_FIRST, _EVERY = 0.7, 0.2  # seconds before the first line, and between lines


class Progress:
    """Shows how far something is; silent where nobody looks, and when it is quick.

    Parameters
    ----------
    title : str
        What is being done.
    total : int
        How many steps there are.
    """

    def __init__(self, title: str, total: int) -> None:
        self.title, self.total = title, total
        self._started = time.monotonic()
        self._shown: float | None = None

    def show(self, done: int) -> None:
        """Tell that so many steps are done."""
        now = time.monotonic()
        due = self._started + _FIRST if self._shown is None else self._shown + _EVERY
        if now < due or not sys.stderr.isatty() or done <= 0:
            return
        self._shown = now
        left = (now - self._started) * (self.total - done) / done
        text = f"{printable(self.title, 60)}: {done:,} of {self.total:,}, {left:.0f} s left"
        print(f"\r{text:<78.78}", end="", file=sys.stderr, flush=True)

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._shown is not None:
            print(f"\r{'':78}\r", end="", file=sys.stderr, flush=True)
