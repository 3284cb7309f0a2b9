"""Reports of a batch: ``report.jsonl``, one line per item, and the summary.

A line is appended as soon as its item has finished, so a report also lists the items that need not
be run again. Several processes may append to the same file, on one machine or on several. An
incomplete line, left by a killed process, is skipped when the report is read.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import field, fields
from pathlib import Path

from viewer.batching.items import Item, Result
from viewer.data_classes import dataclass
from viewer.diagnostics.diagnostic import plain
from viewer.diagnostics.record import JsonObject
from viewer.errors import OutputError, ViewerError, reason_of
from viewer.phrases import printable

_ITEM_NAMES = [field.name for field in fields(Item)]
_NAMES = [field.name for field in fields(Result) if field.name != "item"]
_KINDS: dict[str, type | tuple[type, ...]] = {
    **dict.fromkeys(("index", "exit_code", "attempts"), int),
    **dict.fromkeys(("seconds", "time"), (int, float)),
    **dict.fromkeys(("output", "name", "status", "message", "text", "key"), str),
    **dict.fromkeys(("files", "outputs", "diagnostics"), list),
    "values": dict,
}


@dataclass
class Report:
    """The results of a batch."""

    results: list[Result] = field(default_factory=list)
    """In the order in which the items finished."""
    seconds: float = 0.0
    """Wall time of the batch."""
    n_items: int = 0
    """Number of items, including those not yet started when the batch was interrupted."""
    signal: int = 0
    """Number of the signal that interrupted it; 0 if none did."""
    path: Path | None = None
    """The report's file."""
    notes: list[str] = field(default_factory=list)
    """Messages about inputs and workers, such as paths that were skipped."""

    def __repr__(self) -> str:
        counts = ", ".join(f"{count} {status}" for status, count in sorted(self.counts.items()))
        return f"<Report of {self.n_items} items: {counts or 'no results'}; {self.seconds:.1f} s>"

    @property
    def counts(self) -> Counter[str]:
        """Number of results by status."""
        return Counter(result.status for result in self.results)

    @property
    def failures(self) -> list[Result]:
        """Results of the items that are neither done nor unchanged, in the order of the inputs."""
        bad = (one for one in self.results if one.status not in ("done", "unchanged"))
        return sorted(bad, key=lambda result: result.item.index)

    @property
    def is_complete(self) -> bool:
        """Whether all items are done or unchanged, without findings or differences."""
        is_clean = all(
            result.status in ("done", "unchanged") and result.exit_code == 0
            for result in self.results
        )
        return is_clean and len(self.results) == self.n_items


class ReportFile:
    """A report that is being written; its folder is created if necessary."""

    def __init__(self, path: Path, replaces: bool = False) -> None:
        self.path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            flags = os.O_RDWR | os.O_CREAT | os.O_APPEND | (os.O_TRUNC if replaces else 0)
            # Windows would write a different line ending.
            self._handle = os.open(path, flags | getattr(os, "O_BINARY", 0), 0o666)
        except OSError as problem:
            raise self._error(problem) from None

    def add(self, result: Result) -> None:
        """Append a line; earlier lines survive if the process is killed."""
        line = _line(result).encode("utf-8", "backslashreplace") + b"\n"
        try:
            with _locked(self._handle):
                if self._ends_within_line():
                    line = b"\n" + line
                while line:
                    line = line[os.write(self._handle, line) :]
        except OSError as problem:
            raise self._error(problem) from None

    def close(self) -> None:
        """Close the file."""
        os.close(self._handle)

    def __enter__(self) -> ReportFile:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _ends_within_line(self) -> bool:
        size = os.fstat(self._handle).st_size
        if size == 0:
            return False
        os.lseek(self._handle, size - 1, os.SEEK_SET)
        return os.read(self._handle, 1) != b"\n"

    def _error(self, problem: OSError) -> OutputError:
        return OutputError.at(self.path, problem)


@contextlib.contextmanager
def _locked(handle: int) -> Iterator[None]:
    """Lock a file against other processes, including those of other machines where supported."""
    try:
        from fcntl import LOCK_EX, LOCK_UN, lockf
    except ImportError:  # Windows
        yield
        return
    is_locked = True
    try:
        lockf(handle, LOCK_EX)
    except OSError:  # the file system has no locks; appended lines are still written as a whole
        is_locked = False
    try:
        yield
    finally:
        if is_locked:
            lockf(handle, LOCK_UN)


def _line(result: Result) -> str:
    """Return a result as one line of JSON; the item's fields come first."""
    item = {name: getattr(result.item, name) for name in _ITEM_NAMES}
    found = {"schema": "batch/1"} | item | {name: getattr(result, name) for name in _NAMES}
    found["seconds"] = round(result.seconds, 6)
    try:
        return json.dumps(found, default=_data, separators=(",", ":"), allow_nan=False)
    # JSON has no infinite numbers, no NaN, and only strings as keys.
    except (ValueError, TypeError):
        found["values"] = plain(result.values)
        return json.dumps(found, default=str, separators=(",", ":"))


def _data(value: object) -> object:
    """Return a value of a function, such as an array, as JSON data."""
    return value.tolist() if hasattr(value, "tolist") else str(value)


def read_results(path: Path) -> list[Result]:
    """Read a report; if an item has several results, the last one is used."""
    results: dict[tuple[str, str], Result] = {}
    n_lines = 0
    try:
        with path.open(encoding="utf-8", errors="replace") as stream:
            for line in stream:
                n_lines += 1
                result = _result(line)
                if result is not None:
                    results[result.item.name, result.item.output] = result
    except OSError as problem:
        raise ViewerError(f"{printable(path, 300)}: {reason_of(problem)}") from None
    if n_lines > 1 and not results:
        raise ViewerError(f"{printable(path, 300)}: expected the report of a batch")
    return list(results.values())


def _result(line: str) -> Result | None:
    """Parse the result in a line; None if the line is incomplete or has values of other types."""
    try:
        found: JsonObject = json.loads(line)
        if not all(isinstance(found[name], kinds) for name, kinds in _KINDS.items()):
            return None
        item = Item(found["index"], tuple(found["files"]), found["output"], found["name"])
        rest = {name: found[name] for name in _NAMES}
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    result = Result(item, **(rest | {"outputs": tuple(rest["outputs"])}))
    return result if all(isinstance(text, str) for text in (*item.files, *result.outputs)) else None
