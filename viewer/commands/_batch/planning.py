"""Plan of a batch: its items, job and settings, checked before anything starts."""

from __future__ import annotations

import argparse
import importlib.util
import os
import stat
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Literal, TypeAlias

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
from viewer.commands._scene import parse_bytes
from viewer.commands._settings import add_settings
from viewer.data_classes import dataclass, setting
from viewer.errors import OutputError, ViewerError
from viewer.phrases import counted, listed, printable

RETRIES = 2
TIMEOUT = 600.0  # default time limit of an attempt, seconds
_SMALL = 50e6  # total bytes of inputs above which workers run even a few inputs
_LISTED = 10  # maximum number of names in a message


def whole(text: str) -> int:
    """Return a number of processes or attempts; argparse prefixes the error with the option."""
    if not (text.isdecimal() and int(text) <= 10_000):
        raise argparse.ArgumentTypeError(f"expected a number from 0 to 10000, found {text}")
    return int(text)


@dataclass(frozen=True)
class Request:
    """The user's request."""

    paths: Sequence[str]
    lists: Sequence[str] = setting(
        [],
        "file with one path per line, or - for standard input",
        flag="--from-list",
        metavar="FILE|-",
    )
    output: str = ""
    to: str = setting(
        "",
        "format of the outputs if OUT is a folder, such as bvh; folder for outputs that are "
        "folders{usual}",
        metavar="SUFFIX",
    )
    keeps_folders: bool = False
    identity: str = ""
    """Job, options and version, which are part of the items' keys."""
    shared: Sequence[str] = ()
    """Files that all items read."""
    few: int = 16
    """Maximum number of items for which no worker process is started."""
    workers: int | None = setting(
        None,
        "worker processes; 0: run in this process (default: 0 for few inputs, otherwise one per "
        "core; with --cluster slurm, the workers of one job)",
        type=whole,
        metavar="N",
    )
    cluster: str = setting(
        "",
        "run on Dask workers: local, an address such as tcp://host:8786, or "
        "slurm[:partition=gpu,time=2:00:00]",
        metavar="CLUSTER",
    )
    retries: int = setting(
        RETRIES,
        "run an input again if its worker crashed, hung or ran out of memory, at most N times "
        "(default: {default})",
        type=whole,
        metavar="N",
    )
    timeout: float | None = setting(
        None,
        "terminate workers that take longer for one input; 0: never (default: {usual}; no limit "
        "with --workers 0)",
        metavar="SECONDS",
    )
    usual_timeout: float | None = TIMEOUT
    """The time limit if ``timeout`` is None."""
    memory: int | None = setting(
        None,
        "memory that a worker may use, such as 4G; suffixes k, M, G (default: no limit)",
        flag="--limit-memory",
        type=str,
        read=lambda text: parse_bytes(text, "--limit-memory") if text else None,
        metavar="SIZE",
    )
    """In bytes."""
    report: str = setting(
        "",
        "write one line of JSON per input (default: report.jsonl in OUT, if that is a folder)",
        metavar="FILE",
    )
    resume: bool = setting(
        False,
        "skip inputs that the report lists as done with the same content, options and version, and "
        "run all others again, replacing their outputs",
    )
    shard: str = setting(
        "",
        "run only every N-th input, starting with input I (0 to N - 1), for job arrays: "
        "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT with --array=0-7",
        metavar="I/N",
    )
    force: bool = False
    notes: Sequence[str] = ()
    """Messages about the paths."""
    table: str = ""
    overview: str = ""
    joint_map: str = ""
    """Template for the joint map of each item."""


Writes: TypeAlias = Literal["always", "maybe", "never"]
"""Whether a job writes files: maybe means that it depends on its options."""


def add_batch_arguments(
    parser: argparse.ArgumentParser,
    suffix: str = "",
    writes: Writes = "always",
    has_fixed: bool = False,
    timeout: float | None = TIMEOUT,
) -> None:
    """Add the options that all jobs share; ``has_fixed``: the job has its own for common files."""
    group = parser.add_argument_group("batch")
    if writes != "never":
        add_settings(group, Request, "to", usual=f" (default: {suffix})" if suffix else "")
    if not has_fixed:
        group.add_argument(
            "--with",
            dest="fixed",
            action="append",
            default=[],
            metavar="FILE",
            help="also open this file with every input, such as the .skel of .anim files",
        )
    add_settings(group, Request, "lists", "workers", "cluster", "retries")
    usual = "0" if timeout is None else f"{timeout:g}; 0 for render"
    add_settings(group, Request, "timeout", usual=usual)
    add_settings(group, Request, "memory", "report", "resume", "shard")


@dataclass(frozen=True)
class Plan:
    """The items of a batch, or of its shard, and how they are run."""

    items: Sequence[Item]
    settings: Settings
    notes: tuple[str, ...] = ()
    """Messages about inputs and processes."""


def plan_of(request: Request) -> Plan:
    """Return a plan; refuse missing inputs, and outputs that are written twice or replaced."""
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
    """Return the engine, its limits and a message."""
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
    workers = max(1, min(count or _cores(), len(items)))
    limits = Limits(workers, request.retries, timeout, request.memory, request.cluster)
    if request.cluster:
        return "dask_cluster", limits, _cluster_notes(request)
    is_limited = request.timeout is not None or request.memory is not None
    if request.workers is not None:
        if request.workers == 0 and is_limited:
            raise ViewerError("--timeout and --limit-memory: expected --workers 1 or more, found 0")
        return "processes" if request.workers else "sequential", limits, []
    # Few small inputs are run in this process, because starting workers takes about a second.
    is_few = len(items) <= request.few and _size(items) < _SMALL
    if is_few and not is_limited:
        return "sequential", limits, []
    if not is_limited and importlib.util.find_spec("pebble") is None:
        note = "without pebble, one process runs everything (pip install pebble)"
        return "sequential", limits, [note]
    return "processes", limits, []


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
