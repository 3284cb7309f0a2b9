"""Batches from Python."""

from __future__ import annotations

import os
import pickle
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from hashlib import blake2b
from types import CellType, CodeType
from typing import TYPE_CHECKING, Any

from viewer.arguments import check_type
from viewer.batching.execution import FunctionJob
from viewer.batching.items import Item, Result
from viewer.batching.running import run_batch
from viewer.commands._batch.jobs import JOBS, job_parser
from viewer.commands._batch.planning import RETRIES, Plan, Request, plan_of
from viewer.commands._batch.requests import request_of
from viewer.commands._batch.results import check_results, name_in_shard, save_results
from viewer.commands._settings import destinations
from viewer.errors import ViewerError
from viewer.interrupts import Interrupted
from viewer.near_names import did_you_mean
from viewer.phrases import printable
from viewer.version import VERSION

if TYPE_CHECKING:
    from viewer.batching.engines import Job
    from viewer.batching.report import Report

_Paths = str | os.PathLike[str] | Iterable[str | os.PathLike[str]]

_OWN = ("files", "output", "force", *destinations(Request, without="to"), "table", "overview")
"""Arguments that are parameters of ``batch``; in ``options``, they would have no effect."""


def batch(
    paths: _Paths,
    job: str | Callable[[Item], object],
    out: str | os.PathLike[str] = "",
    *,
    to: str = "",
    options: Sequence[str] = (),
    shared: Sequence[str | os.PathLike[str]] = (),
    workers: int | None = None,
    cluster: str = "",
    shard: str = "",
    resume: bool = False,
    force: bool = False,
    retries: int = RETRIES,
    timeout: float | None = None,
    memory: int | None = None,
    report: str | os.PathLike[str] = "",
    table: str | os.PathLike[str] = "",
    overview: str | os.PathLike[str] = "",
    on_result: Callable[[Result], None] | None = None,
) -> Report:
    """Run a job on many files, one by one; a failure never stops the others.

    Worker processes are new interpreters: scripts that use them must guard their top-level code
    with ``if __name__ == "__main__":``, and functions must be importable.

    Parameters
    ----------
    paths : str, path or iterable of them
        Files, folders, patterns such as ``data/**/*.npz``, and ``@list.txt``.
    job : str or callable
        A command (``convert``, ``render``, ``lint``, ``diff``, ``rig``, ``info``), or a function
        that is called with each ``Item`` (``files``, ``output``, ``name``). A dict that it returns
        becomes the ``values`` of the result; an exception marks the item as failed.
    out : str or path
        A folder, which mirrors the folders of the inputs, or a template, such as
        ``out/{parent}/{stem}.bvh``.
    to
        Suffix of the outputs in a folder.
    options : sequence of str
        Options of the command, as on the command line; for ``diff``, the reference comes first.
    shared : sequence of str or path
        Files that are opened with every input; for a function, files that it reads.
    workers
        Number of worker processes; 0 for this process. By default 0 for few inputs, otherwise one
        per core.
    cluster
        ``local``, the address of a Dask scheduler, or ``slurm``; empty for this machine.
    shard
        ``I/N``: only every N-th input, starting with input I (0 to N - 1).
    resume
        Whether to skip inputs that the report lists as done with the same content, options and
        version of the program.
    force
        Whether existing files may be replaced.
    retries
        Number of times an input is retried after its worker has failed.
    timeout
        Seconds per attempt; 0 for no limit. By default 600, without limit for ``"render"``.
        Applies to worker processes only.
    memory
        Bytes that a worker may use.
    report : str or path
        File that gets one line of JSON per input; by default ``report.jsonl`` in ``out``.
    table : str or path
        CSV file with one row per input; with ``info``, one per figure of each input.
        Numbers and strings that a function returns are columns.
    overview : str or path
        A page (``.html``) of all inputs; for ``render`` and ``diff`` also contact sheets
        (``.png``).
    on_result : callable, optional
        Called with each result.

    Returns
    -------
    Report
        Results, counts by status, failures, notes about inputs and workers.

    Raises
    ------
    ViewerError
        If the batch cannot start: nothing matches, outputs clash or exist, a package is missing.
    KeyboardInterrupt
        After Ctrl-C, once the running items are finished; a second Ctrl-C cancels them.
    """
    check_type("paths", paths, str, os.PathLike, Iterable)
    check_type("job", job, str, Callable)  # type: ignore[arg-type]
    check_type("shared", shared, Sequence)
    names = [paths] if isinstance(paths, str | os.PathLike) else [*paths]
    files = {"out": [out], "report": [report], "table": [table], "overview": [overview]}
    for argument, given in ({"paths": names, "shared": shared} | files).items():
        for each in given:
            check_type(argument, each, str, os.PathLike)
    request = Request(
        paths=[os.fspath(name) for name in names],
        output=os.fspath(out),
        to=to,
        shared=[os.fspath(file) for file in shared],
        workers=workers,
        cluster=cluster,
        shard=shard,
        resume=resume,
        force=force,
        retries=retries,
        timeout=timeout,
        memory=memory,
        report=os.fspath(report),
        table=os.fspath(table),
        overview=os.fspath(overview),
    )
    name = "function" if callable(job) else job
    one, request = _function(job, request) if callable(job) else _command(job, request, options)
    found = _run(plan_of(request), one, on_result)
    save_results(name, request.table, request.overview, found.results)
    return found


def _run(plan: Plan, job: Job, on_result: Callable[[Result], None] | None) -> Report:
    """Run a batch, and pass a received signal on to the caller at the end."""
    try:
        found = run_batch(plan.items, job, plan.settings, on_result)
    except Interrupted as stop:
        # The caller's own handler handles it, as if the signal had just arrived.
        signal.raise_signal(stop.number)
        raise KeyboardInterrupt from None
    found.notes[:0] = plan.notes
    if found.signal:
        signal.raise_signal(found.signal)
    return found


def _function(job: Callable[[Item], object], request: Request) -> tuple[Job, Request]:
    """Return a function as a job, and the request with its identity."""
    may_replace = request.force or request.resume
    table, overview = (
        name_in_shard(path, request.shard) for path in (request.table, request.overview)
    )
    request = replace(request, table=table, overview=overview)
    check_results("function", request.table, request.overview, may_replace, request.output)
    return FunctionJob(job), replace(request, identity=identity_of(job))


def _command(job: str, request: Request, options: Sequence[str]) -> tuple[Job, Request]:
    """Return a command as a job, and the request extended by its options."""
    if job not in JOBS:
        near = did_you_mean(job, JOBS) or f"available jobs: {', '.join(JOBS)}"
        raise ViewerError(f'no job is called "{printable(job, 60)}"; {near}')
    parser = job_parser(job)
    if isinstance(options, str):
        raise ViewerError(f"options: expected a list of strings, found {printable(options)}")
    parser.check_options([job, *options])
    given = vars(parser.parse_intermixed_args([job, *options]))
    for name in _OWN:
        if name in given and given[name] != parser.get_default(name) and given[name] != []:
            raise ViewerError(
                f"options: expected options of {job}, found {printable(given[name], 100)}; "
                f"viewer.batch has a parameter for it"
            )
    words = [job, *options]
    words += [word for file in request.shared for word in ("--with", file)]
    words += ["--output", request.output] if request.output else []
    words += ["--table", request.table] if request.table else []
    words += ["--overview", request.overview] if request.overview else []
    words += ["--shard", request.shard] if request.shard else []
    words += ["--resume"] * request.resume + ["--force"] * request.force
    parser.check_options(words)
    arguments = parser.parse_intermixed_args(words)
    arguments.files = request.paths
    if request.to:
        arguments.to = request.to
    found, command = request_of(arguments)
    names = "workers", "cluster", "retries", "timeout", "memory", "report"
    return command, replace(found, **{name: getattr(request, name) for name in names})


def identity_of(function: Callable[..., object]) -> str:
    """Return a string that is the same in all processes, and changes if the function does."""
    # It covers code, defaults, bound arguments, variables of enclosing functions and the program's
    # version, but not the code of other functions that it calls.
    total = blake2b(digest_size=8)
    for part in _parts(function, set()):
        total.update(part + b"\0")
    return f"{getattr(function, '__qualname__', type(function).__qualname__)} {total.hexdigest()}"


def _parts(value: Any, seen: set[int]) -> Iterator[bytes]:
    yield VERSION.encode()
    if id(value) in seen:  # the function is recursive
        return
    seen.add(id(value))
    if isinstance(value, partial):
        for one in (value.func, *value.args, *sorted(value.keywords.items())):
            yield from _parts(one, seen)
        return
    inner = getattr(value, "__func__", value)
    if inner is not value:  # the value is a method
        yield from _parts(value.__self__, seen)
    code = getattr(inner, "__code__", None)
    if not isinstance(code, CodeType):
        yield _pickled(value)
        return
    yield f"{inner.__module__}.{inner.__qualname__}".encode()
    yield from _code_parts(code)
    yield from (_pickled(inner.__defaults__), _pickled(inner.__kwdefaults__))
    for cell in inner.__closure__ or ():
        if _is_set(cell):
            yield from _parts(cell.cell_contents, seen)


def _code_parts(code: CodeType) -> Iterator[bytes]:
    yield code.co_code
    yield repr(code.co_names).encode()  # names of the functions and attributes used
    for one in code.co_consts:
        if isinstance(one, CodeType):  # its repr contains an address
            yield from _code_parts(one)
        else:  # the order of sets of str varies between processes
            yield repr(sorted(map(repr, one)) if isinstance(one, frozenset) else one).encode()


def _is_set(cell: CellType) -> bool:
    try:
        _ = cell.cell_contents
    except ValueError:
        return False
    return True


def _pickled(value: object) -> bytes:
    """Return a pickle, or the name of the type if pickling fails."""
    try:
        return pickle.dumps(_without_sets(value))
    except (pickle.PicklingError, AttributeError, TypeError, RecursionError):
        return f"{type(value).__module__}.{type(value).__qualname__}".encode()


def _without_sets(value: Any) -> object:
    """Return data whose sets are sorted lists: their order varies between processes."""
    if isinstance(value, set | frozenset):
        return [type(value).__name__, *sorted(map(_pickled, value))]
    if type(value) in (list, tuple):
        return type(value)(map(_without_sets, value))
    if type(value) is dict:
        return {key: _without_sets(one) for key, one in value.items()}
    return value
