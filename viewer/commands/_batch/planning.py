"""Plan of a batch: its items, job and settings, checked before anything starts."""

from __future__ import annotations

import importlib.util
import os
import stat
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Literal

from viewer.batching.engines import Limits
from viewer.batching.engines._cluster_text import parse_cluster
from viewer.batching.inputs import find_inputs
from viewer.batching.items import Item
from viewer.batching.naming import (
    check_further_outputs,
    check_outputs,
    check_summaries,
    items_of,
    output_folder,
    template_of,
)
from viewer.batching.overview import overview_files
from viewer.batching.running import Settings, shard_of
from viewer.commands._batch.options import RETRIES, TIMEOUT
from viewer.data_classes import dataclass
from viewer.errors import OutputError, ViewerError
from viewer.phrases import counted, listed, printable

_SMALL = 50e6  # total bytes of inputs above which workers run even a few inputs
_LISTED = 10  # maximum number of names in a message


@dataclass(frozen=True)
class Request:
    """The user's request; see the options of the same names.

    ``identity``: job, options and version, which are part of the items' keys.
    ``shared``: files that all items read.
    ``few``: maximum number of items for which no worker process is started.
    ``usual_timeout``: the time limit if ``timeout`` is None.
    ``memory``: bytes that a worker may use; None for no limit.
    ``notes``: messages about the paths.
    ``joint_map``: template for the joint map of each item.
    """

    paths: Sequence[str]
    lists: Sequence[str] = ()
    output: str = ""
    to: str = ""
    keeps_folders: bool = False
    identity: str = ""
    shared: Sequence[str] = ()
    few: int = 16
    workers: int | None = None
    cluster: str = ""
    shard: str = ""
    resume: bool = False
    force: bool = False
    retries: int = RETRIES
    timeout: float | None = None
    usual_timeout: float | None = TIMEOUT
    memory: int | None = None
    report: str = ""
    notes: Sequence[str] = ()
    table: str = ""
    overview: str = ""
    joint_map: str = ""


@dataclass(frozen=True)
class Plan:
    """The items of a batch, or of its shard, and how they are run.

    ``notes``: messages about inputs and processes.
    """

    items: Sequence[Item]
    settings: Settings
    notes: tuple[str, ...] = ()


def plan_of(request: Request) -> Plan:
    """Return a plan.

    Raises ViewerError if an input is missing, options contradict each other, or a file would be
    written twice or replaced.
    """
    inputs = find_inputs(
        request.paths,
        request.lists,
        keeps_folders=request.keeps_folders,
        output=output_folder(request.output),
    )
    template = template_of(request.output, request.to) if request.output else ""
    items = items_of(inputs, template)
    check_outputs(items, request.shared)
    maps = _joint_maps(request, items)
    report = _report_of(request)
    mine = shard_of(items, request.shard) if request.shard else items
    names = {"--report": str(report or ""), "--table": request.table}
    names |= _overview_names(request, len(mine))
    check_summaries(names, [*items, *maps], request.shared)
    items = mine
    if request.resume and report is None:
        raise ViewerError("--resume: expected --report FILE, or a folder for the outputs")
    if not (request.force or request.resume):
        numbers = {item.index for item in items}
        _check_free([*items, *(each for each in maps if each.index in numbers)])
    engine, limits, note = _processes(request, items)
    settings = Settings(
        engine, limits, report, _existing(request), request.identity, tuple(request.shared)
    )
    return Plan(items, settings, (*request.notes, *inputs.notes, *note))


def _joint_maps(request: Request, items: Sequence[Item]) -> list[Item]:
    """Return the items with their joint maps as outputs; empty if none are written."""
    if not request.joint_map:
        return []
    option = "--save-joint-map"
    return check_further_outputs(option, request.joint_map, items, request.shared)


def _overview_names(request: Request, count: int) -> dict[str, str]:
    """Return the files of the overview; raise OutputError if one of its sheets exists."""
    if not request.overview:
        return {}
    first, *others = overview_files(request.overview, count)
    for path in others:
        if os.path.lexists(path) and not (request.force or request.resume):
            raise OutputError(f"{printable(path, 300)}: already exists (--force replaces it)")
    names = {f"--overview, sheet {number}": path for number, path in enumerate(others, 2)}
    return {"--overview": first, **names}


def _report_of(request: Request) -> Path | None:
    """Return the report's path: next to the outputs by default."""
    if request.report:
        return Path(request.report)
    folder = output_folder(request.output)
    if not folder:
        return None
    part = f".{request.shard.replace('/', '-of-')}" if request.shard else ""
    return Path(folder, f"report{part}.jsonl")


def _existing(request: Request) -> Literal["refuse", "replace", "append", "resume"]:
    """Return how to treat an existing report."""
    if request.resume:
        return "resume"
    if request.shard and request.report:
        return "append"  # other shards write to the same file
    return "replace" if request.force else "refuse"


def _check_free(items: Sequence[Item]) -> None:
    """Refuse to replace outputs; those of numbered files are checked item by item."""
    taken = [item.output for item in items if item.output and os.path.lexists(item.output)]
    if taken:
        verb = "exists" if len(taken) == 1 else "exist"
        names = listed([printable(path, 300) for path in taken], _LISTED)
        raise OutputError(
            f"{counted(len(taken), 'output')} already {verb}: {names} (--resume continues the "
            "batch, --force replaces them)"
        )


def _processes(request: Request, items: Sequence[Item]) -> tuple[str, Limits, list[str]]:
    """Return the engine, its limits and a message.

    Few small inputs are run in this process, because starting workers takes about a second.
    """
    limits = _limits(request, len(items))
    if request.cluster:
        return "dask_cluster", limits, _cluster_notes(request)
    is_limited = request.timeout is not None or request.memory is not None
    if request.workers is not None:
        if request.workers == 0 and is_limited:
            raise ViewerError("--timeout and --limit-memory: expected --workers 1 or more, found 0")
        return "processes" if request.workers else "sequential", limits, []
    is_few = len(items) <= request.few and _size(items) < _SMALL
    if is_few and not is_limited:
        return "sequential", limits, []
    if not is_limited and importlib.util.find_spec("pebble") is None:
        note = "without pebble, one process runs everything (pip install pebble)"
        return "sequential", limits, [note]
    return "processes", limits, []


def _limits(request: Request, n_items: int) -> Limits:
    """Return the limits; raise ViewerError if one is invalid."""
    timeout = request.usual_timeout if request.timeout is None else request.timeout or None
    if timeout is not None and not timeout >= 0.0:  # also true for NaN
        raise ViewerError(f"--timeout: expected 0 or more, found {timeout:g}")
    for name, value in (("workers", request.workers), ("retries", request.retries)):
        if value is not None and value < 0:
            raise ViewerError(f"--{name}: expected 0 or more, found {value}")
    if request.memory is not None and request.memory <= 0:
        raise ViewerError(f"--limit-memory: expected more than 0 bytes, found {request.memory}")
    if request.cluster and request.workers == 0:
        raise ViewerError("--cluster: expected --workers 1 or more, found 0")
    count = request.workers
    if not count and request.cluster:
        # The cores of a login node say nothing about the cluster.
        cluster = parse_cluster(request.cluster)
        count = cluster.workers_per_job if cluster.kind == "slurm" else None
    workers = max(1, min(count or _cores(), n_items))
    return Limits(workers, request.retries, timeout, request.memory, request.cluster)


def _cluster_notes(request: Request) -> list[str]:
    cluster = parse_cluster(request.cluster)
    if cluster.kind == "address" and request.workers is not None:
        return [f"--workers has no effect: all workers of {cluster.address} are used"]
    return []


def _size(items: Sequence[Item]) -> int:
    """Return the total size of files in bytes; folders, and files that vanished, count as 0."""
    total = 0
    for item in items:
        for file in item.files:
            with suppress(OSError):
                found = os.stat(file)
                total += found.st_size if stat.S_ISREG(found.st_mode) else 0
    return total


def _cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        count = len(os.sched_getaffinity(0))
    else:
        count = os.cpu_count() or 1
    # SLURM does not always bind a task to its assigned cores.
    assigned = os.environ.get("SLURM_CPUS_PER_TASK") or os.environ.get("SLURM_CPUS_ON_NODE", "")
    return min(count, int(assigned)) if assigned.isdecimal() and int(assigned) else count
