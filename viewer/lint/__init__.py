"""Check rigs and motions: every fault has a code, a place, and what to do about it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from viewer.diagnostics import CODES as ALL_CODES
from viewer.diagnostics import SEVERITIES, Code
from viewer.lint._again import Again, lint_again
from viewer.lint._aim import Places, places_of, points_of
from viewer.lint._finding import MAX_TURN, Finding, LintOptions, Subject
from viewer.lint._report import describe, finding_text, summary, worst_first
from viewer.lint._running import CHECKS, Check, Progress, lint_scene
from viewer.rig.scene import Scene

if TYPE_CHECKING:
    from viewer.loading import MotionSettings

__all__ = [
    "CHECKS",
    "CODES",
    "MAX_TURN",
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

CODES = {name: code for name, code in ALL_CODES.items() if name[0] in "FWBSMYC"}
"""By code: files, weights, bindings, skeletons, meshes, symmetry and clips; see ``diagnostics``."""


def lint_files(
    paths: Sequence[str | Path],
    options: LintOptions | None = None,
    settings: MotionSettings | None = None,
    max_size: int | None = None,
    progress: Progress | None = None,
) -> tuple[Scene, list[Finding]]:
    """Open files together and check everything; what cannot be opened is a finding too.

    Faults that the viewer refuses a file for are noted, all of them, and the rest of the file is
    looked at as far as they leave it.

    Parameters
    ----------
    paths : sequence of str or Path
        As for ``viewer.loading.load``.
    options : LintOptions, optional
        What counts as a fault.
    settings : MotionSettings, optional
        How motions are taken.
    max_size : int, optional
        Larger files, in bytes, are not read.
    progress : callable, optional
        As for ``lint_scene``; reading counts as well.

    Returns
    -------
    scene : Scene
        What could be opened; findings refer to its actors.
    findings : list of Finding
        First what readers say, then what the checks find, each with its file where it is known.
    """
    from viewer.formats import MAX_SIZE
    from viewer.lint._opening import open_files, spoiled_parts, with_files

    size = MAX_SIZE if max_size is None else max_size
    opened = open_files(paths, settings, size, progress)
    findings = lint_scene(opened.scene, options, progress, spoiled_parts(opened))
    return opened.scene, with_files(opened, findings)
