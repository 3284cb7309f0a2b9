"""Selection of the files of a submission to compare, based on their paths alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath

from viewer.diagnostics import Diagnostic
from viewer.errors import FormatError
from viewer.formats import SUFFIXES

__all__ = ["Chosen", "choose", "is_junk", "patterns_of", "suffix_of"]

_JUNK_FOLDERS = {"__macosx", "__pycache__"}
_JUNK_FILES = {"thumbs.db", "desktop.ini"}

Chosen = tuple[str, ...]
"""Paths of the files to open together, or of one folder."""


def is_junk(name: str) -> bool:
    """Return whether a file was added by an operating system or is hidden.

    >>> is_junk("__MACOSX/._arm.skel"), is_junk("a/.DS_Store"), is_junk("a/arm.skel")
    (True, True, False)
    """
    *folders, last = name.lower().split("/")
    return (
        any(part.startswith(".") for part in (*folders, last))
        or any(part in _JUNK_FOLDERS for part in folders)
        or last in _JUNK_FILES
    )


def suffix_of(name: str) -> str:
    """Return the last suffix of a path, in lower case."""
    return PurePosixPath(name).suffix.lower()


def patterns_of(reference: Iterable[str | Path]) -> list[str]:
    """Return the patterns that find the same kinds of files as those of the reference.

    >>> patterns_of(["solution/Arm.SKEL", "solution/arm.skin"])
    ['*.skel', '*.skin']
    """
    return [f"*{suffix_of(Path(file).name)}" for file in reference if suffix_of(Path(file).name)]


def choose(
    names: Sequence[str], expected: Sequence[str], alike: Sequence[str], path: Path
) -> Chosen:
    """Return the files of a submission to compare.

    The files nearest to the top of the folder are preferred, since submissions often contain
    build folders, backups and the course's own data.

    Parameters
    ----------
    names : sequence of str
        Paths of all files, relative to the submission, with slashes; without junk.
    expected : sequence of str
        Patterns of the required files: each matches one file. A pattern with a slash is compared
        with the whole path, otherwise with the name of the file.
    alike : sequence of str
        Patterns from the reference (``patterns_of``), used without ``expected`` unless none
        matches: then the folder nearest to the top that has readable files is compared.
    path : Path
        The submission, for messages.

    Raises
    ------
    FormatError
        If a file is missing, or there are several to choose from.
    """
    if not expected and not any(_matches(name, one) for one in alike for name in names):
        return (_readable_folder(names, path),)
    found = []
    for pattern, count in Counter(expected or alike).items():
        matching = _nearest([name for name in names if _matches(name, pattern)])
        if len(matching) != count:
            key = "several" if len(matching) > count else "missing"
            listed = matching or _offered(names)
            values = {"expected": count, "pattern": pattern, "names": listed}
            raise FormatError(Diagnostic(f"F002.submission-{key}", path, values=values))
        found += matching
    return tuple(dict.fromkeys(found))


def _matches(name: str, pattern: str) -> bool:
    compared = name if "/" in pattern else name.rpartition("/")[2]
    return fnmatchcase(compared.lower(), pattern.lower())


def _nearest(names: Sequence[str]) -> list[str]:
    depth = min((name.count("/") for name in names), default=0)
    return sorted(name for name in names if name.count("/") == depth)


def _offered(names: Iterable[str]) -> list[str]:
    """Return the files to list in the message about a missing one: readable files, or else all."""
    names = sorted(names)
    return [name for name in names if _is_rig_file(name)] or names


def _is_rig_file(name: str) -> bool:
    suffix = suffix_of(name)
    return suffix in SUFFIXES and suffix != ".txt"


def _is_table(name: str) -> bool:
    """Return whether a file may belong to a folder in a known format, such as PIG."""
    return suffix_of(name) == ".txt"


def _readable_folder(names: Sequence[str], path: Path) -> str:
    for is_wanted in (_is_rig_file, _is_table):
        folders = _folders(names, is_wanted)
        if len(folders) == 1:
            return folders[0]
        if folders:
            raise FormatError(
                Diagnostic("F002.submission-folders", path, values={"names": folders})
            )
    raise FormatError(Diagnostic("F002.submission-empty", path, values={"names": sorted(names)}))


def _folders(names: Sequence[str], is_wanted: Callable[[str], bool]) -> list[str]:
    """Return the folders nearest to the top that directly contain wanted files."""
    nearest = _nearest([name for name in names if is_wanted(name)])
    return sorted({name.rpartition("/")[0] or "." for name in nearest})
