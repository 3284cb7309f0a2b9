"""Check rigs and motions: what is wrong, where, and what to do about it."""

from __future__ import annotations

import argparse
import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from viewer.commands._numbers import number
from viewer.commands._progress import Progress
from viewer.commands._scene import (
    add_capture_arguments,
    add_file_arguments,
    motion_settings,
    scene_files,
    size_limit,
)
from viewer.errors import ViewerError, printable
from viewer.lint import CODES, SEVERITIES, Finding, LintOptions, lint_files
from viewer.loading import bundled_files
from viewer.rig.scene import Scene
from viewer.rig.skeleton import joint_labels

__all__ = ["add_arguments", "describe", "run"]

_FOUND = 1  # exit code
_LISTED = 100  # places of one finding in JSON; their number is always there


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    add_file_arguments(parser)
    add_capture_arguments(parser)
    group = parser.add_argument_group("checks")
    group.add_argument("--json", action="store_true", help="everything, for programs")
    group.add_argument("--codes", action="store_true", help="list all codes, and check nothing")
    group.add_argument(
        "--fail-on",
        choices=[*reversed(SEVERITIES), "never"],
        default="error",
        help="exit with 1 if there is a finding of this severity or worse (default: error)",
    )
    group.add_argument(
        "--ignore", default="", metavar="CODE,…", help="findings that are left out: W006,M005"
    )
    group.add_argument(
        "--max-speed",
        type=number,
        metavar="S",
        help="of joints and keypoints, figure units a second (default: 15 times its size)",
    )
    group.add_argument(
        "--max-turn",
        type=number,
        default=3400.0,
        metavar="DEGREES",
        help="that a joint may turn in a second (default: 3400)",
    )
    group.add_argument(
        "--confidence",
        type=number,
        default=0.3,
        metavar="C",
        help="of captured keypoints: less is low (default: 0.3)",
    )
    group.add_argument("--fps", type=number, metavar="N", help="frames a second of captures")
    group.add_argument("--hands", choices=("mean", "flat"), help="what hand poses of 0 mean")


def run(arguments: argparse.Namespace) -> int:
    """Print the findings, the worst first; 1 if one is as bad as ``--fail-on``."""
    if arguments.codes:
        print("\n".join(_code_lines()))
        return 0
    ignored = _ignored(arguments.ignore)
    options = LintOptions(
        max_speed=arguments.max_speed,
        max_turn=float(np.radians(arguments.max_turn)),
        confidence=arguments.confidence,
    )
    files = scene_files(arguments) or list(bundled_files())
    with Progress("checking", 1) as progress:

        def show(done: int, total: int, what: str) -> None:
            progress.title, progress.total = what, total
            progress.show(done)

        scene, findings = lint_files(
            files, options, motion_settings(arguments), size_limit(arguments), show
        )
    findings = [finding for finding in findings if finding.code not in ignored]
    findings.sort(key=lambda finding: -SEVERITIES.index(finding.severity))
    if arguments.json:
        print(json.dumps(describe(findings, scene), indent=1, allow_nan=False))
    else:
        print("\n".join([*map(_line, findings), _summary(findings, len(files))]))
    if arguments.fail_on == "never":
        return 0
    limit = SEVERITIES.index(arguments.fail_on)
    is_bad = any(SEVERITIES.index(finding.severity) >= limit for finding in findings)
    return _FOUND if is_bad else 0


def _ignored(text: str) -> set[str]:
    codes = {code.strip().upper() for code in text.split(",") if code.strip()}
    unknown = sorted(codes - CODES.keys())
    if unknown:
        raise ViewerError(f'--ignore: no code "{printable(unknown[0], 40)}" (--codes lists them)')
    return codes


def _code_lines() -> list[str]:
    return [
        f"{name}  {code.severity:<7}  {code.title}: {code.hint}" for name, code in CODES.items()
    ]


def _line(finding: Finding) -> str:
    """Return one finding as compilers print theirs, so that editors jump to file and line."""
    place = ""
    if finding.file is not None and finding.file != Path():
        place = printable(finding.file, 300)
        place += f":{finding.line}" if finding.line is not None else ""
    elif finding.name:
        place = printable(finding.name, 100)
    head = f"{place}: " if place else ""
    text = printable(finding.message, 2000)
    return f"{head}{finding.severity} {finding.code}: {text}\n    {finding.title}: {finding.hint}"


def _summary(findings: list[Finding], n_files: int) -> str:
    counts = Counter(finding.severity for finding in findings)
    parts = [f"{counts[kind]} {kind}{'s' * (counts[kind] != 1)}" for kind in reversed(SEVERITIES)]
    return f"{', '.join(parts)} in {n_files} file{'s' * (n_files != 1)}"


def describe(findings: list[Finding], scene: Scene) -> dict[str, Any]:
    """Return findings ready for JSON.

    Parameters
    ----------
    findings : list of Finding
        Of this scene, or of its files.
    scene : Scene
        Names the joints.
    """
    counts = Counter(finding.severity for finding in findings)
    return {
        "findings": [_describe(finding, scene) for finding in findings],
        "counts": {kind: counts[kind] for kind in reversed(SEVERITIES)},
    }


def _describe(finding: Finding, scene: Scene) -> dict[str, Any]:
    has_file = finding.file is not None and finding.file != Path()
    facts: dict[str, Any] = {
        "code": finding.code,
        "severity": finding.severity,
        "title": finding.title,
        "message": printable(finding.message, 2000),
        "hint": finding.hint,
        "file": printable(finding.file, 1000) if has_file else None,
        "line": finding.line,
        "actor": finding.actor,
        "name": printable(finding.name),
    }
    for key in ("vertices", "triangles", "joints", "frames", "times"):
        values = getattr(finding, key)
        facts[key] = values[:_LISTED].tolist()
        facts[f"n_{key}"] = len(values)
    facts["joint_names"] = _joint_names(finding, scene)
    return facts


def _joint_names(finding: Finding, scene: Scene) -> list[str]:
    if finding.actor is None or len(finding.joints) == 0:
        return []
    figure = scene.actors[finding.actor].figure
    if figure.points is not None:
        names: tuple[str, ...] = figure.points.names
    elif figure.skeleton is not None:
        names = joint_labels(figure.skeleton)
    else:
        return []
    some = finding.joints[:_LISTED].tolist()
    return [printable(names[joint]) if joint < len(names) else f"#{joint}" for joint in some]
