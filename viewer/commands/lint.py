"""Checks of rigs and motions: errors, their locations, and remedies."""

from __future__ import annotations

import argparse
import json
from typing import Literal

from viewer.commands._frames import rate
from viewer.commands._pose import PoseOptions
from viewer.commands._printing import print_line, table_lines
from viewer.commands._progress import shown_progress
from viewer.commands._scene import add_capture_arguments, add_file_arguments, scene_options
from viewer.commands._settings import add_settings, number, settings_of
from viewer.commands._usage import require_files
from viewer.diagnostics.record import note_values
from viewer.errors import ViewerError
from viewer.linting import (
    CODES,
    SEVERITIES,
    LintOptions,
    describe,
    finding_text,
    lint_files,
    summary,
    worst_first,
)
from viewer.near_names import did_you_mean
from viewer.phrases import printable

_FOUND = 1  # exit code if there are findings
_STYLES = {"error": "red", "warning": "yellow"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.usage = "%(prog)s FILES ... [options]"
    add_file_arguments(parser, default="")
    add_capture_arguments(parser)
    group = parser.add_argument_group("checks")
    group.add_argument("--json", action="store_true", help="print everything as JSON")
    group.add_argument(
        "--codes", action="store_true", help="list all codes without checking anything"
    )
    group.add_argument(
        "--fail-on",
        choices=[*reversed(SEVERITIES), "never"],
        default="error",
        help="exit with 1 if there is a finding of this severity or worse (default: error)",
    )
    group.add_argument(
        "--ignore", default="", metavar="CODE,…", help="codes to ignore, such as W006,M005"
    )
    # The limits of motions depend on the user's purpose.
    add_settings(group, LintOptions, "max_speed", "max_rotation", "confidence")
    add_settings(group, LintOptions, "ground", type=_ground)
    add_settings(group, LintOptions, "frame_rate", type=rate)
    add_settings(group, PoseOptions, "hands", choices=("mean", "flat"))


def run(arguments: argparse.Namespace) -> int:
    """Print the findings, worst first; return 1 if any is as severe as ``--fail-on``."""
    if arguments.codes:
        rows = [[name, code.severity, f"{code.title}: {code.hint}"] for name, code in CODES.items()]
        print("\n".join(table_lines(rows)))
        return 0
    require_files(arguments.files, arguments.body, "lint")
    ignored = {code.strip().upper() for code in arguments.ignore.split(",") if code.strip()}
    unknown = sorted(ignored - CODES.keys())
    if unknown:
        hint = did_you_mean(unknown[0], CODES) or "--codes lists them"
        raise ViewerError(f'--ignore: no code is called "{printable(unknown[0], 40)}"; {hint}')
    options = settings_of(LintOptions, arguments)
    asked = scene_options(arguments)
    files = asked.paths
    with shown_progress("checking"):
        scene, findings = lint_files(files, options, asked.motion, asked.size_limit)
    findings = [finding for finding in findings if finding.code not in ignored]
    findings = worst_first(findings)
    described = describe(findings, scene)
    note_values(described)
    if arguments.json:
        print(json.dumps(described, indent=1, allow_nan=False))
    else:
        for finding in findings:
            print_line((finding_text(finding), _STYLES.get(finding.severity, "")))
        for body in described["bodies"]:
            title = " ".join(filter(None, (body["gender"], body["model"])))
            print(f"{body['name']}: body of {title}")
        print(summary(findings, len(files)))
    if arguments.fail_on == "never":
        return 0
    limit = SEVERITIES.index(arguments.fail_on)
    is_bad = any(SEVERITIES.index(finding.severity) >= limit for finding in findings)
    return _FOUND if is_bad else 0


def _ground(text: str) -> float | Literal["auto", "none"]:
    if text == "auto":
        return "auto"
    return "none" if text == "none" else number(text)
