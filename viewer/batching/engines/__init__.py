"""Engines that run the items of a batch: in this process, in local workers, on a cluster.

Each module has ``run(items, job, limits)``, a generator of results in the order in which they
finish. Engines take items only when they can run them, so that a batch of millions needs no queue.
Once ``limits.is_stopping()`` is true, they start no more items and finish the running ones. Closing
the generator cancels the running items.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from importlib import import_module
from typing import Protocol

from viewer.batching.items import Item, Result
from viewer.data_classes import dataclass

IN_FLIGHT = 4
"""Number of items assigned to each worker, including the one that runs."""

ENGINES = {
    "sequential": "in this process",
    "processes": "in worker processes of this machine, by pebble",
    "dask_cluster": "on a Dask cluster",
}
"""Where the items of each engine run."""


class Job(Protocol):
    """A picklable callable that returns a result for any item; see ``execution.attempt``."""

    def __call__(self, item: Item) -> Result:
        """Run one item in this process."""
        ...


def _never() -> bool:
    return False


def _ignore(text: str) -> None:
    pass


@dataclass(frozen=True)
class Limits:
    """Limits of a batch."""

    workers: int = 1
    """Number of worker processes; engines that run in this process ignore it."""
    retries: int = 2
    """Number of times an item is retried after its worker crashed, hung or ran out of memory."""
    timeout: float | None = None
    """Seconds after which the worker of an attempt is terminated; None for no limit."""
    memory: int | None = None
    """Bytes that a worker may allocate; None for no limit."""
    cluster: str = ""
    """Cluster as given to ``--cluster``; empty for this machine."""
    is_stopping: Callable[[], bool] = _never
    """Returns whether no more items are to be started."""
    note: Callable[[str], None] = _ignore
    """Called with messages about workers, such as that none has started yet."""


class Engine(Protocol):
    """A module of this folder."""

    def run(self, items: Iterable[Item], job: Job, limits: Limits) -> Iterator[Result]:
        """Run items; yield one result per item that was started, as they finish."""
        ...


def load_engine(name: str) -> Engine:
    """Return an engine by its key in ``ENGINES``."""
    engine: Engine = import_module(f"viewer.batching.engines.{name}")
    return engine
