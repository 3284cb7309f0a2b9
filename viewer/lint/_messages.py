"""What readers and loaders say, as findings: their own words with a code, file and line."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

from viewer.diagnostics import Diagnostic
from viewer.errors import ViewerError
from viewer.lint._finding import Finding
from viewer.phrases import printable

__all__ = ["CHECKED", "of_diagnostic", "of_error", "of_refusal"]

# The first pattern that is found counts.
_ERRORS = (
    ("F001", r"cannot be read:|no such file|expected a file, found|\(--max-size\)"),
    ("W003", r"weights\b.*(?:finite numbers|found \"[+-]?(?:nan|inf))"),
    ("F003", r"expected finite|found \"[+-]?(?:nan|inf(?:inity)?)\""),
    ("F003", r"found \"[+-]?(?:1\.#|[\d.]+e\+?\d\d)"),
    ("F003", r"expected numbers up to"),
    ("W002", r"expected no negative weight"),
    ("W001", r"vertex \d+: expected weights with the sum 1"),
    ("W010", r"expected a joint index below|expected a joint from 0 to"),
    ("S001", r"expected a parent before it"),
    ("S003", r"expected a minimum not above the maximum"),
    ("B002", r"expected matrices that can be inverted"),
    (
        "B001",
        r"binding matrices|bindings.*: expected \d+ matri|beside `(?:bindings|skinweights)`",
    ),
    ("C009", r"channels?, .* needs|has \d+ joints, figure"),
    (
        "F004",
        r"open it (?:together )?with|does not fit|has no texture coordinates|needs a skeleton"
        r"|to follow the \d+ joints",
    ),
)
_WARNINGS = (
    ("W004", r"(?:vertices|vertex) without (?:influence|weights)"),
    ("W002", r"negative weights?\b"),
    ("W001", r"do not add up to 1|weight sums? differs? from 1"),
    ("S003", r"limits? whose minimum is above the maximum"),
    ("B003", r"can hardly be inverted"),
    ("M007", r"normals? of length 0"),
    ("M010", r"units away from the others"),
    ("C001", r"keys sorted"),
    ("C010", r"channel \d+ has no keys"),
    ("C005", r"frames? .*(?:gap|left out|missing)"),
    ("F007", r"texcoords without a texture"),  # nothing is missing: no picture was ever named
    (
        "F005",
        r"drawn untextured|drawn without|a texture without|lies outside the folder"
        r"|is an absolute path",
    ),
    (
        "F006",
        r"skipped unknown|is missing: .* ends with the file|the last \"}\" is missing|ignored",
    ),
)

CHECKED = frozenset(("W001", "W002", "W004", "B003", "M010", "C005"))
"""Codes of warnings that checks of the scene find again, with all places."""

_FIELDS = {
    "positions": "vertices",
    "weights": "vertices",
    "triangles": "triangles",
    "bindings": "joints",
    "joints": "joints",
    "items": "joints",
    "frames": "frames",
}
"""Fields of a finding by the part of a diagnostic."""


def of_error(problem: ViewerError, path: Path | None = None) -> Finding:
    """Return a refusal as a finding; ``path`` is the file at fault, if the error does not say."""
    found = problem.diagnostic
    if found is None:
        text = _without_place(str(problem), path)
        found = Diagnostic("F002.plain", path, values={"message": text})
    return of_diagnostic(found)


def of_refusal(problem: ViewerError, path: Path) -> Finding:
    """Return what ended the reading of a file as a finding."""
    finding = of_error(problem, path)
    return replace(finding, diagnostic=replace(finding.diagnostic, is_final=True))


def of_diagnostic(found: Diagnostic) -> Finding:
    """Return what a reader recorded as a finding."""
    if found.key.endswith(".plain"):
        patterns, other = (_ERRORS, "F002") if found.code == "F002" else (_WARNINGS, "F007")
        if found.code in ("F002", "F007"):
            found = replace(found, key=_code(found.message, patterns, other) + ".plain")
    field = _FIELDS.get(found.part)
    if field is None or found.places is None:
        return Finding(found)
    places: dict[str, Any] = {field: found.places}
    return Finding(found, **places)


def _without_place(text: str, path: Path | None) -> str:
    if path is not None:
        start = re.escape(printable(path, 300))
        return re.sub(rf"\A{start}(?::\d+)?: ", "", text)
    return text


def _code(text: str, patterns: tuple[tuple[str, str], ...], other: str) -> str:
    return next((code for code, pattern in patterns if re.search(pattern, text)), other)
