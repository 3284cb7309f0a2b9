"""Conversion of the diagnostics of readers and loaders to findings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from viewer.diagnostics import Diagnostic
from viewer.diagnostics.wording import PLACES
from viewer.errors import ViewerError
from viewer.lint._finding import Finding

__all__ = ["CHECKED", "of_diagnostic", "of_error", "of_refusal"]

CHECKED = frozenset(("W001", "W002", "W004", "B003", "M010", "C005"))
"""Codes of warnings that the checks of the scene report too, with all locations."""


def of_error(problem: ViewerError, path: Path | None = None) -> Finding:
    """Return an error as a finding; ``path`` is the file that failed, if the error has none."""
    found = problem.diagnostic
    if found is None:  # the figure's classes reported parts that do not match
        found = Diagnostic("F002.misfit", path, values={"message": str(problem)}, is_refusal=True)
    return of_diagnostic(found)


def of_refusal(problem: ViewerError, path: Path) -> Finding:
    """Return the error that stopped parsing a file as a finding."""
    finding = of_error(problem, path)
    return replace(finding, diagnostic=replace(finding.diagnostic, is_final=True))


def of_diagnostic(found: Diagnostic) -> Finding:
    """Return a reader's diagnostic as a finding."""
    field = PLACES.get(found.part)
    if field is None or found.places is None:
        return Finding(found)
    places: dict[str, Any] = {field: found.places}
    return Finding(found, **places)
