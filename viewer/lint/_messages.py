"""What readers and loaders say, as findings: their own words with a code, file and line."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.errors import FormatError, ViewerError, printable
from viewer.formats import Fault
from viewer.lint._finding import Finding, listed

__all__ = ["CHECKED", "of_error", "of_faults", "of_refusal", "of_warning"]

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

# Fields of a finding, and what messages call them, by what a reader put something neutral for.
_PLACES = {
    "positions": ("vertices", "vertices"),
    "weights": ("vertices", "vertices"),
    "triangles": ("triangles", "triangles"),
    "bindings": ("joints", "joints"),
    "joints": ("joints", "joints"),
    "frames": ("frames", "frames"),
}
_NAMED = re.compile(r'"[^"]*"|[-+]?\d[-+.\w]*|\b(?:nan|inf)\b')  # what differs between alike faults
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


def of_refusal(problem: ViewerError, path: Path) -> Finding:
    """Return what ended the reading of a file as a finding, which says that it was the end."""
    finding = of_error(problem, path)
    if finding.code == "F001":
        return finding  # of a file that cannot be read nobody expects more
    return replace(finding, message=f"{finding.message}; nothing else in this file was checked")


def of_faults(faults: Sequence[Fault]) -> list[Finding]:
    """Return faults that a reader went on from as findings, those of one kind as one."""
    kinds: dict[tuple[str, ...], list[Fault]] = {}
    for fault in faults:
        if fault.count == 0:
            continue
        finding = of_error(fault.error)
        kind = _NAMED.sub("#", finding.message)
        kinds.setdefault((finding.code, fault.part, str(finding.file), kind), []).append(fault)
    return [_of_kind(alike) for alike in kinds.values()]


def _of_kind(faults: list[Fault]) -> Finding:
    """Return faults that say the same of different places as one finding."""
    finding = of_error(faults[0].error)
    count = sum(fault.count for fault in faults)
    places = np.unique(np.concatenate([fault.places for fault in faults]))
    field, noun = _PLACES.get(faults[0].part, ("", ""))
    text = finding.message
    if count > 1:
        text += f", the first of {count}"
        if len(places) > 1 and field:
            text += f" ({noun} {listed(list(map(str, places.tolist())))})"
    if field == "vertices":
        return replace(finding, message=text, vertices=places)
    if field == "triangles":
        return replace(finding, message=text, triangles=places)
    if field == "joints":
        return replace(finding, message=text, joints=places)
    return replace(finding, message=text, frames=places if field else finding.frames)


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
