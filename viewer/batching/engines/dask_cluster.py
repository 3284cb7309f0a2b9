"""Items on the workers of a Dask cluster: on this machine, at an address, or in SLURM jobs.

Only a few items are assigned to each worker at a time, so that millions need no queue. If a worker
dies, its items are run again elsewhere; an item that repeatedly kills its worker is reported.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import CancelledError
from dataclasses import astuple, replace
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING
from uuid import uuid4

from viewer.batching.engines import Job, Limits
from viewer.batching.engines._cluster_text import parse_cluster
from viewer.batching.engines._remote import ENDED, Call, OtherVersion, run_item
from viewer.batching.items import Item, Result
from viewer.data_classes import dataclass
from viewer.errors import ViewerError
from viewer.phrases import printable
from viewer.version import VERSION

if TYPE_CHECKING:
    from distributed import Client, Future, KilledWorker

__all__ = ["run"]

_TICK = 0.2  # seconds between checks for whether the batch is stopping
_PER_WORKER = 3  # items assigned to each worker: one runs while the next ones are transferred
_COUNT_EVERY = 1.0  # seconds between counts of the workers, which join and leave
_ALONE = 60.0  # seconds without any worker before the batch fails
_RETRIED = ("crashed", "timeout", "memory")


def run(items: Iterable[Item], job: Job, limits: Limits) -> Iterator[Result]:
    """Run items on a cluster.

    Raises
    ------
    ViewerError
        If Dask is missing, the cluster can't be reached or started, or a worker lacks this version
        of the viewer.
    """
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise ViewerError(
            "--cluster needs Dask: pip install skinning-viewer[batch], or use --workers without it"
        ) from None
    from viewer.batching.engines._clusters import connected

    with connected(parse_cluster(limits.cluster or "local"), limits) as client:
        flight = _Flight(client, job, limits)
        waiting, left = iter(items), True
        try:
            while True:
                flight.count_workers()
                while left and not flight.stops() and flight.has_room():
                    item = next(waiting, None)
                    left = item is not None
                    if item is not None:
                        flight.start(_Attempt(item))
                if not flight.flying and (not left or flight.stops()):
                    return
                yield from flight.finished()
        finally:
            client.cancel([*flight.flying], force=True)


@dataclass(frozen=True)
class _Attempt:
    """An item, and the number of workers that died while running it."""

    item: Item
    earlier: int = 0


class _Flight:
    """The attempts that have been submitted to a cluster."""

    def __init__(self, client: Client, job: Job, limits: Limits) -> None:
        import cloudpickle

        self.client, self.limits = client, limits
        self.flying: dict[Future, _Attempt] = {}
        self._job = cloudpickle.dumps(job)  # unlike pickle, supports functions of notebooks
        self._done: SimpleQueue[Future] = SimpleQueue()
        self._batch = f"viewer-{uuid4().hex[:8]}-"
        self._numbers = itertools.count()
        self._n_workers, self._counted, self._seen = 0, -_COUNT_EVERY, time.monotonic()
        # SLURM starts jobs when resources are free, and local workers are replaced.
        self._can_wait = parse_cluster(limits.cluster or "local").kind != "address"
        self._resources: dict[str, float] | None = None
        self._uses_gpu = bool(getattr(job, "uses_gpu", False))
        self._is_stopping = False

    def count_workers(self) -> None:
        """Update the number of workers, which changes while the batch runs.

        Raises ViewerError if a scheduler has had no workers for a minute.
        """
        now = time.monotonic()
        if now < self._counted + _COUNT_EVERY:
            return
        workers = self.client.scheduler_info(n_workers=-1)["workers"].values()
        with_gpu = [one for one in workers if one["resources"].get("GPU")]
        # If any workers declare GPUs, only these draw.
        self._resources = {"GPU": 1} if with_gpu and self._uses_gpu else None
        self._n_workers = len(with_gpu if self._resources else workers)
        self._counted = now
        if workers or self._can_wait:
            self._seen = now
        elif now > self._seen + _ALONE:
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
            started = {key for keys in self.client.processing().values() for key in keys}
            dropped = [future for future in self.flying if future.key not in started]
            for future in dropped:
                del self.flying[future]
            self.client.cancel(dropped)
        return self._is_stopping

    def start(self, attempt: _Attempt) -> None:
        """Submit an item to the cluster."""
        import pickle

        number = next(self._numbers)
        key = f"{self._batch}{number}"
        call = Call(self._job, pickle.dumps(attempt.item), self.limits.timeout, self.limits.memory)
        future = self.client.submit(
            run_item,
            VERSION,
            key,
            astuple(call),
            key=key,
            pure=False,
            priority=-number,
            resources=self._resources,
        )
        self.flying[future] = attempt
        future.add_done_callback(self._done.put)

    def finished(self) -> Iterator[Result]:
        """Wait for attempts to end; yield the results of those that are not started again."""
        done = []
        try:
            done.append(self._done.get(timeout=_TICK))
            while True:
                done.append(self._done.get_nowait())
        except Empty:
            pass
        results = self._results([future for future in done if future in self.flying])
        for future, result in results:
            attempt = self.flying.pop(future)
            if result is None:
                self.start(attempt)  # another item ended the worker
            elif self._is_retried(result, attempt):
                self.start(_Attempt(attempt.item, attempt.earlier + result.attempts))
            else:
                yield replace(result, attempts=attempt.earlier + result.attempts)

    def _is_retried(self, result: Result, attempt: _Attempt) -> bool:
        is_left = attempt.earlier + result.attempts <= self.limits.retries
        return result.status in _RETRIED and is_left and not self.stops()

    def _results(self, done: list[Future]) -> list[tuple[Future, Result | None]]:
        """Return the result of an attempt that ended; None if the item itself was not at fault."""
        finished: list[Future] = []
        ended: list[Future] = []
        for future in done:
            (finished if future.status == "finished" else ended).append(future)
        try:
            answers = self.client.gather(finished)
        except (OSError, CancelledError):
            raise _lost() from None
        for answer in answers:
            if isinstance(answer, OtherVersion):
                raise _other_version(answer)
        return [*zip(finished, answers, strict=True), *((one, self._failure(one)) for one in ended)]

    def _failure(self, future: Future) -> Result | None:
        """Return the result of an item that no worker has finished."""
        from distributed import KilledWorker

        item = self.flying[future].item
        if future.status == "cancelled":
            raise _lost()
        if future.status != "error":
            return None  # the worker that held the result has died
        problem = future.exception()
        if isinstance(problem, KilledWorker):
            return self._killed(item, future, problem)
        if isinstance(problem, ModuleNotFoundError) and (problem.name or "").startswith("viewer"):
            raise ViewerError(
                f"--cluster: a worker has no viewer {VERSION} ({printable(problem)}): "
                "install the same version in the environment of all workers"
            )
        reason = printable(f"{type(problem).__name__}: {problem}", 2000)
        return Result(item, "failed", 1, message=reason)

    def _killed(self, item: Item, future: Future, problem: KilledWorker) -> Result | None:
        address = problem.last_worker.address
        attempts = problem.allowed_failures + 1
        if future.key in {event["key"] for _, event in self.client.get_events(ENDED)}:
            message = f"no result after {self.limits.timeout:g} s"
            return Result(item, "timeout", 2, self.limits.timeout or 0.0, attempts, message)
        if future.key != self._first_on(address):
            return None
        return Result(item, "crashed", 2, attempts=attempts, message=f"the worker {address} died")

    def _first_on(self, address: str) -> str:
        """Return the attempt that a worker was running when it died; it runs them in order."""
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


def _other_version(answer: OtherVersion) -> ViewerError:
    return ViewerError(
        f"--cluster: the worker {answer.worker} has viewer {printable(answer.version, 40)}, "
        f"expected {VERSION}: install the same version on all workers"
    )
