"""Faults on their way to whoever knows their file, or decides that they are only remarks."""

from __future__ import annotations

from dataclasses import replace

from viewer.diagnostics import Diagnostic, Phrase

__all__ = ["MisfitError", "remark_on"]


class MisfitError(Exception):
    """A value that cannot be used; whoever knows the file and the place says so.

    Attributes
    ----------
    problem : Phrase
        ``expected …, found …``.
    """

    def __init__(self, problem: Phrase) -> None:
        self.problem = problem
        super().__init__(str(problem))


def remark_on(key: str, fault: Diagnostic) -> Diagnostic:
    """Return a remark at the place of a fault whose message shows the fault as ``problem``."""
    problem = replace(fault, path=None, line=None)
    return Diagnostic(key, fault.path, fault.line, values={"problem": problem})
