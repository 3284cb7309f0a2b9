"""Execution of items on a cluster's worker: version check, cached job, time and memory limits."""

from __future__ import annotations

import os
import pickle
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

from viewer.batching.engines import Job
from viewer.batching.engines._task_size import LONGEST
from viewer.batching.items import Item, Result
from viewer.batching.worker_process import limit_memory, name_worker
from viewer.data_classes import dataclass
from viewer.media.output_checks import replacing_since
from viewer.version import VERSION

ENDED = "viewer-ended"
"""Topic of events on the scheduler: attempts ended by their time limit."""

_SETTLE = 0.5  # seconds in which a worker that ends itself can send its last event
_FAILED = 70  # exit code of a worker that ends itself

# A worker runs one item at a time even if it has several threads: output is captured, and
# diagnostics are recorded, for the process as a whole.
_lock = threading.Lock()


@dataclass(frozen=True, slots=True)
class Call:
    """A request to a worker; pickled, because another version may be unable to load it."""

    job: bytes
    items: bytes
    """Pickled; a tuple of items, each with the time at which it was first submitted, in seconds
    since 1970. The scheduler reruns tasks whose worker died without reporting it; outputs that
    are newer than this time are then replaced."""
    folder: str
    """Working directory of the batch, to which paths are relative."""
    timeout: float | None = None
    memory: int | None = None
    """As in ``Limits``, for each item."""


@dataclass(frozen=True, slots=True)
class Reply:
    """The results of a task."""

    worker: str
    """Address of the worker."""
    results: list[Result]
    """Results of the first items, at least one; the other items were not started."""
    seconds: float
    """Time that they took."""
    missing: str = ""
    """An input that does not exist on the worker; empty if there is none."""


@dataclass(frozen=True, slots=True)
class OtherVersion:
    """The reply of a worker that has another version of the package."""

    worker: str
    version: str


@dataclass(frozen=True, slots=True)
class NoFolder:
    """The reply of a worker that cannot enter the working directory of the batch."""

    worker: str
    reason: str


def run_items(version: str, key: str, call: tuple[Any, ...]) -> Reply | OtherVersion | NoFolder:
    """Run items one after another in a thread of a worker; ``call`` is the values of a ``Call``."""
    from distributed import get_worker

    worker = get_worker()
    if version != VERSION:
        return OtherVersion(worker.address, VERSION)
    asked = Call(*call)
    items: tuple[tuple[Item, float], ...] = pickle.loads(asked.items)
    with _lock:
        before = os.getcwd()
        try:
            os.chdir(asked.folder)
        except OSError as problem:
            paths = (path for item, _ in items for path in (*item.files, item.output))
            if not all(map(os.path.isabs, filter(None, paths))):
                return NoFolder(worker.address, problem.strerror or "")
        try:
            job = _job(asked.job)  # not part of an item: its modules may take long to load
            start = time.monotonic()
            results, missing = [], ""
            name_worker(worker.name)
            if asked.memory is not None:
                limit_memory(asked.memory)
            for number, (item, since) in enumerate(items):
                with _ended_after(asked.timeout, worker, key, number), replacing_since(since):
                    result = job(item)
                results.append(result)
                if result.status == "failed":
                    absent = (file for file in item.files if not os.path.lexists(file))
                    missing = missing or next(absent, "")
                if time.monotonic() > start + LONGEST:
                    break
            return Reply(worker.address, results, time.monotonic() - start, missing)
        finally:
            os.chdir(before)


@lru_cache(1)
def _job(pickled: bytes) -> Job:
    """Return the job; it is reused for the next items, along with everything that it has cached."""
    job: Job = pickle.loads(pickled)
    return job


@contextmanager
def _ended_after(timeout: float | None, worker: Any, key: str, number: int) -> Iterator[None]:
    """End this process if the block exceeds its time limit: a thread can't be interrupted."""
    if timeout is None:
        yield
        return

    def end() -> None:
        worker.log_event(ENDED, {"key": key, "item": number, "status": "timeout"})
        time.sleep(_SETTLE)
        os._exit(_FAILED)

    timer = threading.Timer(timeout, end)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
