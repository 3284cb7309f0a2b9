"""Options of ``viewer batch`` that all jobs share."""

from __future__ import annotations

import argparse

from viewer.commands._settings import number

RETRIES = 2
TIMEOUT = 600.0  # default time limit of an attempt, seconds


def add_batch_arguments(
    parser: argparse.ArgumentParser,
    suffix: str = "",
    writes: str = "always",
    has_fixed: bool = False,
    timeout: float | None = TIMEOUT,
) -> None:
    """Add the options.

    ``parser``: parser of a job.
    ``suffix``: default of ``--to``.
    ``writes``: whether the job writes files: ``always``, ``maybe`` or ``never``.
    ``has_fixed``: whether the job itself has an option for files shared by all items.
    ``timeout``: default of ``--timeout``.
    """
    group = parser.add_argument_group("batch")
    if writes != "never":
        default = f" (default: {suffix})" if suffix else ""
        group.add_argument(
            "--to",
            default="",
            metavar="SUFFIX",
            help="format of the outputs if OUT is a folder, such as bvh; folder for outputs that "
            f"are folders{default}",
        )
    if not has_fixed:
        group.add_argument(
            "--with",
            dest="fixed",
            action="append",
            default=[],
            metavar="FILE",
            help="also open this file with every input, such as the .skel of .anim files",
        )
    group.add_argument(
        "--from-list",
        action="append",
        default=[],
        metavar="FILE|-",
        help="file with one path per line, or - for standard input",
    )
    _add_processes(group, timeout)
    _add_progress(group)


def _add_progress(group: argparse._ArgumentGroup) -> None:
    """Add the options for the report, and for resuming and dividing a batch."""
    group.add_argument(
        "--report",
        metavar="FILE",
        help="write one line of JSON per input (default: report.jsonl in OUT, if that is a folder)",
    )
    group.add_argument(
        "--resume",
        action="store_true",
        help="skip inputs that the report lists as done with the same content, options and "
        "version, and run all others again, replacing their outputs",
    )
    group.add_argument(
        "--shard",
        default="",
        metavar="I/N",
        help="run only every N-th input, starting with input I (0 to N - 1), for job arrays: "
        "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT with --array=0-7",
    )


def _add_processes(group: argparse._ArgumentGroup, timeout: float | None) -> None:
    usual = "0" if timeout is None else f"{timeout:g}; 0 for render"
    group.add_argument(
        "--workers",
        type=_whole,
        metavar="N",
        help="worker processes; 0: run in this process (default: 0 for few inputs, otherwise one "
        "per core; with --cluster slurm, the workers of one job)",
    )
    group.add_argument(
        "--cluster",
        default="",
        metavar="CLUSTER",
        help="run on Dask workers: local, an address such as tcp://host:8786, or "
        "slurm[:partition=gpu,time=2:00:00]",
    )
    group.add_argument(
        "--retries",
        type=_whole,
        default=RETRIES,
        metavar="N",
        help="run an input again if its worker crashed, hung or ran out of memory, at most N "
        f"times (default: {RETRIES})",
    )
    group.add_argument(
        "--timeout",
        type=number,
        metavar="SECONDS",
        help="terminate workers that take longer for one input; 0: never (default: "
        f"{usual}; no limit with --workers 0)",
    )
    group.add_argument(
        "--limit-memory",
        default="",
        metavar="SIZE",
        help="memory that a worker may use, such as 4G; suffixes k, M, G (default: no limit)",
    )


def _whole(text: str) -> int:
    if not (text.isdecimal() and int(text) <= 10_000):
        raise argparse.ArgumentTypeError(f"expected a number from 0 to 10000, found {text}")
    return int(text)
