"""What readers and loaders say, as findings: their own words with a code, file and line."""

from __future__ import annotations

import re
from pathlib import Path

from viewer.errors import FormatError, ViewerError, printable
from viewer.lint._finding import Finding

__all__ = ["CHECKED", "of_error", "of_warning"]

# The first pattern that is found counts.
_ERRORS = (
    ("F001", r"cannot be read:|no such file|expected a file, found|\(--max-size\)"),
    ("W003", r"weights\b.*(?:finite numbers|found \"[+-]?(?:nan|inf))"),
    ("F003", r"expected finite|found \"[+-]?(?:nan|inf(?:inity)?)\""),
    ("W002", r"expected no negative weight"),
    ("W001", r"vertex \d+: expected weights with the sum 1"),
    ("W010", r"expected a joint index below|expected a joint from 0 to"),
    ("S001", r"expected a parent before it"),
    ("S003", r"expected a minimum not above the maximum"),
    ("B002", r"expected matrices that can be inverted"),
    (
        "B001",
        r"binding matrices|bindings.*: expected \d+ matrices|beside `(?:bindings|skinweights)`",
    ),
    ("C009", r"channels, .* needs|has \d+ joints, figure"),
    (
        "F004",
        r"open it (?:together )?with|does not fit|has no texture coordinates|needs a skeleton",
    ),
)
_WARNINGS = (
    ("W004", r"vertices without (?:influence|weights)"),
    ("W002", r"negative weights"),
    ("W001", r"do not add up to 1|weight sums differ from 1"),
    ("S003", r"limits whose minimum is above the maximum"),
    ("B003", r"can hardly be inverted"),
    ("M007", r"normals of length 0"),
    ("M010", r"units away from the others"),
    ("C001", r"keys sorted"),
    ("C010", r"channel \d+ has no keys"),
    ("C005", r"frames? .*(?:gap|left out|missing)"),
    ("F007", r"texcoords without a texture"),  # nothing is missing: no picture was ever named
    ("F005", r"drawn untextured|drawn without|a texture without|lies outside the folder"),
    (
        "F006",
        r"skipped unknown|is missing: .* ends with the file|the last \"}\" is missing|ignored",
    ),
)

CHECKED = frozenset(("W001", "W002", "W004", "B003", "M010", "C005"))
"""Codes of warnings that checks of the scene find again, with all places."""

_PLACE = re.compile(r"(?P<path>.+?)(?::(?P<line>\d+))?: (?P<text>.*)", re.DOTALL)


def of_error(problem: ViewerError, path: Path | None = None) -> Finding:
    """Return a refusal as a finding.

    Parameters
    ----------
    problem : ViewerError
        A cycle of parents is told from other errors by the attribute ``code`` of a FormatError.
    path : Path, optional
        The file at fault, if the error does not say.
    """
    text, line = str(problem), None
    code = ""
    if isinstance(problem, FormatError):
        path, line, code = problem.path, problem.line, problem.code
    text = _without_place(text, path)
    return Finding(code or _code(text, _ERRORS, "F002"), text, "error", file=path, line=line)


def of_warning(warning: str, path: Path) -> Finding:
    """Return a remark as a finding; what is not known to be a fault is a note.

    Parameters
    ----------
    warning : str
        One line, which begins with the file's name and the line, if it has one.
    path : Path
        The file that was read.
    """
    start = printable(path, 300)
    if not warning.startswith(start):
        found = _PLACE.fullmatch(warning)
        if found is not None and Path(found["path"]).parent == path.parent:
            path, start = Path(found["path"]), found["path"]
    line = None
    if warning.startswith(start):
        found = re.fullmatch(r"(?::(\d+))?: (.*)", warning[len(start) :], re.DOTALL)
        if found is not None:
            line = None if found[1] is None else int(found[1])
            warning = found[2]
    return Finding(_code(warning, _WARNINGS, "F007"), warning, file=path, line=line)


def _without_place(text: str, path: Path | None) -> str:
    if path is not None:
        start = re.escape(printable(path, 300))
        return re.sub(rf"\A{start}(?::\d+)?: ", "", text)
    return text


def _code(text: str, patterns: tuple[tuple[str, str], ...], other: str) -> str:
    return next((code for code, pattern in patterns if re.search(pattern, text)), other)
