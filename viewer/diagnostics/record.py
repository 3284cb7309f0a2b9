"""Record of one run: diagnostics, data and written files, for callers that run commands."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping
from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from viewer.data_classes import dataclass
from viewer.diagnostics.diagnostic import Diagnostic, described
from viewer.phrases import printable

if TYPE_CHECKING:
    from viewer.diagnostics.codes import Severity
    from viewer.schemas import DiagnosticData, SaidData

JsonObject: TypeAlias = dict[str, Any]
"""A description as JSON data: numbers, texts, lists and objects by name."""


def finite(value: float) -> float | None:
    """Return a number, or None for infinity and NaN, which JSON lacks."""
    return value if math.isfinite(value) else None


@dataclass
class Record:
    """Data of a run that is not in its printed text."""

    diagnostics: list[DiagnosticData | SaidData] = field(default_factory=list)
    """Warnings and notes as returned by ``described``; entries that are only text have just
    ``severity`` and ``message``."""
    found: list[Diagnostic] = field(default_factory=list)
    """The same warnings and notes as they were found; entries that are only text have the code
    F007."""
    values: dict[str, object] = field(default_factory=dict)
    """Results as JSON data."""
    outputs: dict[str, None] = field(default_factory=dict)
    """Written files, in order, as keys."""


# Not a context variable: videos are encoded and written by separate threads.
_current: Record | None = None


@contextlib.contextmanager
def recorded() -> Iterator[Record]:
    """Record the run in the block. Runs are recorded one at a time per process."""
    global _current
    outer, record = _current, Record()
    _current = record
    try:
        yield record
    finally:
        _current = outer


def is_recorded() -> bool:
    """Return whether a run is being recorded."""
    return _current is not None


def note_found(found: Diagnostic | str, severity: Severity = "warning") -> bool:
    """Record a warning or note, a text with ``severity``; return whether a run is recorded."""
    if _current is None:
        return False
    if isinstance(found, Diagnostic):
        _current.found.append(found)
        _current.diagnostics.append(described(found))
    else:
        text = printable(found, 2000)
        _current.found.append(
            Diagnostic("F007.said: {message}", values={"message": text}, level=severity)
        )
        _current.diagnostics.append({"severity": severity, "message": text})
    return True


def note_values(values: Mapping[str, object]) -> None:
    """Record results as JSON data."""
    if _current is not None:
        _current.values |= values


def note_output(path: Path, instead_of: Path | None = None) -> None:
    """Record a written file, or a folder in place of the files in its temporary folder."""
    if _current is None:
        return
    if instead_of is not None:
        others = (one for one in _current.outputs if not Path(one).is_relative_to(instead_of))
        _current.outputs = dict.fromkeys(others)
    _current.outputs[str(path)] = None
