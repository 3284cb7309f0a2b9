"""Items on the workers of a Dask cluster: on this machine, at an address, or in SLURM jobs.

Only a few tasks are assigned to each worker at a time, so that millions of items need no queue. If
a worker dies, its items are run again elsewhere; an item that repeatedly kills its worker is
reported.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import operator
import os
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager
from dataclasses import astuple, field, replace
from queue import Empty, SimpleQueue
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from viewer.batching.engines import Job, Limits
from viewer.batching.engines._cluster_text import ClusterName, parse_cluster
from viewer.batching.engines._remote import ENDED, Call, NoFolder, OtherVersion, Reply, run_items
from viewer.batching.engines._slurm import SlurmJobs, slurm_cluster
from viewer.batching.engines._task_size import TaskSize
from viewer.batching.items import Item, Result
from viewer.batching.worker_process import signals_blocked
from viewer.data_classes import dataclass
from viewer.errors import ViewerError
from viewer.media.unfinished import remove_leftovers
from viewer.phrases import printable
from viewer.version import VERSION

if TYPE_CHECKING:
    from distributed import Client, Future, KilledWorker

_TICK = 0.2  # seconds between checks for whether the batch is stopping
_PER_WORKER = 3  # tasks assigned to each worker: one runs while the next ones are transferred
_COUNT_EVERY = 1.0  # seconds between counts of the workers, which join and leave
_ALONE = 60.0  # seconds without any worker before the batch fails
_RESTARTING = 240.0  # the same for local workers, which are replaced
_ABSENT = 90.0  # seconds after which an absent local worker is replaced: Dask waits for it for 60 s
_RETRIED = ("crashed", "timeout", "memory")
_CONNECT = 10.0  # time limit for connecting to a scheduler, seconds
_FETCH = 10.0  # seconds after which results are asked for again; they are a few kB each
_ONE_THREAD = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")

# The batch itself counts retries and tracks which items a worker had started.
_CONFIG = {
    "distributed.scheduler.allowed-failures": 0,
    "distributed.scheduler.worker-saturation": 1.0,
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    # Without Dask's MALLOC_TRIM_THRESHOLD_: it returns freed memory, so new arrays cause page
    # faults.
    "distributed.nanny.pre-spawn-environ": dict.fromkeys(_ONE_THREAD, 1),
    # These poll the workers many times a second, which takes at least a tenth of the time of short
    # items.
    "distributed.worker.profile.enabled": False,
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.admin.tick.interval": "1s",
    "distributed.scheduler.active-memory-manager.start": False,
    # On a busy machine, a worker needs longer to restart than the default of 15 s, after which Dask
    # gives it up.
    "distributed.deploy.lost-worker-timeout": "60s",
}


def run(items: Iterable[Item], job: Job, limits: Limits) -> Iterator[Result]:
    """Run items on a cluster, whose workers must have this version of the viewer."""
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise ViewerError(
            "--cluster needs Dask: pip install dask distributed, or use --workers without --cluster"
        ) from None

    with _connected(parse_cluster(limits.cluster or "local"), limits) as (client, check):
        flight = _Flight(client, check, iter(items), job, limits)
        try:
            while True:
                flight.count_workers()
                # Also checked if there is no room: no worker may have started yet.
                while not flight.stops() and flight.has_room() and flight.starts_next():
                    pass
                if not flight.flying:
                    remove_leftovers(flight.unfinished)
                    return
                yield from flight.finished()
        finally:
            client.cancel([*flight.flying], force=True)


@dataclass(frozen=True)
class _Attempt:
    """One run of an item."""

    item: Item
    earlier: int = 0
    """Number of workers that died while running it."""
    is_alone: bool = False
    """Whether it is a task of its own, which shows whether it ends its worker."""
    since: float = field(default_factory=time.time)
    """Time of its first submission, in seconds since 1970."""


_Task = tuple[_Attempt, ...]


class _Flight:
    """The submitted tasks of a cluster; each runs one item, or several short ones."""

    # If a worker dies, the items of the task that it was running are run again one by one,
    # including those that had finished, as their results are lost.

    def __init__(
        self, client: Client, check: Check, items: Iterator[Item], job: Job, limits: Limits
    ) -> None:
        import cloudpickle

        self.client, self.limits, self._check = client, limits, check
        self.flying: dict[Future, _Task] = {}
        self.unfinished: list[str] = []  # outputs that a dead worker may have been writing
        self._items, self._again = items, deque[_Attempt]()
        self._size = TaskSize()
        self._checks = WorkerChecks(limits.note)
        self._job = cloudpickle.dumps(job)  # unlike pickle, supports functions of notebooks
        self._done: SimpleQueue[Future] = SimpleQueue()
        self._batch = f"viewer-{uuid4().hex[:8]}-"
        self._numbers = itertools.count()
        self._n_workers, self._counted, self._seen = 0, -_COUNT_EVERY, time.monotonic()
        self._kind = parse_cluster(limits.cluster or "local").kind
        self._resources: dict[str, float] | None = None
        self._uses_gpu = bool(getattr(job, "uses_gpu", False))
        self._is_stopping = False

    def count_workers(self) -> None:
        """Update the number of workers; raise if there have been none for long."""
        now = time.monotonic()
        if now < self._counted + _COUNT_EVERY:
            return
        workers = self.client.scheduler_info(n_workers=-1)["workers"].values()
        self._check([str(one["name"]) for one in workers])
        with_gpu = [one for one in workers if one["resources"].get("GPU")]
        # If any workers declare GPUs, only these draw.
        self._resources = {"GPU": 1} if with_gpu and self._uses_gpu else None
        self._n_workers = len(with_gpu if self._resources else workers)
        self._counted = now
        # SLURM starts jobs when resources are free, which may take days.
        if workers or self._kind == "slurm":
            self._seen = now
        elif self._kind == "local" and now > self._seen + _RESTARTING:
            raise ViewerError(
                f"--cluster local: no worker has started for {_RESTARTING:g} s; use --resume to "
                "continue"
            )
        elif self._kind == "address" and now > self._seen + _ALONE:
            raise ViewerError(
                f"--cluster: the scheduler has had no workers for {_ALONE:g} s; start some with: "
                f"dask worker {self.limits.cluster} --nthreads 1"
            )

    def has_room(self) -> bool:
        """Return whether workers are idle, or soon will be."""
        return len(self.flying) < max(self._n_workers, 1) * _PER_WORKER

    def stops(self) -> bool:
        """Return whether the batch is stopping; items not yet sent to a worker are then dropped."""
        if not self._is_stopping and self.limits.is_stopping():
            self._is_stopping = True
            self._again.clear()
            started = {key for keys in self.client.processing().values() for key in keys}
            # Asked for second, so that a task that ends in the meantime is found here.
            held = {key for key, workers in self.client.who_has([*self.flying]).items() if workers}
            dropped = [one for one in self.flying if one.key not in started | held]
            for future in dropped:
                del self.flying[future]
            self.client.cancel(dropped)
        return self._is_stopping

    def starts_next(self) -> bool:
        """Submit the next task; return whether there was one."""
        task = self._next_task()
        if not task:
            return False
        import pickle

        number = next(self._numbers)
        key = f"{self._batch}{number}"
        items = pickle.dumps(tuple((attempt.item, attempt.since) for attempt in task))
        call = Call(self._job, items, os.getcwd(), self.limits.timeout, self.limits.memory)
        future = self.client.submit(
            run_items,
            VERSION,
            key,
            astuple(call),
            key=key,
            pure=False,
            priority=-number,
            resources=self._resources,
        )
        self.flying[future] = task
        future.add_done_callback(self._done.put)
        return True

    def _next_task(self) -> _Task:
        if self._again and self._again[0].is_alone:
            return (self._again.popleft(),)
        n_left = operator.length_hint(self._items) + len(self._again)
        size, task = self._size.now(n_left, self._n_workers), list[_Attempt]()
        while len(task) < size and self._again and not self._again[0].is_alone:
            task.append(self._again.popleft())
        task += map(_Attempt, itertools.islice(self._items, size - len(task)))
        return tuple(task)

    def finished(self) -> Iterator[Result]:
        """Wait for tasks to end; yield the results of items that are not run again."""
        done = []
        try:
            done.append(self._done.get(timeout=_TICK))
            while True:
                done.append(self._done.get_nowait())
        except Empty:
            pass
        for attempt, result in self._results([future for future in done if future in self.flying]):
            n_attempts = attempt.earlier + result.attempts
            if self._is_retried(result, n_attempts):
                self._again.append(replace(attempt, earlier=n_attempts, is_alone=True))
            else:
                yield replace(result, attempts=n_attempts)

    def _is_retried(self, result: Result, n_attempts: int) -> bool:
        is_left = n_attempts <= self.limits.retries
        return result.status in _RETRIED and is_left and not self.stops()

    def _results(self, done: list[Future]) -> list[tuple[_Attempt, Result]]:
        """Return the results of tasks that ended; items without a result are run again."""
        finished = [future for future in done if future.status == "finished"]
        try:
            replies = self._fetched(finished)
        except TimeoutError:
            # Their worker has died. The tasks may have to wait for another one, which only
            # ``count_workers`` starts.
            for future in done:
                future.add_done_callback(self._done.put)
            return []
        except (OSError, CancelledError):
            raise _lost() from None
        except Exception:
            # The scheduler ran a task again because its result was lost, and then it failed.
            if all(future.status == "finished" for future in finished):
                raise
            return self._results(done)
        results: list[tuple[_Attempt, Result]] = []
        for future, reply in zip(finished, replies, strict=True):
            accepted = self._checks.accepted(reply)
            task = self.flying.pop(future)
            self._size.add(accepted.seconds, len(accepted.results))
            results += zip(task, accepted.results, strict=False)
            self._again.extend(task[len(accepted.results) :])
        for future in done:
            if future in self.flying:
                results += self._failure(future, self.flying.pop(future))
        return results

    def _fetched(self, finished: list[Future]) -> list[Reply | OtherVersion | NoFolder]:
        """Return the replies of finished tasks; raise TimeoutError if they do not arrive."""
        fetching = asyncio.run_coroutine_threadsafe(
            self.client.gather(finished, asynchronous=True), self.client.loop.asyncio_loop
        )
        try:
            return fetching.result(_FETCH)
        finally:
            fetching.cancel()

    def _failure(self, future: Future, task: _Task) -> list[tuple[_Attempt, Result]]:
        """Return the result of the item due to which no worker has finished a task, if known."""
        from distributed import KilledWorker

        if future.status == "cancelled":
            raise _lost()
        problem = future.exception() if future.status == "error" else None
        if isinstance(problem, ModuleNotFoundError) and (problem.name or "").startswith("viewer"):
            raise ViewerError(
                f"--cluster: a worker has no viewer {VERSION} ({printable(problem)}): "
                "install the same version in the environment of all workers"
            )
        self.unfinished += [attempt.item.output for attempt in task if attempt.item.output]
        if problem is None:
            self._again.extend(task)  # the worker that held the results has died
            return []
        self._size.restart()
        if isinstance(problem, KilledWorker):
            return self._killed(future, task, problem)
        if self._is_split(task):
            return []
        reason = printable(f"{type(problem).__name__}: {problem}", 2000)
        return [(task[0], Result(task[0].item, "failed", 1, message=reason))]

    def _is_split(self, task: _Task) -> bool:
        """Have the items of a task run again one by one; return False if there is only one."""
        if len(task) > 1:
            self._again.extend(replace(attempt, is_alone=True) for attempt in task)
        return len(task) > 1

    def _killed(
        self, future: Future, task: _Task, problem: KilledWorker
    ) -> list[tuple[_Attempt, Result]]:
        address = problem.last_worker.address
        count = problem.allowed_failures + 1
        number = self._hung(future.key)
        if number is not None:
            attempt = task[number]
            self._again.extend(task[:number] + task[number + 1 :])
            limit = self.limits.timeout or 0.0
            message = f"no result after {limit:g} s"
            return [(attempt, Result(attempt.item, "timeout", 2, limit, count, message))]
        if future.key != self._first_on(address):
            self._again.extend(task)  # another task ended the worker
            return []
        if self._is_split(task):
            return []
        item, message = task[0].item, f"the worker {address} died"
        return [(task[0], Result(item, "crashed", 2, attempts=count, message=message))]

    def _hung(self, key: str) -> int | None:
        """Return the position of the item of a task that exceeded its time limit, if one did."""
        events = [event for _, event in self.client.get_events(ENDED) if event["key"] == key]
        return events[-1]["item"] if events else None

    def _first_on(self, address: str) -> str:
        """Return the task that a worker was running when it died; it runs them in order."""
        keys = [
            key
            for _, event in self.client.get_events(address)
            if event["action"] == "remove-worker"
            for key in event["processing-tasks"]
            if key.startswith(self._batch)
        ]
        return min(keys, key=_number, default="")


def _number(key: str) -> int:
    return int(key.rpartition("-")[2])


def _lost() -> ViewerError:
    return ViewerError("--cluster: the scheduler disconnected; use --resume to continue")


Check = Callable[[Iterable[str]], None]
"""Called with the names of the connected workers; replaces workers that have ended."""


@contextmanager
def _connected(name: ClusterName, limits: Limits) -> Iterator[tuple[Client, Check]]:
    """Connect to a cluster; shut it down at the end if it was started here."""
    import dask
    from distributed import Client
    from distributed.utils import silence_logging_cmgr

    check: Check = _nothing_to_replace
    with ExitStack() as stack:
        # Lost connections become messages; Dask would also print tracebacks.
        stack.enter_context(silence_logging_cmgr(logging.CRITICAL))
        target: Any = name.address
        if name.kind != "address":
            # Workers inherit blocked signals: Ctrl-C reaches all processes of a terminal, but the
            # batch decides which items are finished.
            folder = stack.enter_context(TemporaryDirectory(prefix="viewer-dask-"))
            stack.enter_context(dask.config.set(_CONFIG))  # also read when workers are replaced
            with signals_blocked():
                if name.kind == "local":
                    target = _local_cluster(limits, folder)
                else:
                    target = slurm_cluster(name, limits.memory, _CONFIG)
            stack.enter_context(target)
            if name.kind == "local":
                check = _LocalWorkers(target, limits.workers).check
            else:
                check = SlurmJobs(target, limits.workers, limits.note).check
        try:
            with signals_blocked():
                client = Client(target, timeout=_CONNECT, set_as_default=False)
        except (OSError, ValueError) as problem:
            raise ViewerError(
                f"--cluster: no scheduler answers at {printable(target, 100)} "
                f"({printable(problem, 200)})"
            ) from None
        yield stack.enter_context(client), check


def _nothing_to_replace(workers: Iterable[str]) -> None:
    """Do nothing: these workers belong to the user."""


class _LocalWorkers:
    """The workers of a local cluster, of which those that have ended are replaced."""

    def __init__(self, cluster: Any, n_workers: int) -> None:
        self._cluster, self._n_workers = cluster, n_workers
        self._seen: dict[Any, float] = {}
        """When each worker was connected last, or else was first missed: monotonic seconds."""

    def check(self, connected: Iterable[str]) -> None:
        """Start new workers for those that Dask has given up, or does not know to have ended."""
        names, now = set(connected), time.monotonic()
        wanted = list(self._cluster.worker_spec)
        self._seen = {
            name: now if str(name) in names else self._seen.get(name, now) for name in wanted
        }
        # Dask does not notice if a worker ends in the instant after its start, before its nanny
        # watches it. The nanny is closed as soon as it has no spec; a new spec gets the same name,
        # so if it came earlier, it would be taken for the old nanny's.
        absent = [name for name in wanted if now > self._seen[name] + _ABSENT]
        for name in absent:
            del self._cluster.worker_spec[name]
        if absent:
            self._cluster.scale(len(self._cluster.worker_spec))
        elif len(self._cluster.workers) < self._n_workers:
            self._cluster.scale(self._n_workers)


def _local_cluster(limits: Limits, folder: str) -> Any:
    from distributed import LocalCluster

    try:
        return LocalCluster(
            n_workers=limits.workers,
            threads_per_worker=1,
            processes=True,
            memory_limit=None,
            dashboard_address="127.0.0.1:0",
            local_directory=folder,
            silence_logs=logging.CRITICAL,
        )
    except RuntimeError as problem:
        raise ViewerError(
            f"--cluster local: the workers do not start ({printable(problem, 200)}); a script that "
            'calls viewer.batch needs the line if __name__ == "__main__": before its own work'
        ) from None


class WorkerChecks:
    """Checks of the replies of workers."""

    def __init__(self, note: Callable[[str], None]) -> None:
        self._note = note
        # Workers and the folders in which an output of theirs has been found; "" for a worker that
        # wrote one elsewhere, of which one note is enough.
        self._found: set[tuple[str, str]] = set()

    def accepted(self, reply: Reply | OtherVersion | NoFolder) -> Reply:
        """Return the reply of a worker with this version that can read the files of the batch."""
        if isinstance(reply, OtherVersion):
            raise ViewerError(
                f"--cluster: the worker {reply.worker} has viewer {printable(reply.version, 40)}, "
                f"expected {VERSION}: install the same version on all workers"
            )
        if isinstance(reply, NoFolder):
            raise ViewerError(
                f"--cluster: the worker {reply.worker} cannot enter {printable(os.getcwd(), 300)} "
                f"({printable(reply.reason, 100)}): start the batch in a folder that all workers "
                "share"
            )
        if reply.missing and os.path.lexists(reply.missing):
            raise ViewerError(
                f"--cluster: the worker {reply.worker} cannot find "
                f"{printable(os.path.abspath(reply.missing), 300)}: workers need access to the "
                "inputs under the same paths"
            )
        for one in reply.results:
            for path in one.outputs:
                self._check_output(reply.worker, path)
        return reply

    def _check_output(self, worker: str, path: str) -> None:
        """Note that the first output of a worker in a folder does not exist on this machine."""
        folder = os.path.dirname(path) or "."
        if not self._found.isdisjoint({(worker, folder), (worker, "")}):
            return
        with contextlib.suppress(OSError):
            # This updates the cache of a network file system.
            os.listdir(folder)
        is_found = os.path.lexists(path)
        self._found.add((worker, folder if is_found else ""))
        if not is_found:
            self._note(
                f"the worker {worker} wrote {printable(path, 300)}, which does not exist on this "
                "machine: write outputs to a folder that all workers share"
            )
