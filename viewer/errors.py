"""The exception hierarchy; callers catch at the level they need.

::

    ViewerError                 exit 2   an error the user can act on; one line, no traceback
    ├── FormatError             exit 2   a file breaks its format: path:line: expected, found
    ├── UnsupportedFormatError  exit 2   no reader or writer knows this kind of file
    ├── RigError                exit 2   parts that do not fit each other
    ├── RenderError             exit 4   no usable OpenGL, or the driver refused
    └── OutputError             exit 5   a result could not be written
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from viewer.diagnostics.diagnostic import Diagnostic
from viewer.phrases import printable

__all__ = [
    "FormatError",
    "OutputError",
    "RenderError",
    "RigError",
    "UnsupportedFormatError",
    "ViewerError",
]

_LONGEST = 1000  # characters of a message with names in it


class ViewerError(Exception):
    """An error the user can act on; ``str()`` is the one line to show.

    Parameters
    ----------
    problem : str or Diagnostic
        The line, or the fault whose line it is.

    Attributes
    ----------
    diagnostic : Diagnostic or None
        The fault as data, if it concerns a file or a figure.
    """

    exit_code = 2

    def __init__(self, problem: str | Diagnostic = "") -> None:
        self.diagnostic = problem if isinstance(problem, Diagnostic) else None
        # Names of joints, figures and files come from files and may contain any character.
        super().__init__(self._line(problem))

    def _line(self, problem: str | Diagnostic) -> str:
        return str(problem)


class FormatError(ViewerError):
    """A file breaks its own format.

    Parameters
    ----------
    diagnostic : Diagnostic
        The fault, with its file, and its line if the format has lines.
    """

    diagnostic: Diagnostic

    def __init__(self, diagnostic: Diagnostic) -> None:
        super().__init__(replace(diagnostic, is_refusal=True))

    @property
    def path(self) -> Path:
        """The file at fault."""
        return self.diagnostic.path or Path()

    @property
    def line(self) -> int | None:
        """Line of the fault, from 1, if the format has lines."""
        return self.diagnostic.line


class UnsupportedFormatError(ViewerError):
    """No reader or writer knows this kind of file."""

    def _line(self, problem: str | Diagnostic) -> str:
        return printable(problem, _LONGEST)


class RigError(ViewerError):
    """Parts of a figure that do not fit each other, or a name that it does not have."""

    def _line(self, problem: str | Diagnostic) -> str:
        return printable(problem, _LONGEST)


class RenderError(ViewerError):
    """OpenGL is missing or too old, or refused a request."""

    exit_code = 4


class OutputError(ViewerError):
    """A result could not be written; what was there before is untouched."""

    exit_code = 5
