"""Deferred handling of Ctrl-C, SIGTERM and SIGHUP.

A handler that raises may do so anywhere in Python code: inside a callback of a C library that does
not expect it (``moderngl.Context.program`` then dereferences NULL), during an import, or during
clean-up. Therefore the handler records the signal, and raises ``Interrupted`` immediately only
while pure Python or numpy code runs::

    with watched():            # the command: reading files, arrays; signals raise within it
        with deferred():       # OpenGL: recorded, raised at the end of the block
            draw()
        hold()                 # results are written: from now on only poll() raises
        for done, file in enumerate(files):
            report(done, len(files))  # polls between complete units of work
            write(file)

A signal after the last ``poll`` is too late: the work is done, and the result is success. A second
signal at least a second after the first ends a program that does not respond.

Work on many items can end gracefully: within ``postponed``, the first signal only sets a flag, so
that the running items are finished, and the second one raises as described.
"""

from __future__ import annotations

import _thread
import atexit
import os
import signal
import sys
import threading
import time
from contextlib import contextmanager

# As in ``viewer/__init__.py``: every import here delays the installation of signal handlers.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from sys import UnraisableHookArgs
    from types import FrameType
    from typing import Any


_MESSAGES = {"SIGINT": "interrupted", "SIGTERM": "terminated", "SIGHUP": "hung up"}
_SIGNALS = {
    getattr(signal, name): word for name, word in _MESSAGES.items() if hasattr(signal, name)
}
_SAME = 1.0  # seconds during which other signals count as the same request
_PAUSE = 0.02  # seconds before raising is attempted again


class Interrupted(BaseException):
    """A signal that ends the run; not an ``Exception``, so that no handler catches it."""

    def __init__(self, number: int) -> None:
        super().__init__(_SIGNALS[number])
        self.number = number

    @property
    def exit_code(self) -> int:
        """Exit code by shell convention: 130 after Ctrl-C, 143 after SIGTERM."""
        return 128 + self.number


def _replace_handlers(others: dict[int, Any], handler: Callable[..., None]) -> None:
    """Handle all signals that are not ignored; ``others`` are given their previous handlers."""
    for number in _SIGNALS:
        other = signal.getsignal(number)
        # nohup and shells ignore signals for background jobs; None is a handler in C.
        if other not in (signal.SIG_IGN, None):
            # Noted before the handler is called, which may raise.
            others[number] = other
            signal.signal(number, handler)


def _restore_handlers(others: dict[int, Any]) -> None:
    for number, other in others.items():
        signal.signal(number, other)


class _Watch:
    """The signals received between ``start`` and ``stop``, both called in the main thread."""

    def __init__(self, is_held: bool, owns_process: bool = False) -> None:
        self.number = 0  # number of the received signal; 0 if none
        self.is_held = is_held
        self._owns_process = owns_process
        self._since = 0.0
        self._is_echo = False
        self._is_over = False
        self._lock = threading.Lock()
        self._others: dict[int, Any] = {}
        self._hook = sys.unraisablehook

    def start(self) -> None:
        _replace_handlers(self._others, self._on_signal)
        self._hook, sys.unraisablehook = sys.unraisablehook, self._on_unraisable

    def stop(self) -> None:
        """Restore the previous signal handlers."""
        with self._lock:
            self._is_over = True
        sys.unraisablehook = self._hook
        _restore_handlers(self._others)

    def ignore(self) -> None:
        """Ignore signals permanently: the result is final, and the interpreter is shutting down."""
        for number in self._others:
            signal.signal(number, signal.SIG_IGN)

    def poll(self) -> None:
        if self.number and not _is_unwinding():
            raise Interrupted(self.number)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        is_echo, self._is_echo = self._is_echo, False
        if not self.number:
            self.number, self._since = number, time.monotonic()
        elif not is_echo:
            if time.monotonic() > self._since + _SAME:
                self._force(number)
            return
        if self.is_held or _is_unwinding():
            return
        if _is_importing(frame):
            self._ring_again()
        else:
            raise Interrupted(self.number)

    def _force(self, number: int) -> None:
        """End a program that does not respond; if used as a library, leave that to the caller."""
        if self._owns_process:
            os.write(2, f"viewer: {_SIGNALS[number]}\n".encode())
            os._exit(128 + number)
        self.stop()
        signal.raise_signal(number)

    def _on_unraisable(self, problem: UnraisableHookArgs, /) -> None:
        """Raise an interrupt again that Python dropped, as it does in ``__del__``."""
        if isinstance(problem.exc_value, Interrupted):
            self._ring_again()
        else:
            self._hook(problem)

    def _ring_again(self) -> None:
        timer = threading.Timer(_PAUSE, self._echo)
        timer.daemon = True
        timer.start()

    def _echo(self) -> None:
        with self._lock:
            if not self._is_over:
                self._is_echo = True
                _thread.interrupt_main(signal.Signals(self.number))


# There is only one, because signals belong to the process.
_current: _Watch | None = None


def _mine() -> _Watch | None:
    """Return the watch if called in the main thread, the only one that handles signals."""
    is_main = threading.current_thread() is threading.main_thread()
    return _current if is_main else None


@contextmanager
def watched() -> Iterator[None]:
    """Raise signals within the block as ``Interrupted``, except where deferred or held."""
    # The previous handlers are restored afterwards. Outside the main thread, this does nothing,
    # because Python handles signals only in the main thread. A signal that ``watch_program`` has
    # recorded is raised at the beginning.
    global _current
    outer = _mine()
    if outer is not None or threading.current_thread() is not threading.main_thread():
        with _held(outer, False):
            yield
        return
    watch = _current = _Watch(is_held=False)
    try:
        watch.start()
        yield
    finally:
        watch.is_held = True  # set before any call: handlers may run during each
        watch.stop()
        _current = None


def watch_program(received: Sequence[int] = ()) -> None:
    """Record signals until the process ends; they raise where they are ``watched``."""
    global _current
    watch = _current = _Watch(is_held=True, owns_process=True)
    # Registered first, so it runs last: Python resets handlers soon after, which would let a signal
    # kill a process whose work is done.
    atexit.register(watch.ignore)
    watch.start()
    if received and not watch.number:
        watch.number, watch._since = received[0], time.monotonic()


@contextmanager
def deferred() -> Iterator[None]:
    """Defer signals until the end of the block, for calls into C libraries."""
    # If no watch is active, because another program uses the package as a library, that program's
    # own handlers are called at the end.
    watch = _mine()
    if watch is not None:
        with _held(watch, True):
            yield
        if not watch.is_held:
            watch.poll()
    elif threading.current_thread() is not threading.main_thread():
        yield
    else:
        watch = _Watch(is_held=True)
        try:
            watch.start()
            yield
        finally:
            watch.stop()
            if watch.number:
                signal.raise_signal(watch.number)


@contextmanager
def raising() -> Iterator[None]:
    """Let signals raise in the block even after ``hold``, for long or blocking work."""
    with _held(_mine(), False):
        yield


class Postponed:
    """The first signal of a ``postponed`` block; 0 if there was none."""

    def __init__(self) -> None:
        self.number = 0
        self._since = 0.0
        self._others: dict[int, Any] = {}

    def start(self) -> None:
        """Replace the handlers of all signals that are not ignored."""
        _replace_handlers(self._others, self._on_signal)

    def stop(self) -> None:
        """Restore the previous handlers."""
        _restore_handlers(self._others)
        self._others = {}

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if not self.number:
            self.number, self._since = number, time.monotonic()
        elif time.monotonic() > self._since + _SAME:
            self.stop()
            signal.raise_signal(number)


@contextmanager
def postponed() -> Iterator[Postponed]:
    """Record the first signal in the block; one at least a second later acts as usual."""
    # Outside the main thread, no signal is received.
    signals = Postponed()
    is_main = threading.current_thread() is threading.main_thread()
    try:
        if is_main:
            signals.start()
        yield signals
    finally:
        if is_main:
            signals.stop()


@contextmanager
def _held(watch: _Watch | None, is_held: bool) -> Iterator[None]:
    if watch is None:
        yield
        return
    before, watch.is_held = watch.is_held, is_held
    try:
        if not is_held:
            watch.poll()
        yield
    finally:
        watch.is_held = before


def hold() -> None:
    """Defer signals until the end of the enclosing block: from now on only ``poll`` raises."""
    watch = _mine()
    if watch is not None:
        watch.is_held = True


def poll(in_any_thread: bool = False) -> None:
    """Raise a deferred signal, at a point between complete units of work."""
    watch = _current if in_any_thread else _mine()
    if watch is not None:
        watch.poll()


def _is_importing(frame: FrameType | None) -> bool:
    """Return whether a module is being imported; import code may replace exceptions."""
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def _is_unwinding() -> bool:
    """Return whether the signal has already been raised and clean-up is in progress."""
    problem = sys.exc_info()[1]
    while problem is not None:
        if isinstance(problem, Interrupted):
            return True
        problem = problem.__context__
    return False
