"""Clusters of Dask: started on this machine or by SLURM, or joined by address."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from viewer.batching.engines import Limits
from viewer.batching.engines._cluster_text import ClusterName
from viewer.batching.engines._process_limits import signals_blocked
from viewer.batching.engines._slurm import SlurmJobs, slurm_cluster
from viewer.errors import ViewerError
from viewer.phrases import printable

if TYPE_CHECKING:
    from distributed import Client

__all__ = ["Check", "connected"]

_CONNECT = 10.0  # time limit for connecting to a scheduler, seconds
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
}


Check = Callable[[Iterable[str]], None]
"""Called with the names of the connected workers; replaces workers that have ended."""


@contextmanager
def connected(name: ClusterName, limits: Limits) -> Iterator[tuple[Client, Check]]:
    """Connect to a cluster; shut it down at the end if it was started here.

    Raises
    ------
    ViewerError
        If no scheduler answers, or the cluster can't be started.
    """
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
            with signals_blocked(), dask.config.set(_CONFIG):
                if name.kind == "local":
                    target = _local_cluster(limits, folder)
                else:
                    target = slurm_cluster(name, limits.memory, _CONFIG)
            stack.enter_context(target)
            if name.kind == "slurm":
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
    """Do nothing: Dask restarts the workers of this machine, and others belong to the user."""


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
