"""Progress bars in a terminal, for work that takes longer than a second."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from viewer.phrases import printable
from viewer.progress import receiver, receiving

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

_FIRST, _EVERY = 0.7, 0.2  # seconds before the bar appears, and between updates


class Progress:
    """Progress bar of the work that it receives; silent without a terminal and for quick work."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._due = time.monotonic() + _FIRST
        self._bar: Bar | None = None

    def begin(self, total: int) -> None:
        """Show the bar at once: the first step may take long."""
        if sys.stderr.isatty():
            self._draw(0, total, "")

    def receive(self, done: int, total: int, unit: str, what: str) -> None:
        """Update the bar to reported progress; see ``viewer.progress``."""
        self._title = what or self._title
        if time.monotonic() >= self._due and sys.stderr.isatty() and done > 0:
            self._draw(done, total, unit)

    def _draw(self, done: int, total: int, unit: str) -> None:
        self._due = time.monotonic() + _EVERY
        title = printable(self._title, 60)
        if self._bar is None:
            self._bar = _bar()
            self._bar.start()
        # The total of a bar cannot become unknown again, so new work gets a new bar; steps of the
        # same work share one, which estimates the time left for all of them.
        for task in self._bar.tasks:
            if task.total != (total or None) or task.completed > done:
                self._bar.remove_task(task.id)
        if not self._bar.tasks:
            self._bar.add_task(title, total=total or None, completed=done, unit=unit)
        self._bar.update(
            self._bar.task_ids[0], description=title, completed=done, unit=unit, refresh=True
        )

    def hide(self) -> None:
        """Remove the bar, so that a message can be printed; the next update shows it again."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        self.hide()


@contextlib.contextmanager
def shown_progress(title: str) -> Iterator[None]:
    """Show the progress that the work in the block reports, and pass it on to the receiver."""
    outer = receiver()

    def receive(done: int, total: int, unit: str, what: str) -> None:
        progress.receive(done, total, unit, what)
        if outer is not None:
            outer(done, total, unit, what)

    with Progress(title) as progress, receiving(receive):
        yield


def _bar() -> Bar:
    """Return a bar that only ``Progress`` redraws, without a thread or redirected streams."""
    from rich import progress
    from rich.console import Console

    return progress.Progress(
        progress.TextColumn("{task.description}", markup=False),
        progress.BarColumn(),
        progress.MofNCompleteColumn(),
        progress.TextColumn("{task.fields[unit]}", markup=False),
        progress.TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
        auto_refresh=False,
        redirect_stdout=False,
        redirect_stderr=False,
    )
