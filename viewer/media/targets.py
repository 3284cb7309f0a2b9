"""Checks of all output files of a run before the first is written."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable, Sequence
from pathlib import Path

from viewer.errors import OutputError, printable
from viewer.streams import is_stdout, require_stdout

__all__ = ["check_folder_target", "check_targets"]

_FORCE = "--force replaces it"
_Identity = tuple[int, int] | Path  # device and inode of what exists, else where it would be


def check_targets(
    files: Sequence[Path], inputs: Iterable[Path], force: bool, hint: str = _FORCE
) -> None:
    """Refuse a run if one of its files may not be written; nothing has been written then.

    Parameters
    ----------
    files : sequence of Path
        All that the run writes under names that were asked for, companions too.
    inputs : iterable of Path
        All that the run reads; a folder stands for the files in it.
    force : bool
        Whether files that exist may be replaced; inputs never are.
    hint : str
        What to do about a file that exists.

    Raises
    ------
    OutputError
        With the first file that is a folder, an input, there already or written twice, whose
        folder is missing or locked, or that is a closed output stream. Links count as what they
        lead to.
    """
    opened = _Inputs(inputs)
    written: dict[_Identity, Path] = {}
    folders: set[Path] = set()
    for file in files:
        try:
            identity = _checked(file, opened, force, hint, folders)
        except (OSError, ValueError, RuntimeError) as problem:
            raise _refusal(file, getattr(problem, "strerror", None) or str(problem)) from None
        if identity is not None:
            other = written.setdefault(identity, file)
            if other is not file:
                raise _refusal(file, f"is the same file as {printable(other, 300)}")


def check_folder_target(folder: Path, inputs: Iterable[Path], force: bool) -> None:
    """Refuse to write a folder that is there already, or that something was read from.

    Parameters
    ----------
    folder : Path
        Replaced as a whole; folders above it that do not exist are made.
    inputs, force
        As for ``check_targets``.

    Raises
    ------
    OutputError
        With the folder, or what is in its way.
    """
    try:
        place = folder.resolve()
        for path in inputs:
            opened = path.resolve()
            if opened == place.parent and not os.path.lexists(folder):
                raise _refusal(folder.parent, "is an input folder: nothing is written into it")
            if opened in (place, place.parent) or place in opened.parents:
                raise _refusal(folder, "is an input folder, which is never replaced")
        if os.path.lexists(folder) and not force:
            raise _refusal(folder, f"exists already ({_FORCE})")
        there = next(parent for parent in place.parents if os.path.lexists(parent))
        if not there.is_dir():
            raise _refusal(there, "expected a folder, found a file")
        _check_folder(folder, there, set())
    except (OSError, ValueError, RuntimeError) as problem:
        raise _refusal(folder, getattr(problem, "strerror", None) or str(problem)) from None


def _checked(
    file: Path, inputs: _Inputs, force: bool, hint: str, folders: set[Path]
) -> _Identity | None:
    """Check one file; return what it is, None for a device or stream, which is never replaced."""
    if is_stdout(file):
        require_stdout(file)
        return None
    target = file.resolve()
    try:
        status = target.stat()
    except (FileNotFoundError, NotADirectoryError):
        _check_folder(file, target.parent, folders)
        return target
    if stat.S_ISDIR(status.st_mode):
        raise _refusal(file, "is a folder")
    if not stat.S_ISREG(status.st_mode):
        return None
    if inputs.hold(target, status):
        raise _refusal(file, "is an input file, which is never replaced")
    if not force:
        raise _refusal(file, f"exists already ({hint})")
    _check_folder(file, target.parent, folders)
    return status.st_dev, status.st_ino


def _check_folder(file: Path, folder: Path, known: set[Path]) -> None:
    if folder in known:
        return
    if not folder.is_dir():
        raise _refusal(file, f"the folder {printable(folder, 300)} does not exist")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise _refusal(file, f"the folder {printable(folder, 300)} cannot be written to")
    known.add(folder)


class _Inputs:
    """Files that were read, by what they are rather than by their names."""

    def __init__(self, paths: Iterable[Path]) -> None:
        self._files: set[tuple[int, int]] = set()
        self._folders: set[Path] = set()
        for path in paths:
            try:
                status = path.stat()
                if stat.S_ISDIR(status.st_mode):
                    self._folders.add(path.resolve())
                else:
                    self._files.add((status.st_dev, status.st_ino))
            except (OSError, ValueError, RuntimeError):
                continue  # what cannot be looked at has not been read

    def hold(self, target: Path, status: os.stat_result) -> bool:
        """Return whether a resolved file was read, or lies in a folder that was."""
        return (status.st_dev, status.st_ino) in self._files or target.parent in self._folders


def _refusal(path: Path, why: str) -> OutputError:
    return OutputError(f"{printable(path, 300)}: {printable(why, 400)}")
