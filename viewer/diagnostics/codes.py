"""Diagnostic codes: severity, title and remedy."""

from __future__ import annotations

from viewer.data_classes import dataclass
from viewer.diagnostics.template import rendered

SEVERITIES = ("note", "warning", "error")
"""Severities in ascending order."""


@dataclass(frozen=True, slots=True)
class Code:
    """One kind of finding."""

    severity: str
    """One of ``SEVERITIES``; a diagnostic may override it."""
    title: str
    """Short description, for lists of codes."""
    remedy: str
    """Suggested remedy, a template without values."""
    other_remedy: str = ""
    """Suggested remedy if no line is known; empty if it is the same."""

    @property
    def hint(self) -> str:
        """Suggested remedy."""
        return rendered(self.remedy, {})

    @property
    def other_hint(self) -> str:
        """Suggested remedy if no line is known; empty if it is the same."""
        return rendered(self.other_remedy, {})
