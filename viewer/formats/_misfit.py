"""Errors in code that has no reference to the file, and notes derived from errors."""

from __future__ import annotations

from dataclasses import replace

from viewer.diagnostics import Diagnostic, Phrase

__all__ = ["MisfitError", "remark_on"]


class MisfitError(Exception):
    """An invalid value; the caller adds the file and the line.

    Attributes
    ----------
    problem : Phrase
        ``expected …, found …``.
    """

    def __init__(self, problem: Phrase) -> None:
        self.problem = problem
        super().__init__(str(problem))


def remark_on(key: str, fault: Diagnostic) -> Diagnostic:
    """Return a note at the location of an error, which its message includes as ``problem``."""
    problem = replace(fault, path=None, line=None)
    return Diagnostic(key, fault.path, fault.line, values={"problem": problem})
