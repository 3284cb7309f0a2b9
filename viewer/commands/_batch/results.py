"""Summary files written when a batch ends: a table and an overview of all items."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

from viewer.batching.items import Result
from viewer.batching.overview import PAGES, check_overview, save_overview
from viewer.batching.tables import save_table
from viewer.errors import OutputError, UnsupportedFormatError, ViewerError
from viewer.phrases import counted, printable

_DRAWN = ("render", "diff")


def add_result_arguments(parser: argparse.ArgumentParser, job: str) -> None:
    """Add the options of a job."""
    group = parser.add_argument_group("results")
    group.add_argument(
        "--table",
        default="",
        metavar="FILE.csv",
        help=f"write one row per {'figure of each input' if job == 'info' else 'input'} (with "
        "--shard 0/8: FILE.0-of-8.csv)",
    )
    kinds = "a page (.html) of all inputs"
    if job in _DRAWN:
        kinds += ", or contact sheets of their images (.png, .jpg)"
    example = "sheet.png" if job == "render" else "page.html"
    group.add_argument(
        "--overview",
        default="",
        metavar="FILE",
        help=f"write {kinds}, such as {example}; failed inputs are marked",
    )
    if job == "diff":
        group.add_argument(
            "--expect",
            action="append",
            default=[],
            metavar="PATTERN",
            help="compare this file of each folder or zip archive, such as student.skel or "
            "'*.skin'; repeat the option for several files (default: files with the suffixes of "
            "the reference)",
        )


def check_results(job: str, table: str, overview: str, may_replace: bool, output: str = "") -> None:
    """Check the file names, empty for none, before the batch starts and creates ``output``."""
    if table and Path(table).suffix.lower() != ".csv":
        raise UnsupportedFormatError(
            f'--table: {printable(table, 300)}: expected .csv, found "{Path(table).suffix}"'
        )
    if overview:
        check_overview(overview)
        if job not in _DRAWN and Path(overview).suffix.lower() not in PAGES:
            is_figure = job in ("convert", "rig")
            remedy = "; viewer batch render draws the outputs" if is_figure else ""
            raise ViewerError(
                f"--overview: contact sheets show the images of {' and '.join(_DRAWN)}: expected a "
                f'page (.html) of {job}, found "{Path(overview).suffix}"{remedy}'
            )
        if not output and Path(overview).suffix.lower() not in PAGES:
            raise ViewerError(
                f"--overview: {printable(overview, 300)}: expected -o OUT for the images of the "
                "sheet, or a page (.html), found neither"
            )
    for path in filter(None, (table, overview)):
        if not may_replace and os.path.lexists(path):
            raise OutputError(f"{printable(path, 300)}: already exists (--force replaces it)")
        parent = Path(path).absolute().parent
        is_made = bool(output) and parent.is_relative_to(Path(output).absolute())
        if not (parent.is_dir() or is_made):
            folder = printable(Path(path).parent, 300)
            raise OutputError(f"{printable(path, 300)}: the folder {folder} does not exist")


def name_in_shard(path: str, shard: str) -> str:
    """Return the name of one shard's file, so that shards do not replace each other's files.

    >>> name_in_shard("a/grades.csv", "0/8"), name_in_shard("grades.csv", "")
    ('a/grades.0-of-8.csv', 'grades.csv')
    """
    if not (path and shard):
        return path
    root, suffix = os.path.splitext(path)
    return f"{root}.{shard.replace('/', '-of-')}{suffix}"


def save_results(job: str, table: str, overview: str, results: Sequence[Result]) -> list[str]:
    """Write the files, empty for none; return a line about each."""
    lines = []
    for path in filter(None, (table, overview)):
        try:
            Path(path).absolute().parent.mkdir(parents=True, exist_ok=True)
        except OSError as problem:
            raise OutputError.at(path, problem) from None
    if table:
        n_rows = save_table(table, job, results)
        lines.append(f"{printable(table, 300)}: table of {counted(n_rows, 'item')}")
    return lines + (save_overview(overview, job, results) if overview else [])
