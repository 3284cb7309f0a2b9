"""Work that takes longer than a frame: shown with its progress, and cancelled by a key."""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator
from typing import Protocol

from viewer.errors import ViewerError

__all__ = ["CountedJob", "FrameJob", "Job", "Report", "ThreadJob"]

Report = Callable[[int, int, str], None]
"""Told the steps done, all steps, and what comes next; raises to end the work."""


class Job(Protocol):
    """What the interface must know of work that goes on.

    Attributes
    ----------
    title : str
        What is being done.
    error : str
        Why it ended early; empty if nothing is wrong.
    lines : list of str
        What it says when it is done.
    can_cancel : bool
        Whether it can be ended early.
    """

    title: str
    error: str
    lines: list[str]
    can_cancel: bool

    @property
    def is_done(self) -> bool:
        """Whether it has ended, well or not."""

    @property
    def progress(self) -> tuple[int, int]:
        """Steps done and steps in all; (0, 0) if nobody knows."""

    def step(self) -> None:
        """Do a little of it, if it is done between frames."""

    def cancel(self) -> None:
        """End it; nothing half-written stays."""


class ThreadJob:
    """Work that needs no OpenGL, in a thread of its own.

    Parameters
    ----------
    title : str
        What is being done.
    act : callable
        Returns lines that say what was done; raises ViewerError.
    wake : callable
        Called from the thread at the end.
    """

    def __init__(
        self, title: str, act: Callable[[], list[str]], wake: Callable[[], None] = lambda: None
    ) -> None:
        self.title, self.error, self.can_cancel = title, "", False
        self.lines: list[str] = []
        self._act, self._wake = act, wake
        self._thread = threading.Thread(target=self._run)  # not a daemon: files get finished
        self._thread.start()

    def _run(self) -> None:
        try:
            self.lines = self._act()
        except ViewerError as problem:
            self.error = str(problem)
        except MemoryError:
            self.error = f"{self.title}: not enough memory"
        self._wake()

    @property
    def is_done(self) -> bool:
        """Whether it has ended."""
        return not self._thread.is_alive()

    @property
    def progress(self) -> tuple[int, int]:
        """Nobody knows."""
        return 0, 0

    def step(self) -> None:
        """Nothing: the thread works."""

    def cancel(self) -> None:
        """Nothing: one file is finished sooner than it is taken back."""

    def wait(self) -> None:
        """Return when it has ended."""
        self._thread.join()


class _EndedError(ViewerError):
    """Unwinds work that was cancelled."""


class CountedJob:
    """Work in a thread of its own that tells how far it is, and can be ended between two steps.

    Parameters
    ----------
    title : str
        What is being done, until the work itself says more.
    act : callable
        Given a ``Report``; returns lines that say what was done; raises ViewerError.
    """

    def __init__(self, title: str, act: Callable[[Report], list[str]]) -> None:
        self.title, self.error, self.can_cancel = title, "", True
        self.lines: list[str] = []
        self._act = act
        self._progress = (0, 0)
        self._is_cancelled = False
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        try:
            self.lines = self._act(self._report)
        except _EndedError:
            return
        except ViewerError as problem:
            self.error = str(problem)
        except MemoryError:
            self.error = f"{self.title}: not enough memory"

    def _report(self, done: int, total: int, what: str) -> None:
        if self._is_cancelled:
            raise _EndedError(self.title)
        self._progress, self.title = (done, total), what or self.title

    @property
    def is_done(self) -> bool:
        """Whether it has ended, or nobody wants it any more."""
        return self._is_cancelled or not self._thread.is_alive()

    @property
    def progress(self) -> tuple[int, int]:
        """Steps done and steps in all; (0, 0) before the first."""
        return self._progress

    def step(self) -> None:
        """Nothing: the thread works."""

    def cancel(self) -> None:
        """Let it end before its next step; what it makes until then is for nobody."""
        self._is_cancelled = True

    def wait(self) -> None:
        """Return when the thread has ended."""
        self._thread.join()


class FrameJob:
    """Work that draws, a step after each frame of the window.

    Parameters
    ----------
    title : str
        What is being done.
    steps : generator
        Yields (done, total) after each step and returns lines; closing it cleans up.
    """

    def __init__(self, title: str, steps: Generator[tuple[int, int], None, list[str]]) -> None:
        self.title, self.error, self.can_cancel = title, "", True
        self.lines: list[str] = []
        self._steps = steps
        self._progress = (0, 1)
        self._is_done = False

    @property
    def is_done(self) -> bool:
        """Whether it has ended."""
        return self._is_done

    @property
    def progress(self) -> tuple[int, int]:
        """Steps done and steps in all."""
        return self._progress

    def step(self) -> None:
        """Do the next step."""
        if self._is_done:
            return
        try:
            self._progress = next(self._steps)
        except StopIteration as end:
            self.lines, self._is_done = end.value or [], True
        except ViewerError as problem:
            self.error, self._is_done = str(problem), True

    def cancel(self) -> None:
        """End it; what was begun is taken away by the generator."""
        self._steps.close()
        self._is_done = True
