"""Errors, warnings and notes as data: message key, location and values.

A :class:`Diagnostic` names its message by a key, ``"W004.vertices"``: the stable code, a dot, and
the name of one of the code's messages. The call writes key and sentence in one string, with names
of values in braces; ``wording.py`` has the sentences that several calls share, ``codes.py`` the
severity, title and remedy of each code. No code parses meaning from text.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from viewer.diagnostics.diagnostic import (
    Collector,
    Diagnostic,
    Part,
    Phrase,
    described,
    frame_range,
    note,
)

if TYPE_CHECKING:
    from viewer.diagnostics.codes import CODES, SEVERITIES, Code

__all__ = [
    "CODES",
    "SEVERITIES",
    "Code",
    "Collector",
    "Diagnostic",
    "Part",
    "Phrase",
    "described",
    "frame_range",
    "note",
]


def __getattr__(name: str) -> Any:
    """Import the codes when they are first used: most runs have no message to print."""
    if name not in ("CODES", "SEVERITIES", "Code"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from viewer.diagnostics import codes

    return getattr(codes, name)
