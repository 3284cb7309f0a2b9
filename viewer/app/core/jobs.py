"""Jobs that take longer than a frame, with their progress and cancellation."""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator
from typing import Protocol

from viewer.errors import ViewerError
from viewer.phrases import printable

Report = Callable[[int, int, str], None]
"""Called with the completed steps, their total and the next step's name; raises to cancel."""


class Job(Protocol):
    """Interface of a running job."""

    title: str
    """Description of the job."""
    error: str
    """Reason why the job failed; empty if it did not."""
    lines: list[str]
    """Messages when the job ends."""
    output: str
    """The kind of output that is lost if the job does not end, such as ``"export"``; empty if it
    has none."""
    is_cancelled: bool
    """Whether it was cancelled; its thread may need a moment to end."""

    @property
    def is_done(self) -> bool:
        """Whether it has ended, successfully or not."""

    @property
    def progress(self) -> tuple[int, int]:
        """Completed steps and number of steps; (0, 0) if unknown."""

    def step(self) -> None:
        """Perform the next step if the job runs between frames."""

    def cancel(self) -> None:
        """Cancel the job; no partial file remains."""


def unexpected(title: str, problem: BaseException) -> str:
    """Return the message about an error that a thread does not expect."""
    return f"{title}: unexpected {type(problem).__name__}: {printable(problem, 300)}"


class _EndedError(ViewerError):
    """Raised to unwind a cancelled job."""


class CountedJob:
    """Job in its own thread that reports its progress and can be cancelled between steps.

    ``act``: gets a ``Report`` and returns messages about the result; may raise ViewerError.
    ``output``: the kind of files that the job writes, such as ``"export"``; empty if it writes
    none.
    """

    def __init__(
        self,
        title: str,
        act: Callable[[Report], list[str]],
        finish: Callable[[], None] | None = None,
        output: str = "",
    ) -> None:
        self.title, self.error, self.output, self.is_cancelled = title, "", output, False
        self.lines: list[str] = []
        self._act, self._finish = act, finish
        self.is_change = finish is not None and not output
        self._progress = (0, 0)
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
        except BaseException as problem:  # a programming error: the traceback is printed
            self.error = unexpected(self.title, problem)
            raise

    def _report(self, done: int, total: int, what: str) -> None:
        if self.is_cancelled:
            raise _EndedError(self.title)
        self._progress, self.title = (done, total), what or self.title

    @property
    def is_done(self) -> bool:
        """Whether its thread has ended, and its result has been applied unless it was cancelled.

        A cancelled job may still restore the files that it was about to replace.
        """
        return not self._thread.is_alive() and (self.is_cancelled or self._finish is None)

    @property
    def progress(self) -> tuple[int, int]:
        """Completed steps and number of steps; (0, 0) before the first."""
        return self._progress

    def step(self) -> None:
        """Apply the result of a thread that has ended."""
        if self._finish is None or self.is_cancelled or self._thread.is_alive():
            return
        finish, self._finish = self._finish, None
        if not self.error:
            finish()

    def cancel(self) -> None:
        """End the job before its next step, and discard its result."""
        self.is_cancelled = True

    def wait(self) -> None:
        """Wait until the thread has ended."""
        self._thread.join()


class FrameJob:
    """Job that draws, one step after each frame of the window.

    ``output``: the kind of files that the job writes, such as ``"recording"``.
    """

    def __init__(
        self, title: str, steps: Generator[tuple[int, int], None, list[str]], output: str
    ) -> None:
        self.title, self.error, self.output, self.is_cancelled = title, "", output, False
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
        """Completed steps and number of steps."""
        return self._progress

    def step(self) -> None:
        """Perform the next step."""
        if self._is_done:
            return
        try:
            self._progress = next(self._steps)
        except StopIteration as end:
            self.lines, self._is_done = end.value or [], True
        except ViewerError as problem:
            self.error, self._is_done = str(problem), True

    def cancel(self) -> None:
        """Cancel the job; the generator removes partial output."""
        self._steps.close()
        self.is_cancelled = self._is_done = True
