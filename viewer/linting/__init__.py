"""Checks of rigs and motions, whose findings have a code, a location and a suggested remedy."""

from __future__ import annotations

from viewer.diagnostics import CODES as ALL_CODES
from viewer.diagnostics import SEVERITIES, Code
from viewer.linting._files import Recheck, lint_files, recheck
from viewer.linting._finding import MAX_ROTATION, Finding, LintOptions
from viewer.linting._places import Places, places_of, points_of
from viewer.linting._report import describe, finding_text, summary, worst_first
from viewer.linting._running import CHECKS, Check, lint_scene, plugged_check, used_checks
from viewer.linting._subject import Subject

__all__ = [
    "CHECKS",
    "CODES",
    "MAX_ROTATION",
    "SEVERITIES",
    "Check",
    "Code",
    "Finding",
    "LintOptions",
    "Places",
    "Recheck",
    "Subject",
    "describe",
    "finding_text",
    "known_codes",
    "lint_files",
    "lint_scene",
    "places_of",
    "plugged_check",
    "points_of",
    "recheck",
    "summary",
    "used_checks",
    "worst_first",
]

CODES = {name: code for name, code in ALL_CODES.items() if name[0] in "FGWBSMYC"}
"""By code: files, glTF files, weights, bindings, skeletons, meshes, symmetry and clips."""


def known_codes() -> dict[str, Code]:
    """Return ``CODES`` with those of plug-ins that do not fail."""
    used_checks()
    return CODES | {name: code for name, code in ALL_CODES.items() if name[0] == "P"}
