"""Checks of rigs and motions: errors, their locations, and remedies."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal, overload

from viewer.commands._frames import rate
from viewer.commands._keywords import arguments_of, paths_of, without_dashes
from viewer.commands._pose import PoseOptions
from viewer.commands._printing import print_line, table_lines
from viewer.commands._progress import shown_progress
from viewer.commands._scene import add_capture_arguments, add_file_arguments, scene_options
from viewer.commands._settings import add_settings, number, settings_of
from viewer.commands._usage import require_files
from viewer.data_classes import dataclass
from viewer.diagnostics.codes import codes_in
from viewer.diagnostics.record import note_values
from viewer.errors import ViewerError
from viewer.linting import (
    SEVERITIES,
    Finding,
    LintOptions,
    describe,
    finding_text,
    known_codes,
    lint_files,
    recheck,
    summary,
    used_checks,
    worst_first,
)
from viewer.near_names import did_you_mean
from viewer.phrases import printable
from viewer.rigs.scene import Actor, Scene, scene_of

if TYPE_CHECKING:
    from viewer.schemas import FindingData, LintData

_FOUND = 1  # exit code if there are findings
_STYLES = {"error": "red", "warning": "yellow"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.usage = "%(prog)s FILES ... [options]"
    add_file_arguments(parser, default="")
    add_capture_arguments(parser)
    group = parser.add_argument_group("bodies")
    add_settings(group, PoseOptions, "hands", choices=("mean", "flat"))
    group = parser.add_argument_group("results")
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
    _add_check_arguments(parser)


def _add_check_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that an open scene can be checked with, too."""
    group = parser.add_argument_group("checks")
    group.add_argument(
        "--ignore", default="", metavar="CODE,…", help="codes to ignore, such as W006,M005"
    )
    # The limits of motions depend on the user's purpose.
    add_settings(group, LintOptions, "max_speed", "max_rotation", "confidence")
    add_settings(group, LintOptions, "ground", type=_ground)
    add_settings(group, LintOptions, "frame_rate", type=rate)


def run(arguments: argparse.Namespace) -> int:
    """Print the findings, worst first; return 1 if any is as severe as ``--fail-on``."""
    if arguments.codes:
        rows = [
            [name, code.severity, f"{code.title}: {code.hint}"]
            for name, code in known_codes().items()
        ]
        print("\n".join(table_lines(rows)))
        if failed := used_checks()[1]:
            raise failed[0]
        return 0
    require_files(arguments.files, arguments.body, "lint")
    found = _checked(arguments)
    findings, described = found.all, found.to_dict()
    note_values(described)
    if arguments.json:
        print(json.dumps(described, indent=1, allow_nan=False))
    else:
        for finding in findings:
            print_line((finding_text(finding), _STYLES.get(finding.severity, "")))
        for body in described["bodies"]:
            title = " ".join(filter(None, (body["gender"], body["model"])))
            print(f"{body['name']}: body of {title}")
        print(summary(findings, found.n_files))
    if arguments.fail_on == "never":
        return 0
    limit = SEVERITIES.index(arguments.fail_on)
    is_bad = any(SEVERITIES.index(finding.severity) >= limit for finding in findings)
    return _FOUND if is_bad else 0


def lint(what: Scene | Actor | str | Path | Sequence[str | Path], **options: object) -> Findings:
    """Check rigs and motions as ``viewer lint`` does: what is wrong, where, and how to fix it.

    Parameters
    ----------
    what : Scene, Actor, path, or sequence of paths
        An open scene in its current state, or files, whose errors of reading are findings, too.
        The files of an open scene are read again for the lines of its findings.
    **options
        Options of the command with underscores: ``ignore="W007"``, ``max_speed``,
        ``max_rotation`` (degrees per second), ``confidence``, ``fps``, ``ground``; for files also
        those that say how they are read, such as ``model`` and ``up``.

    Returns
    -------
    Findings
        The findings, worst first.

    Raises
    ------
    ViewerError
        If there is no such option or value; the message names those allowed.

    >>> import viewer
    >>> viewer.lint(viewer.load("fox"), ignore="W007,W008").codes
    ('S005',)
    """
    if isinstance(what, Scene | Actor):
        arguments = arguments_of("lint", _add_check_arguments, options)
        scene = scene_of(what, "lint")
        with without_dashes():
            ignored, chosen = _ignored(arguments), settings_of(LintOptions, arguments)
            with shown_progress("checking"):
                found = recheck(scene, (), chosen)
        return _findings(found.findings, ignored, scene, found.n_files, found.notes)
    named = paths_of("lint", what)
    without = ("json", "codes", "fail_on", "body")
    arguments = arguments_of("lint", add_arguments, options, without)
    arguments.files = named
    with without_dashes():
        return _checked(arguments)


@dataclass(frozen=True, slots=True, eq=False)
class Findings(Sequence[Finding]):
    """Findings of ``viewer.lint``, worst first."""

    all: tuple[Finding, ...]
    """Each has ``code``, ``severity``, ``message``, ``hint``, ``file`` and ``line``; ``str`` of all
    is what the command prints."""
    scene: Scene
    """The scene that was checked."""
    n_files: int = 0
    """Number of checked files."""
    notes: tuple[str, ...] = ()
    """Files that are missing or were changed since the scene was opened."""

    @property
    def codes(self) -> tuple[str, ...]:
        """Codes that were found, worst first."""
        return tuple(dict.fromkeys(finding.code for finding in self.all))

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Findings that are errors, not warnings or notes."""
        return tuple(finding for finding in self.all if finding.severity == "error")

    def to_dict(self) -> LintData:
        """Return the data of ``viewer lint --json``; ``viewer help json`` describes them."""
        return describe(self.all, self.scene)

    def to_dicts(self) -> list[FindingData]:
        """Return the findings of ``to_dict``, one dict each: rows of a table."""
        return self.to_dict()["findings"]

    def __str__(self) -> str:
        return "\n".join([*map(finding_text, self.all), summary(self.all, self.n_files)])

    def __repr__(self) -> str:
        return f"<Findings: {summary(self.all, self.n_files)}>"

    def __len__(self) -> int:
        return len(self.all)

    @overload
    def __getitem__(self, which: int) -> Finding: ...

    @overload
    def __getitem__(self, which: slice) -> tuple[Finding, ...]: ...

    def __getitem__(self, which: int | slice) -> Finding | tuple[Finding, ...]:
        return self.all[which]


def _checked(arguments: argparse.Namespace) -> Findings:
    """Check files as requested."""
    ignored, options = _ignored(arguments), settings_of(LintOptions, arguments)
    asked = scene_options(arguments)
    files = asked.paths
    with shown_progress("checking"):
        scene, findings = lint_files(files, options, asked.motion, asked.size_limit)
    return _findings(findings, ignored, scene, len(files))


def _ignored(arguments: argparse.Namespace) -> set[str]:
    ignored = set(codes_in(arguments.ignore))
    known = known_codes() if ignored else {}
    unknown = sorted(ignored - known.keys())
    if unknown:
        hint = did_you_mean(unknown[0], known) or "viewer lint --codes lists them"
        raise ViewerError(f'--ignore: no code is called "{printable(unknown[0], 40)}"; {hint}')
    return ignored


def _findings(
    found: Sequence[Finding],
    ignored: set[str],
    scene: Scene,
    n_files: int,
    notes: tuple[str, ...] = (),
) -> Findings:
    kept = [finding for finding in found if finding.code not in ignored]
    return Findings(tuple(worst_first(kept)), scene, n_files, notes)


def _ground(text: str) -> float | Literal["auto", "none"]:
    if text == "auto":
        return "auto"
    return "none" if text == "none" else number(text)
