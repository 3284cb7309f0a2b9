"""Progress bars in a terminal, for work that takes longer than a second."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING

from viewer.phrases import printable

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

_FIRST, _EVERY = 0.7, 0.2  # seconds before the bar appears, and between updates


class Progress:
    """Progress bar; silent without a terminal and for quick work.

    ``title``: name of the work.
    ``total``: number of steps.
    """

    def __init__(self, title: str, total: int) -> None:
        self.title, self.total = title, total
        self._due = time.monotonic() + _FIRST
        self._bar: Bar | None = None

    def show(self, done: int) -> None:
        """Update the bar to a number of completed steps."""
        now = time.monotonic()
        if now < self._due or not sys.stderr.isatty() or done <= 0:
            return
        self._due = now + _EVERY
        title = printable(self.title, 60)
        if self._bar is None:
            self._bar = _bar()
            self._bar.add_task(title, total=self.total, completed=done)
            self._bar.start()
        task = self._bar.task_ids[0]
        self._bar.update(task, description=title, total=self.total, completed=done, refresh=True)

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()


def _bar() -> Bar:
    """Return a bar that only ``show`` redraws, without a thread or redirected streams."""
    from rich import progress
    from rich.console import Console

    return progress.Progress(
        progress.TextColumn("{task.description}", markup=False),
        progress.BarColumn(),
        progress.MofNCompleteColumn(),
        progress.TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
        auto_refresh=False,
        redirect_stdout=False,
        redirect_stderr=False,
    )
