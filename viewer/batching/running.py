"""Execution of a batch: engine, report, resumption and interruption.

Items run in an engine, and each result is a line of the report. A batch that is resumed skips the
items that an earlier one finished: their keys, hashes of all that may change the result, are
unchanged, and the files they wrote still exist.
"""

from __future__ import annotations

import contextlib
import errno
import glob
import os
import time
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import field, replace
from functools import cache
from hashlib import blake2b
from pathlib import Path
from typing import Literal, cast

from viewer.batching.engines import Job, Limits, load_engine
from viewer.batching.items import Item, Result
from viewer.batching.report import Report, ReportFile, read_results
from viewer.data_classes import dataclass
from viewer.errors import ViewerError
from viewer.interrupts import postponed, watched
from viewer.media.unfinished import remove_leftovers
from viewer.phrases import printable

_KILLED = ("crashed", "timeout", "memory")  # the worker could not remove its temporary files
_CHUNK = 1 << 20  # bytes of a file that are read and hashed at a time
_SIZE = 16  # bytes of a key


@dataclass(frozen=True)
class Settings:
    """Settings of a run."""

    engine: str = "sequential"
    """A key of ``ENGINES``."""
    limits: Limits = field(default_factory=Limits)
    """Processes, time and memory."""
    report: Path | None = None
    """The report to write; None for none."""
    existing: Literal["refuse", "replace", "append", "resume"] = "refuse"
    """Treatment of an existing report: ``refuse`` it, ``replace`` it, ``append`` to it, or
    ``resume``: append, and skip the items that it or the report of another shard lists as done."""
    identity: str = ""
    """Job, options and version of the program, which are part of the items' keys."""
    shared: tuple[str, ...] = ()
    """Files that all items read."""


@dataclass(frozen=True)
class _KeyedJob:
    """A job that skips finished items."""

    job: Job
    """The job of the other items."""
    identity: str
    shared: tuple[str, ...]
    """As in ``Settings``."""
    finished: frozenset[str]
    """Keys of finished items."""

    @property
    def uses_gpu(self) -> bool:
        """Whether the job draws."""
        return bool(getattr(self.job, "uses_gpu", False))

    def __call__(self, item: Item) -> Result:
        """Run one item, unless it is finished."""
        try:
            key = item_key(item, self.identity, self.shared)
        except OSError:  # the job reports the file and its error
            return self.job(item)
        if key in self.finished:
            return Result(item, "unchanged", key=key)
        return replace(self.job(item), key=key, time=time.time())


def shard_of(items: Sequence[Item], text: str) -> list[Item]:
    """Return every N-th item, beginning with the I-th, for ``I/N`` with I from 0 to N - 1."""
    first, _, count = text.partition("/")
    if not (first.isdecimal() and count.isdecimal() and 0 < int(count) <= 10**9):
        raise ViewerError(f"--shard: expected I/N, such as 0/8, found {printable(text, 40)}")
    if int(first) >= int(count):
        raise ViewerError(
            f"--shard: expected numbers from 0/{count} to {int(count) - 1}/{count}, found {text}; "
            f"in a SLURM array: --array=0-{int(count) - 1}"
        )
    return list(items[int(first) :: int(count)])


def run_batch(
    items: Sequence[Item],
    job: Job,
    settings: Settings,
    on_result: Callable[[Result], None] | None = None,
    on_note: Callable[[str], None] | None = None,
) -> Report:
    """Run the items of a batch; a failed item never stops the others."""
    # The first signal ends the batch after the running items are finished; a second one cancels
    # them and raises Interrupted, and the report contains the finished items.
    start = time.perf_counter()
    earlier = _earlier(settings)
    keyed: Job = job
    if settings.report is not None:
        keyed = _KeyedJob(job, settings.identity, settings.shared, frozenset(earlier))
    report = Report(n_items=len(items), path=settings.report)
    if settings.existing == "resume":
        remove_leftovers(item.output for item in items if item.output)
    with contextlib.ExitStack() as stack:
        file = None
        if settings.report is not None:
            replaces = settings.existing == "replace"
            file = stack.enter_context(ReportFile(settings.report, replaces))
        stack.enter_context(watched())
        signals = stack.enter_context(postponed())

        def note(text: str) -> None:
            report.notes.append(text)
            if on_note is not None:
                on_note(text)

        limits = replace(settings.limits, is_stopping=lambda: bool(signals.number), note=note)
        results = load_engine(settings.engine).run(iter(items), keyed, limits)
        stack.callback(cast("Generator[Result]", results).close)
        for result in results:
            if result.status == "unchanged":
                result = replace(earlier[result.key], item=result.item, status="unchanged")
            elif file is not None:
                file.add(result)
            if result.item.output and (result.attempts > 1 or result.status in _KILLED):
                remove_leftovers([result.item.output])
            report.results.append(result)
            if on_result is not None:
                on_result(result)
        report.signal = signals.number
    report.seconds = time.perf_counter() - start
    return report


def _earlier(settings: Settings) -> dict[str, Result]:
    """Return the results of finished items by key."""
    if settings.report is None:
        return {}
    if settings.existing != "resume":
        if settings.existing == "refuse" and _has_content(settings.report):
            raise ViewerError(
                f"{printable(settings.report, 300)}: already exists (--resume continues the batch, "
                "--force starts it again)"
            )
        return {}
    found = [one for path in _related_reports(settings.report) for one in read_results(path)]
    # A later result of another shard or with other options has replaced the same output.
    last = {
        one.item.output or one.item.name: one for one in sorted(found, key=lambda one: one.time)
    }
    return {
        one.key: one
        for one in last.values()
        if one.status == "done" and one.key and all(os.path.lexists(path) for path in one.outputs)
    }


def _related_reports(path: Path) -> list[Path]:
    """Return an existing report and the reports of other shards next to it."""
    stem = glob.escape(path.stem.partition(".")[0])
    names = f"{stem}.*-of-*.jsonl"
    shards = sorted(path.parent.glob(names)) if path.parent.is_dir() else []
    return [one for one in dict.fromkeys([path, *shards]) if one.is_file()]


def _has_content(path: Path) -> bool:
    try:
        return path.is_file() and path.stat().st_size > 0
    except OSError:
        return False


def item_key(item: Item, settings: str, shared: Iterable[str] = ()) -> str:
    """Return the key of an item, which changes whenever its result may change."""
    # Files that an input refers to, such as textures, are not included.
    total = blake2b(digest_size=_SIZE)
    where = item.output or item.name
    for text in (settings, where):
        total.update(os.fsencode(text) + b"\0")
    for path in item.files:
        total.update(_digest(path))
    for path in shared:
        total.update(_unchanged_digest(path, _stamp(path)))
    return total.hexdigest()


def _stamp(path: str) -> tuple[object, ...]:
    """Return a path with the sizes and times of its files, which a folder itself does not have."""
    inner = [os.path.join(folder, name) for folder, _, names in os.walk(path) for name in names]
    files = [path, *sorted(filter(os.path.isfile, inner))]
    states = [(file, os.stat(file)) for file in files]
    return tuple((file, state.st_size, state.st_mtime_ns) for file, state in states)


@cache
def _unchanged_digest(path: str, stamp: tuple[object, ...]) -> bytes:
    """Return the hash of a file that all items read; computed again if its stamp changes."""
    return _digest(path)


def _digest(path: str) -> bytes:
    """Return the hash of a file, of a folder's files and their names, or of an archive member."""
    total = blake2b(digest_size=_SIZE)
    if os.path.isdir(path):
        for folder, folders, files in os.walk(path):
            folders.sort()
            for name in sorted(files):
                inner = os.path.join(folder, name)
                total.update(os.fsencode(os.path.relpath(inner, path)) + b"\0")
                # Pipes and devices may never end, and links may be broken.
                total.update(_digest(inner) if os.path.isfile(inner) else b"-")
        return total.digest()
    member = ""
    while not os.path.exists(path) and os.path.dirname(path) not in ("", path):
        path, last = os.path.split(path)
        member = f"{last}/{member}"
    total.update(os.fsencode(member))
    if os.path.exists(path) and not os.path.isfile(path):
        raise OSError(errno.EINVAL, "not a file", path)
    with open(path, "rb", buffering=0) as stream:
        while chunk := stream.read(_CHUNK):
            total.update(chunk)
    return total.digest()
