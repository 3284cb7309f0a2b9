"""Codes of faults: severity, title and cure."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["SEVERITIES", "Code"]

SEVERITIES = ("note", "warning", "error")
"""Severities in ascending order."""


@dataclass(frozen=True, slots=True)
class Code:
    """One kind of finding.

    Attributes
    ----------
    severity : str
        One of ``SEVERITIES``; a diagnostic may override it.
    title : str
        Short description, for lists of codes.
    hint : str
        Suggested cure.
    other_hint : str
        Suggested cure if no line is known; empty if it is the same.
    """

    severity: str
    title: str
    hint: str
    other_hint: str = ""
