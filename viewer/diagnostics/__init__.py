"""Errors, warnings and notes as data: message key, location and values.

A :class:`Diagnostic` refers to its message by a key, ``"W004.vertices"``: the stable code, a dot,
and the name of one of the code's messages. ``wording/`` holds the severity, title and remedy
of each code, and the template of each message. No code parses meaning from text.
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
)

if TYPE_CHECKING:
    from viewer.diagnostics.codes import SEVERITIES, Code
    from viewer.diagnostics.wording import CODES, MESSAGES

__all__ = [
    "CODES",
    "MESSAGES",
    "SEVERITIES",
    "Code",
    "Collector",
    "Diagnostic",
    "Part",
    "Phrase",
    "described",
    "frame_range",
]


def __getattr__(name: str) -> Any:
    """Import the wording when it is first used: most runs have no message to print."""
    if name not in ("CODES", "MESSAGES", "SEVERITIES", "Code"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from viewer.diagnostics import codes, wording

    return getattr(codes if hasattr(codes, name) else wording, name)
