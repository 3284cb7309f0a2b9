"""Items in worker processes of this machine.

Workers start as new interpreters, because a fork would inherit OpenGL contexts and threads, and are
reused: modules, GPU programs and models are loaded by the first item that needs them. A worker that
crashes, hangs or exceeds its memory is replaced, and its item is run again.
"""

from __future__ import annotations

import os
import pickle
import signal
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from dataclasses import field, replace
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.synchronize import Event
from queue import Empty, SimpleQueue
from threading import Lock
from typing import TYPE_CHECKING

from viewer.batching.engines import IN_FLIGHT, Job, Limits
from viewer.batching.items import Item, Result
from viewer.batching.worker_process import limit_memory, signals_blocked
from viewer.data_classes import dataclass
from viewer.errors import ViewerError
from viewer.interrupts import Interrupted
from viewer.media.output_checks import replacing_since
from viewer.phrases import printable

if TYPE_CHECKING:
    from types import FrameType

    from pebble import ProcessFuture, ProcessPool


_TICK = 0.2  # seconds between checks for whether the batch is stopping
_NO_MEMORY = 99  # exit code of a worker that reached its memory limit
_PATIENCE = 120.0  # seconds until a pool without a running item is replaced; doubled each time
_MOST_BREAKS = 3  # maximum number of pools that end without a result before the batch fails
_LAST_WORDS = 0.5  # seconds in which the messages of a worker that has ended are read
_RETRIED = ("crashed", "timeout", "memory")


def run(items: Iterable[Item], job: Job, limits: Limits) -> Iterator[Result]:
    """Run items in worker processes, to which the job is pickled."""
    try:
        import pebble  # noqa: F401
    except ImportError:
        raise ViewerError(
            "worker processes need pebble: pip install pebble, or use --workers 0"
        ) from None
    try:
        pickle.dumps(job)
    except (pickle.PicklingError, AttributeError, TypeError) as problem:
        raise ViewerError(
            "worker processes import the job by its name: expected a function at the top level of "
            f"a module, or workers=0 ({printable(problem)})"
        ) from None
    pool = _Workers(job, limits)
    waiting, left = iter(items), True
    try:
        while True:
            while left and len(pool.flying) < limits.workers * IN_FLIGHT and not pool.stops():
                item = next(waiting, None)
                left = item is not None
                if item is not None:
                    pool.schedule(_Attempt(item))
            if not pool.flying:
                return
            yield from pool.finished()
    finally:
        pool.close()


@dataclass(frozen=True)
class _Attempt:
    """One run of an item."""

    item: Item
    earlier: int = 0
    """Number of times that it has been started before."""
    since: float = field(default_factory=time.time)
    """Time of the first start, in seconds since 1970."""

    @property
    def arguments(self) -> tuple[Item, float | None]:
        """Arguments of ``_work``."""
        return self.item, self.since if self.earlier else None

    def again(self) -> _Attempt:
        """Return the next attempt."""
        return replace(self, earlier=self.earlier + 1)


class _Worker(SpawnProcess):
    """A worker process that refuses to start while its pool is closing."""

    owner: _Context | None = None
    _ended: float | None = None
    """When it was first found to have ended: monotonic seconds."""
    _is_dismissed = False

    def is_alive(self) -> bool:
        """Return whether it runs, or has just ended by itself."""
        # One thread of the pool looks for ended workers, and another one reads their messages. If a
        # worker crashed right after it took an item, and were found before this message is read,
        # the pool would break, or wait for the item without end.
        if super().is_alive():
            return True
        now = time.monotonic()
        self._ended = now if self._ended is None else self._ended
        return not self._is_dismissed and now < self._ended + _LAST_WORDS

    def terminate(self) -> None:
        """End the process, whose messages no longer matter."""
        self._is_dismissed = True
        super().terminate()

    def start(self) -> None:
        """Start the process; raise OSError if the pool is closing, which ends the pool's thread."""
        owner, self.owner = self.owner, None  # the object is sent to the new process
        if owner is None:
            super().start()
            return
        with owner.lock:
            if owner.is_closing:
                raise OSError("the pool is closing")
            super().start()
            owner.workers = [one for one in owner.workers if one.is_alive()] + [self]


class _Context(SpawnContext):
    """Starts workers as new interpreters, and keeps track of them."""

    def __init__(self) -> None:
        super().__init__()
        self.lock = Lock()
        self.workers: list[_Worker] = []
        self.is_closing = False

    def Process(  # type: ignore[override]  # noqa: N802  the name in multiprocessing
        self,
        target: Callable[..., object],
        name: str,
        args: tuple[object, ...],
        kwargs: dict[str, object],
    ) -> _Worker:
        """Return a worker."""
        worker = _Worker(target=target, name=name, args=args, kwargs=kwargs)
        worker.owner = self
        return worker

    def end_workers(self) -> None:
        """Terminate all workers, and start none until ``is_closing`` is reset."""
        with self.lock:
            self.is_closing = True
            for worker in self.workers:
                if worker.is_alive():
                    worker.terminate()


class _Workers:
    """A pool of workers, replaced as a whole if it breaks."""

    def __init__(self, job: Job, limits: Limits) -> None:
        self.job, self.limits = job, limits
        self.flying: dict[ProcessFuture[Result], _Attempt] = {}
        self._done: SimpleQueue[ProcessFuture[Result]] = SimpleQueue()
        self._context = _Context()
        with signals_blocked():  # creates a process that tracks semaphores
            self._is_stopping = self._context.Event()
        self._n_breaks = 0
        self._patience, self._moved = _PATIENCE, time.monotonic()
        self._pool = self._new_pool()

    def stops(self) -> bool:
        """Return whether the batch is stopping; workers then skip the queued items."""
        if not self._is_stopping.is_set() and self.limits.is_stopping():
            self._is_stopping.set()
        return self._is_stopping.is_set()

    def schedule(self, attempt: _Attempt) -> None:
        """Submit an item to the pool."""
        given, timeout = attempt.arguments, self.limits.timeout
        try:
            future = self._pool.schedule(_work, args=given, timeout=timeout)
        except RuntimeError:  # the pool broke after its last result
            self._renew()
            future = self._pool.schedule(_work, args=given, timeout=timeout)
        self.flying[future] = attempt
        done = self._done
        future.add_done_callback(lambda _: done.put(future))

    def finished(self) -> Iterator[Result]:
        """Wait for an attempt to end; yield its result unless the item is run again."""
        try:
            future = self._done.get(timeout=_TICK)
        except Empty:
            self.stops()
            self._check_stall()
            return
        self._moved = time.monotonic()
        attempt = self.flying.pop(future)
        result = self._result(future, attempt)
        if result.status == "cancelled" and not result.message:
            return  # the item was never started
        if result.status in _RETRIED and attempt.earlier < self.limits.retries and not self.stops():
            self.schedule(attempt.again())
            return
        yield replace(result, attempts=attempt.earlier + 1)

    def close(self) -> None:
        """Terminate the workers and their items."""
        self._pool.stop()  # type: ignore[no-untyped-call]
        # Done before the queue is closed, because workers that are starting would report errors.
        self._context.end_workers()
        self._pool.join()
        self._context.is_closing = False

    def _result(self, future: ProcessFuture[Result], attempt: _Attempt) -> Result:
        from pebble import ProcessExpired

        problem = future.exception()
        item = attempt.item
        if problem is None:
            self._n_breaks = 0
            return future.result()
        if isinstance(problem, TimeoutError):
            message = f"no result after {self.limits.timeout:g} s"
            return Result(item, "timeout", 2, self.limits.timeout or 0.0, message=message)
        if isinstance(problem, ProcessExpired):
            self._n_breaks = 0
            return self._expired(item, problem.exitcode)
        if isinstance(problem, BrokenProcessPool):
            self._renew()
            return Result(item, "crashed", 2, message="the worker processes ended")
        return Result(item, "failed", 1, message=f"{type(problem).__name__}: {problem}")

    def _expired(self, item: Item, code: int | None) -> Result:
        """Return the result of an item whose worker has ended."""
        if code == _NO_MEMORY:
            limit = f"{(self.limits.memory or 0) / (1 << 20):,.0f} MiB"
            return Result(item, "memory", 2, message=f"needed more memory than {limit}")
        is_ended = code in (-signal.SIGTERM, signal.SIGTERM, 128 + signal.SIGTERM)
        if is_ended and self.stops():
            return Result(item, "cancelled", 2, message="the worker process was terminated")
        return Result(item, "crashed", 2, message=f"the worker process {_end_of(code)}")

    def _renew(self) -> None:
        """Replace a broken pool; its other items are returned one by one, as crashed."""
        if self._pool.active:
            return  # replaced when its first item was returned
        self._n_breaks += 1
        if self._n_breaks >= _MOST_BREAKS:
            raise ViewerError(
                "the worker processes exit before they run any item; a script that calls "
                'viewer.batch needs the line if __name__ == "__main__": before its own work, and '
                "a function typed into an interpreter or notebook needs workers=0"
            )
        self.close()
        self._pool = self._new_pool()

    def _check_stall(self) -> None:
        """Replace a pool in which no item runs."""
        # If the system kills a worker that holds the lock of the queue, the lock is never released.
        now = time.monotonic()
        if any(future.running() for future in self.flying):
            self._moved = now
        elif now > self._moved + self._patience:
            self._patience *= 2.0
            self._moved = now
            attempts = [*self.flying.values()]
            self.flying.clear()
            self._done = SimpleQueue()
            self.close()
            self._pool = self._new_pool()
            for attempt in attempts:
                self.schedule(attempt)

    def _new_pool(self) -> ProcessPool:
        from pebble import ProcessPool

        given = (self.job, self.limits.memory, self._is_stopping)
        pool = ProcessPool(
            self.limits.workers, initializer=_prepare, initargs=given, context=self._context
        )
        # Ctrl-C and closing the terminal signal all of its processes, but the batch decides which
        # processes to end. Workers inherit the signal mask, as do the threads that start further
        # workers.
        with signals_blocked():
            _ = pool.active  # starts the pool
        return pool


def _end_of(code: int | None) -> str:
    """Return a description of how a process ended, for a message."""
    if code is not None and code < 0:
        name = signal.Signals(-code).name if -code in signal.valid_signals() else str(-code)
        often = ", probably because the system ran out of memory" if -code == signal.SIGKILL else ""
        return f"was killed by {name}{often}"
    return f"exited with {code}"


# The following functions run in the workers.

_job: Job | None = None
_stopping: Event | None = None
_is_terminated = False


def _prepare(job: Job, memory: int | None, stopping: Event) -> None:
    """Initialise a worker process."""
    global _job, _stopping
    _job, _stopping = job, stopping
    # Between items, a worker may hold the lock of the queue, which would never be released: only
    # items are interrupted. An idle worker ends when the pool closes its queue.
    signal.signal(signal.SIGTERM, _note_termination)
    if memory is not None:
        limit_memory(memory)


def _note_termination(number: int, frame: FrameType | None) -> None:
    global _is_terminated
    _is_terminated = True


def _work(item: Item, since: float | None) -> Result:
    """Run an item; a further attempt replaces outputs written ``since`` the first (else None)."""
    assert _job is not None and _stopping is not None  # set by _prepare
    if _is_terminated:
        os._exit(128 + signal.SIGTERM)
    if _stopping.is_set():
        return Result(item, "cancelled")
    try:
        with ExitStack() as stack:
            if since is not None:
                stack.enter_context(replacing_since(since))
            result = _job(item)
    except Interrupted as stop:
        # The pool ends this worker; the item's incomplete output has been removed.
        os._exit(stop.exit_code)
    if result.status == "memory":
        # Memory is now fragmented, and libraries may keep partially built objects.
        os._exit(_NO_MEMORY)
    return result
