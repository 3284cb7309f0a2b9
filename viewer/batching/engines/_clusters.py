"""Clusters of Dask: started on this machine or by SLURM, or joined by address."""

from __future__ import annotations

import logging
import signal
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from viewer.batching.engines import Limits
from viewer.batching.engines._cluster_text import ClusterName
from viewer.batching.engines._process_limits import signals_blocked
from viewer.errors import ViewerError
from viewer.phrases import printable

if TYPE_CHECKING:
    from dask_jobqueue import SLURMCluster
    from distributed import Client

__all__ = ["connected", "slurm_cluster"]

_CONNECT = 10.0  # time limit for connecting to a scheduler, seconds
_MEMORY = 4 << 30  # bytes per worker that a SLURM job requests by default
_GPU_OPTIONS = ("gpus", "gres", "gpus-per-node", "gpus-per-task")
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


@contextmanager
def connected(name: ClusterName, limits: Limits) -> Iterator[Client]:
    """Connect to a cluster; shut it down at the end if it was started here.

    Raises
    ------
    ViewerError
        If no scheduler answers, or the cluster can't be started.
    """
    import dask
    from distributed import Client

    with ExitStack() as stack:
        target: Any = name.address
        if name.kind != "address":
            # Workers inherit blocked signals: Ctrl-C reaches all processes of a terminal, but the
            # batch decides which items are finished.
            folder = stack.enter_context(TemporaryDirectory(prefix="viewer-dask-"))
            with signals_blocked(), dask.config.set(_CONFIG):
                if name.kind == "local":
                    target = _local_cluster(limits, folder)
                else:
                    target = _slurm(name, limits)
            stack.enter_context(target)
        try:
            with signals_blocked():
                client = Client(target, timeout=_CONNECT, set_as_default=False)
        except (OSError, ValueError) as problem:
            raise ViewerError(
                f"--cluster: no scheduler answers at {printable(target, 100)} "
                f"({printable(problem, 200)})"
            ) from None
        yield stack.enter_context(client)


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


def _slurm(name: ClusterName, limits: Limits) -> SLURMCluster:
    import shutil

    if shutil.which("sbatch") is None:
        raise ViewerError(
            "--cluster slurm: sbatch was not found: run this on a login node, or submit an array "
            "job of shards (viewer help batches)"
        )
    cluster = slurm_cluster(name, limits)
    cluster.scale(n=limits.workers)
    return cluster


def slurm_cluster(name: ClusterName, limits: Limits) -> SLURMCluster:
    """Return a cluster whose workers are SLURM jobs; none is submitted yet.

    The options ``partition``, ``account``, ``time``, ``mem``, ``cpus`` (workers per job) and
    ``interface`` are those of the job's workers; all others are passed to ``sbatch``.

    Raises
    ------
    ViewerError
        If dask-jobqueue is missing, or ``cpus`` is not a positive integer.
    """
    try:
        with _handlers_kept():  # the import replaces the handler of Ctrl-C
            from dask_jobqueue import SLURMCluster
    except ImportError:
        raise ViewerError(
            "--cluster slurm needs dask-jobqueue: pip install skinning-viewer[batch]"
        ) from None
    options = dict(name.options)
    count = options.pop("cpus", "1")
    if not count.isdecimal() or int(count) < 1:
        raise ViewerError(
            f'--cluster slurm: cpus: expected 1 or more, found "{printable(count, 40)}"'
        )
    processes = int(count)
    has_gpu = any(key in options for key in _GPU_OPTIONS)
    known = {
        "queue": options.pop("partition", None),
        "account": options.pop("account", None),
        "walltime": options.pop("time", None),
        "memory": options.pop("mem", None) or f"{(limits.memory or _MEMORY) * processes}B",
        "interface": options.pop("interface", None),
    }
    return SLURMCluster(
        cores=processes,
        processes=processes,
        job_extra_directives=[
            f"--{key}={value}" if value else f"--{key}" for key, value in options.items()
        ],
        worker_extra_args=["--resources", "GPU=1"] if has_gpu else [],
        # Port 0 selects any free port: other users share the login node.
        scheduler_options={"dashboard": False, "dashboard_address": ":0"},
        silence_logs=logging.CRITICAL,
        **known,
    )


@contextmanager
def _handlers_kept() -> Iterator[None]:
    """Restore the signal handlers that the block replaces."""
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.getsignal(number) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, before, strict=True):
            if signal.getsignal(number) is not handler:
                signal.signal(number, handler)
