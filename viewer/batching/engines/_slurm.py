"""SLURM jobs that run Dask workers: their submission, and their replacement when they end."""

from __future__ import annotations

import logging
import shlex
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from dask_jobqueue.slurm import SLURMJob
from distributed import Status

from viewer.batching.engines._cluster_text import ClusterName
from viewer.errors import ViewerError
from viewer.phrases import counted, listed, printable

if TYPE_CHECKING:
    from dask_jobqueue import SLURMCluster

_MEMORY = 4 << 30  # bytes per worker that a job requests by default
_GPU_OPTIONS = ("gpus", "gres", "gpus-per-node", "gpus-per-task")
_ASK_EVERY = 10.0  # seconds between calls of squeue while workers are missing
_PATIENCE = 5.0  # seconds without any worker before a note says so
_MOST_VAIN = 3  # consecutive jobs that end before their workers connect; then the batch fails


def slurm_cluster(
    name: ClusterName, memory: int | None, settings: Mapping[str, object]
) -> SLURMCluster:
    """Return a cluster whose workers are SLURM jobs; none is submitted yet."""
    if shutil.which("sbatch") is None:
        raise ViewerError(
            "--cluster slurm: sbatch was not found: run this on a login node, or submit an array "
            "job of shards (viewer help batches)"
        )
    try:
        with _handlers_kept():  # the import replaces the handler of Ctrl-C
            from dask_jobqueue import SLURMCluster

    except ImportError:
        raise ViewerError(
            "--cluster slurm needs dask-jobqueue: pip install dask-jobqueue"
        ) from None
    # The options that are popped below describe a job; all others are passed to sbatch.
    options = dict(name.options)
    processes = name.workers_per_job
    options.pop("cpus", None)
    has_gpu = any(key in options for key in _GPU_OPTIONS)
    known = {
        "queue": options.pop("partition", None),
        "account": options.pop("account", None),
        "walltime": options.pop("time", None),
        "memory": _memory(options.pop("mem", "")) or f"{(memory or _MEMORY) * processes}B",
        "interface": options.pop("interface", None),
    }
    try:
        return SLURMCluster(
            job_cls=Job,
            cores=processes,
            processes=processes,
            job_extra_directives=[
                f"--{key}={value}" if value else f"--{key}" for key, value in options.items()
            ],
            job_script_prologue=[_exported(key, value) for key, value in settings.items()],
            worker_extra_args=["--resources", "GPU=1"] if has_gpu else [],
            # Port 0 selects any free port: other users share the login node.
            scheduler_options={"dashboard": False, "dashboard_address": ":0"},
            silence_logs=logging.CRITICAL,
            **known,
        )
    except (RuntimeError, ValueError) as problem:
        raise ViewerError(f"--cluster slurm: {printable(problem, 300)}") from None


def _memory(text: str) -> str:
    """Return the option ``mem``; raise ViewerError if it is not a size."""
    from dask.utils import parse_bytes

    try:
        parse_bytes(text or "0")
    except ValueError:
        raise ViewerError(
            f'--cluster slurm: mem: expected a size such as 64G, found "{printable(text, 40)}"'
        ) from None
    return text


def _exported(key: str, value: object) -> str:
    """Return the line of a job script that applies a setting of Dask to the job's workers."""
    variable = key.upper().replace(".", "__").replace("-", "_")
    return f"export DASK_{variable}={shlex.quote(str(value))}"


class SlurmJobs:
    """The jobs of a batch. A job that ends, as at its time limit, is submitted again."""

    def __init__(self, cluster: Any, n_workers: int, note: Callable[[str], None]) -> None:
        self._cluster, self._n_workers, self._note = cluster, n_workers, note
        self._connected: set[str] = set()  # jobs whose workers have connected
        self._n_vain = 0
        self._start = self._asked = time.monotonic()
        self._has_waited = False
        cluster.scale(n_workers)

    def check(self, workers: Iterable[str]) -> None:
        """Replace ended jobs; raise if all are refused, or end before their workers connect."""
        names = [*workers]
        jobs = dict(self._cluster.workers)
        self._drop_refused(jobs)
        present = {job for job in jobs if any(f"{one}-".startswith(f"{job}-") for one in names)}
        self._connected |= present
        now = time.monotonic()
        if not names and not self._has_waited and now > self._start + _PATIENCE:
            self._has_waited = True
            count = counted(len(jobs), "job")
            self._note(f"waiting for SLURM to start {count} (squeue --me lists the queue)")
        if len(present) == len(jobs) or now < self._asked + _ASK_EVERY:
            return
        self._asked = now
        queued = _queued()
        absent = {job: jobs[job].job_id for job in jobs.keys() - present}
        ended = {job: number for job, number in absent.items() if number not in queued}
        if queued and ended:
            self._replace(ended)

    def _drop_refused(self, jobs: dict[str, Any]) -> None:
        """Remove jobs that sbatch has refused from the cluster, and from ``jobs``."""
        refused = {name: job.refusal for name, job in jobs.items() if job.refusal}
        if not refused:
            return
        reason = next(iter(refused.values()))
        n_jobs = len(jobs)
        for name in refused:
            del jobs[name]
        if not jobs:
            raise ViewerError(f"--cluster slurm: no job was accepted: {reason}")
        self._note(f"SLURM accepted only {len(jobs)} of {n_jobs} jobs: {reason}")
        self._n_workers = len(jobs) * self._n_workers // n_jobs
        self._cluster.sync(self._cluster.scale_down, [*refused])

    def _replace(self, ended: Mapping[str, str]) -> None:
        """Submit new jobs in place of those that have ended, given as job numbers by name."""
        has_worked = not self._connected.isdisjoint(ended)
        self._n_vain = 0 if has_worked else self._n_vain + len(ended)
        numbers = listed(sorted(ended.values()), 5)
        if self._n_vain >= _MOST_VAIN:
            raise ViewerError(
                f"--cluster slurm: {self._n_vain} jobs ended before their workers connected: see "
                f"the reason in the output of {numbers}, by default slurm-{min(ended.values())}.out"
            )
        verb = "has ended and is" if len(ended) == 1 else "have ended and are"
        jobs = "SLURM job" if len(ended) == 1 else "SLURM jobs"
        self._note(f"{jobs} {numbers} {verb} submitted again")
        self._cluster.sync(self._cluster.scale_down, [*ended])
        self._cluster.scale(self._n_workers)


def _queued() -> set[str]:
    """Return the numbers of this user's pending and running jobs; empty without an answer."""
    command = ["squeue", "--me", "--noheader", "--format=%A"]
    try:
        found = subprocess.run(command, capture_output=True, text=True, timeout=30.0, check=True)
    except (OSError, subprocess.SubprocessError):
        return set()
    # An answer without jobs is not empty.
    return {*found.stdout.split(), "none"}


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


class Job(SLURMJob):  # type: ignore[misc]  # the package has no types
    """A job that runs workers; ``refusal`` says why it was not submitted, empty if it was."""

    refusal = ""

    async def start(self) -> None:
        """Submit the job."""
        try:
            await super().start()
        except (RuntimeError, OSError, ValueError) as problem:
            lines = str(problem).splitlines()
            # Dask's message also has the command, its exit code and its empty output.
            said = [line for line in lines if line.startswith("sbatch: ")] or lines
            self.refusal = printable("; ".join(filter(None, said)), 500)
            # Dask waits for this status; closing the job then does nothing, as it has no number.
            self.status = Status.running

    async def close(self) -> None:
        """Cancel the job."""
        await super().close()
        self.status = Status.closed
