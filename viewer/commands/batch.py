"""Batches: one command for many files, with workers, a report, resumption and shards."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from viewer.commands._batch.display import Display, summary_lines
from viewer.commands._batch.jobs import JOBS, job_parser
from viewer.commands._batch.planning import add_batch_arguments, plan_of
from viewer.commands._batch.requests import request_of
from viewer.commands._batch.results import add_result_arguments, save_results
from viewer.commands._scene import print_warnings
from viewer.commands._usage import Parser
from viewer.errors import OutputError, ViewerError
from viewer.near_names import did_you_mean
from viewer.phrases import printable
from viewer.streams import summary_stream

_FAILED = 1  # exit code if an item failed or has findings


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
