"""Checks of rigs and motions: errors, their locations, and remedies."""

from __future__ import annotations

import argparse
import json
from typing import Literal

import numpy as np

from viewer.commands._numbers import number
from viewer.commands._printing import print_line, table_lines
from viewer.commands._progress import Progress
from viewer.commands._scene import (
    add_capture_arguments,
    add_file_arguments,
    motion_settings,
    scene_files,
    size_limit,
    use_models,
)
from viewer.commands._sequence.frame_numbers import rate
from viewer.commands._usage import require_files
from viewer.diagnostics.record import note_values
from viewer.errors import ViewerError
from viewer.lint import (
    CODES,
    MAX_ROTATION,
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
    _add_limits(group)


def _add_limits(group: argparse._ArgumentGroup) -> None:
    """Add the limits of motions, which depend on the user's purpose."""
    group.add_argument(
        "--max-speed",
        type=number,
        metavar="S",
        help="speed limit of joints and keypoints, in figure units per second (default: 15 sizes)",
    )
    group.add_argument(
        "--max-rotation",
        type=number,
        default=MAX_ROTATION,
        metavar="DEGREES",
        help=f"speed limit of joint rotations, per second (default: {MAX_ROTATION:g})",
    )
    group.add_argument(
        "--confidence",
        type=number,
        default=0.3,
        metavar="C",
        help="minimum confidence of captured keypoints; keypoints that are below it in more than 5 "
        "%% of their frames are reported (default: 0.3)",
    )
    group.add_argument(
        "--ground",
        type=_ground,
        default="auto",
        metavar="HEIGHT|auto|none",
        help="height of the ground; feet that are below it by more than 1 %% of the figure's "
        "height (17 mm for a person) are reported; auto: the height at which feet rest longest; "
        "none: feet are not checked (default: auto)",
    )
    group.add_argument(
        "--fps",
        type=rate,
        metavar="N",
        help="frames per second of captures, and for sampling keyframed clips (default: 30)",
    )
    group.add_argument(
        "--hands", choices=("mean", "flat"), help="hand pose to which hand parameters are added"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the findings, worst first; return 1 if any is as severe as ``--fail-on``."""
    if arguments.codes:
        print("\n".join(_code_lines()))
        return 0
    require_files(arguments, "lint")
    ignored = _ignored(arguments.ignore)
    options = LintOptions(
        max_speed=arguments.max_speed,
        max_rotation=float(np.radians(arguments.max_rotation)),
        confidence=arguments.confidence,
        frame_rate=arguments.fps,
        ground=arguments.ground,
    )
    use_models(arguments)
    files = scene_files(arguments)
    with Progress("checking", 1) as progress:

        def show(done: int, total: int, what: str) -> None:
            progress.title, progress.total = what, total
            progress.show(done)

        scene, findings = lint_files(
            files, options, motion_settings(arguments), size_limit(arguments), show
        )
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


def _ignored(text: str) -> set[str]:
    codes = {code.strip().upper() for code in text.split(",") if code.strip()}
    unknown = sorted(codes - CODES.keys())
    if unknown:
        hint = did_you_mean(unknown[0], CODES) or "--codes lists them"
        raise ViewerError(f'--ignore: no code is called "{printable(unknown[0], 40)}"; {hint}')
    return codes


def _code_lines() -> list[str]:
    return table_lines(
        [[name, code.severity, f"{code.title}: {code.hint}"] for name, code in CODES.items()]
    )
