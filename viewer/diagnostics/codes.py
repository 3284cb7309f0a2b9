"""Diagnostic codes: severity, title and remedy."""

from __future__ import annotations

from viewer.data_classes import dataclass

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
        Suggested remedy, a template without values.
    other_hint : str
        Suggested remedy if no line is known; empty if it is the same.
    """

    severity: str
    title: str
    hint: str
    other_hint: str = ""
