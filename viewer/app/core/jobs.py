"""Jobs that take longer than a frame: their progress, their result, and their cancellation."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator
from contextvars import copy_context

from viewer.errors import ViewerError
from viewer.phrases import printable
from viewer.progress import Cancelled, receiving


class Job:
    """A job whose reports of progress it receives, and which ends at the next one if cancelled."""

    def __init__(self, title: str, output: str = "", names_steps: bool = True) -> None:
        self.title = title
        self.output = output
        """The kind of files that are lost if it does not end, as ``"export"``; empty for none."""
        self._names_steps = names_steps  # whether the reported steps become the title
        self.progress = (0, 0, "")
        """Completed steps, their total (0 if unknown), and their unit."""
        self.found: object = None
        """The latest intermediate result."""
        self.error = ""
        """Reason why the job failed; empty if it did not."""
        self.lines: list[str] = []
        """Messages when the job ends."""
        self.is_cancelled = False
        """Whether it was cancelled; its thread may need a moment to end."""
        self.is_change = False
        """Whether the job has a result to apply that changes the scene."""
        self._started = time.monotonic()

    @property
    def is_done(self) -> bool:
        """Whether it has ended, successfully or not."""
        return False

    @property
    def seconds(self) -> float:
        """Seconds since it began."""
        return time.monotonic() - self._started

    @property
    def fraction(self) -> float:
        """Fraction of completed steps, for a progress bar; negative if their total is unknown."""
        done, total, _ = self.progress
        return done / total if total else -self.seconds

    @property
    def text(self) -> str:
        """Progress as text; work without countable steps reports percentages."""
        done, total, unit = self.progress
        if not total:
            return f"{self.seconds:.0f} s"
        is_percentage = (total, unit) == (100, "")
        return f"{done} %" if is_percentage else f"{done:,} of {total:,} {unit}".rstrip()

    def step(self) -> None:
        """Perform the part of the job that runs in the frame loop; called once a frame."""

    def cancel(self) -> None:
        """End the job at its next report, and discard its result; no partial file remains."""
        self.is_cancelled = True

    def receive(self, done: int, total: int, unit: str, what: str) -> None:
        """Receive reported progress."""
        if self.is_cancelled:
            raise Cancelled
        self.progress = (done, total, unit)
        if what and self._names_steps:
            self.title = what

    def keep(self, found: object) -> None:
        """Keep an intermediate result."""
        self.found = found


class ThreadJob(Job):
    """Job that acts in its own thread; ``finish`` applies its result in the frame loop."""

    def __init__(
        self,
        title: str,
        act: Callable[[], list[str] | None],
        finish: Callable[[], None] | None = None,
        output: str = "",
        wake: Callable[[], None] = lambda: None,
        names_steps: bool = True,
        is_daemon: bool = False,
    ) -> None:
        super().__init__(title, output, names_steps)
        self._act, self._finish, self._wake = act, finish, wake
        self.is_change = finish is not None and not output
        # The thread records diagnostics where its caller does. The program may end before a daemon.
        run = copy_context().run
        self._thread = threading.Thread(target=run, args=(self._run,), daemon=is_daemon)
        self._thread.start()

    def _run(self) -> None:
        try:
            with receiving(self.receive, self.keep):
                self.lines = self._act() or []
        except Cancelled:
            pass
        except BaseException as problem:
            self.fail(problem)
        finally:
            if not self.is_cancelled:  # otherwise, the window may have been closed
                self._wake()

    def fail(self, problem: BaseException) -> None:
        """Keep the message about an error; a programming error is raised on and printed."""
        if isinstance(problem, ViewerError):
            self.error = str(problem)
        elif isinstance(problem, MemoryError):
            self.error = f"{self.title}: not enough memory"
        else:
            self.error = f"{self.title}: unexpected {type(problem).__name__}: "
            self.error += printable(problem, 300)
            raise problem

    @property
    def is_done(self) -> bool:
        """Whether its thread has ended, and its result has been applied unless it was cancelled."""
        return not self._thread.is_alive() and (self.is_cancelled or self._finish is None)

    def step(self) -> None:
        """Apply the result of a thread that has ended."""
        if self._finish is None or self.is_cancelled or self._thread.is_alive():
            return
        finish, self._finish = self._finish, None
        if not self.error:
            finish()

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until the thread has ended, for at most some seconds; return whether it has."""
        self._thread.join(seconds)
        return not self._thread.is_alive()


class FrameJob(Job):
    """Job that draws, one step after each frame; closing the generator removes partial output."""

    def __init__(self, title: str, steps: Generator[object, None, list[str]], output: str) -> None:
        super().__init__(title, output)
        self._steps = steps
        self._is_done = False

    @property
    def is_done(self) -> bool:
        """Whether it has ended."""
        return self._is_done

    def step(self) -> None:
        """Perform the next step."""
        if self._is_done:
            return
        try:
            with receiving(self.receive):
                next(self._steps)
        except StopIteration as end:
            self.lines, self._is_done = end.value or [], True
        except ViewerError as problem:
            self.error, self._is_done = str(problem), True

    def cancel(self) -> None:
        """Cancel the job at once, while the context is current."""
        self._steps.close()
        self.is_cancelled = self._is_done = True
