"""Exception hierarchy; callers catch the level that they need.

::

    ViewerError                 exit 2   an error the user can act on; one line, no traceback
    ├── FormatError             exit 2   an invalid file: path:line: expected …, found …
    ├── UnsupportedFormatError  exit 2   no reader or writer for this kind of file
    ├── RigError                exit 2   incompatible parts of a figure, or an unknown name
    ├── PluginError             exit 2   a plug-in failed; the message names its package
    ├── RenderError             exit 4   no usable OpenGL, or a driver error
    └── OutputError             exit 5   a result could not be written
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Self

from viewer.diagnostics.diagnostic import Diagnostic
from viewer.phrases import printable

__all__ = [
    "FormatError",
    "OutputError",
    "PluginError",
    "RenderError",
    "RigError",
    "UnsupportedFormatError",
    "ViewerError",
    "reason_of",
]

_LONGEST = 1000  # maximum length of a message that contains names, characters


def reason_of(problem: Exception) -> str:
    """Return why a file could not be read or written: the system's words, if it gave any."""
    return printable(getattr(problem, "strerror", None) or str(problem) or type(problem).__name__)


class ViewerError(Exception):
    """An error the user can act on; ``str()`` is its message in one line.

    Attributes
    ----------
    diagnostic : Diagnostic or None
        The problem as data, if it concerns a file or a figure.

    Parameters
    ----------
    problem : str or Diagnostic
        The message, or a diagnostic that provides it.
    """

    exit_code = 2
    is_shortened = False
    """Whether the message contains names from files, which may be long."""

    def __init__(self, problem: str | Diagnostic = "") -> None:
        self.diagnostic = problem if isinstance(problem, Diagnostic) else None
        # Names of joints and figures come from files and may contain any character, as may file
        # names.
        super().__init__(printable(problem, _LONGEST) if self.is_shortened else str(problem))

    @classmethod
    def fault(
        cls, key: str, path: Path | None = None, line: int | None = None, **values: Any
    ) -> Self:
        """Return the error with a diagnostic, as ``Source.fault`` does for the file being read."""
        return cls(Diagnostic(key, path, line, values=values))

    @property
    def cause(self) -> str | Diagnostic:
        """The diagnostic if there is one, otherwise the message; a value for another diagnostic."""
        return self.diagnostic or str(self)


class FormatError(ViewerError):
    """A file is invalid; its diagnostic has the file, and the line if the format has lines."""

    diagnostic: Diagnostic

    def __init__(self, diagnostic: Diagnostic) -> None:
        super().__init__(replace(diagnostic, is_refusal=True))

    @property
    def path(self) -> Path:
        """The invalid file."""
        return self.diagnostic.path or Path()

    @property
    def line(self) -> int | None:
        """Line number of the problem, from 1, if the format has lines."""
        return self.diagnostic.line


class UnsupportedFormatError(ViewerError):
    """There is no reader or writer for this file format."""

    is_shortened = True


class RigError(ViewerError):
    """Parts of a figure are incompatible, or there is no part with a given name."""

    is_shortened = True


class PluginError(ViewerError):
    """A plug-in cannot be imported, or raised an exception; its package is named."""


class RenderError(ViewerError):
    """OpenGL is missing or too old, or reported an error."""

    exit_code = 4


class OutputError(ViewerError):
    """A result could not be written; existing files are unchanged."""

    exit_code = 5

    @classmethod
    def at(cls, path: str | Path, problem: Exception) -> Self:
        """Return the error for a file or folder that could not be written."""
        return cls(f"{printable(path, 300)}: {reason_of(problem)}")
