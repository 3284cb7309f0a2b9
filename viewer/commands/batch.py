"""Batches: one command for many files, with workers, a report, resumption and shards."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import deque
from collections.abc import Sequence

from viewer.batching.items import Item, Result
from viewer.batching.report import Report
from viewer.commands._batch.jobs import JOBS, job_parser
from viewer.commands._batch.planning import add_batch_arguments, plan_of
from viewer.commands._batch.requests import request_of
from viewer.commands._batch.results import add_result_arguments, save_results
from viewer.commands._printing import table_lines
from viewer.commands._progress import Progress
from viewer.commands._scene import print_warnings
from viewer.commands._usage import Parser
from viewer.errors import OutputError, ViewerError
from viewer.near_names import did_you_mean
from viewer.phrases import counted, printable
from viewer.streams import summary_stream

_FAILED = 1  # exit code if an item failed or has findings
_MINUTE = 60.0  # seconds between lines without a terminal, and over which the rate is averaged
_MOST = 20  # maximum number of failures listed


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments common to all jobs."""
    names = ", ".join(JOBS)
    parser.usage = "%(prog)s JOB PATHS [-o OUT] [options of the job] [options]"
    parser.add_argument(
        "job",
        nargs="?",
        metavar="JOB",
        help=f"{names}; viewer batch JOB --help lists its options too",
    )
    parser.add_argument(
        "files",
        nargs="*",
        metavar="PATHS",
        help="files, folders, patterns in quotes ('data/**/*.npz'), @list.txt, or - for a list on "
        "standard input",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        help="a folder, which mirrors the folders of the inputs, or a template: "
        "'out/{parent}/{stem}.bvh'; also {folder}, {name}, {suffix}, {index:05}",
    )
    parser.add_argument("--force", action="store_true", help="replace existing files")
    add_batch_arguments(parser)
    add_result_arguments(parser, "diff")  # diff has all of these options


def parser_of(words: Sequence[str]) -> Parser | None:
    """Return the parser of a job with the options of its command; None if no job is named."""
    word = next(iter(words), "-")
    if word in JOBS:
        return job_parser(word)
    if word.startswith("-"):
        return None
    near = did_you_mean(word, JOBS)
    raise ViewerError(
        f'expected a job, one of {", ".join(JOBS)}, found "{printable(word, 60)}"'
        f"{f'; {near}' if near else ''}"
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the batch; return 1 if an item failed, or has findings, 5 if one could not be written."""
    from viewer.batching.running import run_batch

    if arguments.job is None:
        raise ViewerError(f"expected a job, one of {', '.join(JOBS)}, found none")
    request, job = request_of(arguments)
    plan = plan_of(request)
    print_warnings(plan.notes)
    prints, is_json = JOBS[arguments.job].prints, getattr(arguments, "json", False)
    with Display(arguments.job, plan.items, prints, is_json) as display:
        report = run_batch(plan.items, job, plan.settings, display.show, display.note)
    stream = sys.stderr if is_json else summary_stream(plan.settings.report or "")
    print("\n".join(summary_lines(report)), file=stream)
    for line in save_results(arguments.job, request.table, request.overview, report.results):
        print(line, file=stream)
    if report.signal:
        return 128 + report.signal
    if any(result.exit_code == OutputError.exit_code for result in report.failures):
        return OutputError.exit_code
    return 0 if report.is_complete else _FAILED


class Display:
    """Progress of a batch: a bar in a terminal, otherwise one line per minute."""

    # If ``prints``, the text of items is printed in their order; JSON in one line per item.

    def __init__(
        self, title: str, items: Sequence[Item], prints: bool, is_json: bool = False
    ) -> None:
        self._is_json = is_json
        self.total = len(items)
        self._progress = Progress(title)
        self._rate, self._said = _Rate(), time.monotonic()
        self._n_done = self._n_failed = self._n_unchanged = 0
        self._texts: dict[int, str] = {}  # text that waits for earlier items, by index
        self._order = deque(item.index for item in items if prints)

    def show(self, result: Result) -> None:
        """Count a result."""
        self._n_done += 1
        self._n_unchanged += result.status == "unchanged"
        self._n_failed += result.status not in ("done", "unchanged")
        rate = self._rate.at(self._n_done - self._n_unchanged)
        failed = f", {self._n_failed} failed" if self._n_failed else ""
        if self._has_bar():
            # A new title would start a new bar, which could not estimate the time left.
            self._progress.receive(self._n_done, self.total, f"{rate:.3g}/s{failed}", "")
        now = time.monotonic()
        if not sys.stderr.isatty() and now > self._said + _MINUTE:
            self._said = now
            left = _duration((self.total - self._n_done) / max(rate, 1e-9))
            text = f"{self._n_done} of {self.total}, {rate:.3g}/s, {left} left{failed}"
            print(text, file=sys.stderr)
        if self._order:
            self._print(result)

    def note(self, text: str) -> None:
        """Print a message about the workers."""
        self._progress.hide()
        print_warnings([text], plain="note")

    def _has_bar(self) -> bool:
        # Printed text would break the bar; standard output may be closed.
        return not (self._order and sys.stdout is not None and sys.stdout.isatty())

    def _print(self, result: Result) -> None:
        text = result.text.rstrip("\n")
        name = printable(result.item.name, 300)
        if self._is_json:
            text = _json_line(result)
        elif text and self.total > 1:
            text = f"{name}:\n{text}"
        self._texts[result.item.index] = text
        while self._order and self._order[0] in self._texts:
            if found := self._texts.pop(self._order.popleft()):
                print(found)

    def __enter__(self) -> Display:
        if self.total > 1 and self._has_bar():
            self._progress.begin(self.total)
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.__exit__()


class _Rate:
    """Items per second over the last minute; unchanged items do not count."""

    def __init__(self) -> None:
        self._samples = deque([(time.monotonic(), 0)])

    def at(self, count: int) -> float:
        """Return the rate when ``count`` items have finished."""
        now = time.monotonic()
        if now > self._samples[-1][0] + 1.0:
            self._samples.append((now, count))
        while len(self._samples) > 1 and self._samples[1][0] < now - _MINUTE:
            self._samples.popleft()
        since, earlier = self._samples[0]
        return (count - earlier) / max(now - since, 1e-3)


def _json_line(result: Result) -> str:
    """Return the JSON that an item printed, with its name and status, as one line."""
    found = {"name": result.item.name, "files": [*result.item.files], "status": result.status}
    try:
        content = json.loads(result.text)
    except ValueError:  # the item failed before it printed anything
        content = None
    parts = {**found, "message": result.message, "content": content}
    return json.dumps(parts, allow_nan=False)


def _duration(seconds: float) -> str:
    """Return a duration in its largest units.

    >>> _duration(3.21), _duration(125), _duration(7260)
    ('3.2 s', '2 min 5 s', '2 h 1 min')
    """
    if seconds < 60.0:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest} s"
    return f"{minutes // 60} h {minutes % 60} min"


def summary_lines(report: Report) -> list[str]:
    """Return the counts of items by status, and the first failures as a table."""
    rate = len(report.results) / max(report.seconds, 1e-3)
    head = f"{counted(len(report.results), 'item')} in {_duration(report.seconds)} ({rate:.3g}/s)"
    parts = [f"{count} {status}" for status, count in sorted(report.counts.items())]
    found = sum(
        one.status in ("done", "unchanged") and one.exit_code == 1 for one in report.results
    )
    if found:
        parts.append(f"{found} with findings or differences")
    retried = sum(one.attempts > 1 for one in report.results)
    if retried:
        parts.append(f"{retried} run again")
    lines = [f"{head}: {', '.join(parts)}" if parts else head]
    failures = report.failures
    if failures:
        rows = [
            [printable(one.item.name, 100), one.status, printable(one.message, 300)]
            for one in failures[:_MOST]
        ]
        lines += table_lines(rows)
        if len(failures) > _MOST:
            lines.append(f"and {len(failures) - _MOST} more")
    left = report.n_items - len(report.results)
    if left:
        how = "--resume continues" if report.path else "only batches with --report can be resumed"
        lines.append(f"interrupted: {counted(left, 'item')} left; {how}")
    if report.path is not None:
        lines.append(f"report: {printable(report.path, 300)}")
    return lines
