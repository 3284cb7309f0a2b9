"""What can go wrong, as one tree that callers catch at the height they need.

::

    ViewerError                 exit 2   anything a person can act on; one line, no traceback
    ├── FormatError             exit 2   a file is not what it says: path:line: expected, found
    ├── UnsupportedFormatError  exit 2   no reader or writer knows this kind of file
    ├── RigError                exit 2   parts that do not fit each other
    ├── RenderError             exit 4   no usable OpenGL, or the driver refused
    └── OutputError             exit 5   a result could not be written
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

__all__ = [
    "FormatError",
    "OutputError",
    "RenderError",
    "RigError",
    "UnsupportedFormatError",
    "ViewerError",
    "counted",
    "one_of",
    "printable",
]


_LONGEST = 1000  # characters of a message with names in it


def printable(text: object, limit: int = 200) -> str:
    r"""Return ``text`` on one line: control characters escaped, cut after ``limit`` characters.

    >>> printable("two\nlines")
    'two\\nlines'
    """
    shown = "".join(
        letter
        if letter.isprintable()
        else letter.encode("unicode_escape", "surrogatepass").decode()
        for letter in str(text)
    )
    return shown if len(shown) <= limit else shown[: limit - 1] + "…"


_PLURALS = {"vertex": "vertices", "matrix": "matrices"}


def counted(count: int, noun: str, one: str = "", many: str = "", of: int | None = None) -> str:
    """Return how many there are of something, and what they do, as messages begin.

    Parameters
    ----------
    count : int
        How many.
    noun : str
        Of one, its last word the one that changes: ``"negative weight"``.
    one, many : str
        What one does, and what others do: ``"is"``, ``"are"``; nothing if left out.
    of : int, optional
        How many there are in all.

    >>> counted(1, "vertex", "has", "have"), counted(3, "vertex", "has", "have")
    ('1 vertex has', '3 vertices have')
    >>> counted(1, "frame", "is", "are", of=20)
    '1 of 20 frames is'
    """
    head, space, last = noun.rpartition(" ")
    plural = f"{head}{space}{_PLURALS.get(last, f'{last}s')}"
    share = "" if of is None else f"of {of} "
    text = f"{count} {share}{noun if (count if of is None else of) == 1 else plural}"
    return f"{text} {one if count == 1 else many}" if one else text


def one_of(values: Sequence[object]) -> str:
    """Return what is possible, as messages list it.

    >>> one_of([9, 48, 63]), one_of([3])
    ('9, 48 or 63', '3')
    """
    *others, last = map(str, values)
    return f"{', '.join(others)} or {last}" if others else last


class ViewerError(Exception):
    """Something a person can act on; ``str()`` is the one line to show."""

    exit_code = 2


class FormatError(ViewerError):
    """A file breaks its own format.

    Parameters
    ----------
    path : str or Path
        The file at fault.
    message : str
        What was expected and what was found.
    line : int, optional
        Line of the fault, counted from 1, if the format has lines.

    Attributes
    ----------
    code : str
        Which fault of ``viewer lint`` it is, where the words alone do not tell.
    """

    code = ""

    def __init__(self, path: str | Path, message: str, line: int | None = None) -> None:
        self.path = Path(path)
        self.line = line
        where = printable(path, 300) if line is None else f"{printable(path, 300)}:{line}"
        super().__init__(f"{where}: {message}")


class UnsupportedFormatError(ViewerError):
    """No reader or writer knows this kind of file."""

    def __init__(self, message: str) -> None:
        super().__init__(printable(message, _LONGEST))


class RigError(ViewerError):
    """Parts of a figure that do not fit each other, or a name that it does not have."""

    def __init__(self, message: str) -> None:
        # Names of joints and figures come from files, and may hold anything.
        super().__init__(printable(message, _LONGEST))


class RenderError(ViewerError):
    """OpenGL is missing, too old, or refused what was asked."""

    exit_code = 4


class OutputError(ViewerError):
    """A result could not be written; what was there before is untouched."""

    exit_code = 5
