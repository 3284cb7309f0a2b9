"""The code of a kind of fault: its severity, title and cure."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["SEVERITIES", "Code"]

SEVERITIES = ("note", "warning", "error")
"""From harmless to fatal."""


@dataclass(frozen=True, slots=True)
class Code:
    """One kind of finding.

    Attributes
    ----------
    severity : str
        One of ``SEVERITIES``; single findings may differ.
    title : str
        For lists.
    hint : str
        What to do.
    other_hint : str
        The same where no line is known; empty if it is no other.
    """

    severity: str
    title: str
    hint: str
    other_hint: str = ""
