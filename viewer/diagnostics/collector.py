"""Collector of diagnostics, in the order in which they are found."""

from __future__ import annotations

from collections.abc import Iterator

from viewer.diagnostics.diagnostic import Diagnostic

# Maximum number of warnings per file: users do not read longer lists.
_MOST = 100


class Collector:
    """Collects the diagnostics of readers and operations.

    Repeated warnings are dropped, as are warnings after the first hundred; all errors are kept.

    Parameters
    ----------
    keeps_errors : bool
        Whether a reader continues after an error in order to find all errors. Otherwise the
        first one is raised where it is recorded.
    """

    def __init__(self, keeps_errors: bool = False) -> None:
        self.keeps_errors = keeps_errors
        self._found: list[Diagnostic] = []
        self._warned: set[str] = set()

    def __iter__(self) -> Iterator[Diagnostic]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)

    def add(self, found: Diagnostic) -> None:
        """Record an error, or a warning that has not been recorded yet."""
        if found.is_refusal:
            self._found.append(found)
            return
        # A search for all errors has to list each faulty element, even if the messages are equal.
        message = f"{found.pointer} {found.message}" if self.keeps_errors else found.message
        if message in self._warned or len(self._warned) > _MOST:
            return
        self._warned.add(message)
        if len(self._warned) > _MOST:
            found = Diagnostic("F007.further-warnings", found.path)
        self._found.append(found)

    @property
    def errors(self) -> list[Diagnostic]:
        """Errors in the order found; ``load`` raises the first."""
        return [found for found in self._found if found.is_refusal]

    @property
    def warnings(self) -> list[Diagnostic]:
        """Warnings and notes in the order found."""
        return [found for found in self._found if not found.is_refusal]
