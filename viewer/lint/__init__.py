"""Checks of rigs and motions, whose findings have a code, a location and a suggested remedy."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from viewer.diagnostics import CODES as ALL_CODES
from viewer.diagnostics import SEVERITIES, Code
from viewer.lint._again import Again, lint_again
from viewer.lint._aim import Places, places_of, points_of
from viewer.lint._finding import MAX_ROTATION, Finding, LintOptions, Subject
from viewer.lint._report import describe, finding_text, summary, worst_first
from viewer.lint._running import CHECKS, Check, Progress, lint_scene
from viewer.rig.scene import Scene

if TYPE_CHECKING:
    from viewer.loading import MotionSettings

__all__ = [
    "CHECKS",
    "CODES",
    "MAX_ROTATION",
    "SEVERITIES",
    "Again",
    "Check",
    "Code",
    "Finding",
    "LintOptions",
    "Places",
    "Progress",
    "Subject",
    "describe",
    "finding_text",
    "lint_again",
    "lint_files",
    "lint_scene",
    "places_of",
    "points_of",
    "summary",
    "worst_first",
]

CODES = {name: code for name, code in ALL_CODES.items() if name[0] in "FGWBSMYC"}
"""By code: files, glTF files, weights, bindings, skeletons, meshes, symmetry and clips."""


def lint_files(
    paths: Sequence[str | Path],
    options: LintOptions | None = None,
    settings: MotionSettings | None = None,
    max_size: int | None = None,
    progress: Progress | None = None,
) -> tuple[Scene, list[Finding]]:
    """Open files together and run all checks; files that cannot be opened become findings too.

    All errors for which the viewer would reject a file are recorded, and everything else in the
    file is checked if possible.

    Parameters
    ----------
    paths : sequence of str or Path
        As for ``viewer.loading.load``.
    options : LintOptions, optional
        Thresholds of the checks.
    settings : MotionSettings, optional
        Settings that determine how motions are interpreted.
    max_size : int, optional
        Larger files, in bytes, are not read.
    progress : callable, optional
        As for ``lint_scene``; also called while files are read.

    Returns
    -------
    scene : Scene
        Contents of all files that could be opened; findings refer to its actors.
    findings : list of Finding
        Messages of readers, then results of checks, each with its file if known.
    """
    from viewer.formats import MAX_SIZE
    from viewer.lint._opening import invalid_parts, open_files, with_files

    size = MAX_SIZE if max_size is None else max_size
    opened = open_files(paths, settings, size, progress)
    findings = lint_scene(opened.scene, options, progress, invalid_parts(opened))
    return opened.scene, with_files(opened, findings)
