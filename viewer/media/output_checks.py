"""Checks of all output files of a run before the first is written."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from viewer.errors import OutputError, reason_of
from viewer.phrases import printable
from viewer.streams import is_stdout, require_stdout

_FORCE = "--force replaces it"
_CLOCKS = 1.0  # seconds by which the clocks of machines and file servers may differ
_Identity = tuple[int, int] | Path  # device and inode of an existing file, otherwise its path
_since: ContextVar[float] = ContextVar("since", default=float("inf"))


@contextmanager
def replacing_since(start: float) -> Iterator[None]:
    """Let the block replace files written after a start, in seconds since 1970."""
    # A run that is repeated, because its process died before it reported success, replaces its own
    # outputs, but nothing that is more than a second older.
    token = _since.set(start - _CLOCKS)
    try:
        yield
    finally:
        _since.reset(token)


def check_targets(
    files: Sequence[Path], inputs: Iterable[Path], force: bool, hint: str = _FORCE
) -> None:
    """Refuse a run if one of its output files may not be written, before anything is written."""
    # It refuses the first file that is a folder or an input, exists, is written twice, is in a
    # missing or read-only folder, or is a closed standard output. Links are resolved.
    opened = _Inputs(inputs)
    written: dict[_Identity, Path] = {}
    folders: set[Path] = set()
    for file in files:
        try:
            identity = _checked(file, opened, force, hint, folders)
        except (OSError, ValueError, RuntimeError) as problem:
            raise _refusal(file, reason_of(problem)) from None
        if identity is not None:
            other = written.setdefault(identity, file)
            if other is not file:
                raise _refusal(file, f"is the same file as {printable(other, 300)}")


def check_folder_target(folder: Path, inputs: Iterable[Path], force: bool) -> None:
    """Refuse to write a folder that exists or is above an input; see ``check_targets``."""
    try:
        place = folder.resolve()
        for path in inputs:
            opened = path.resolve()
            if opened == place.parent and not os.path.lexists(folder):
                raise _refusal(folder.parent, "nothing is written into input folders")
            if opened in (place, place.parent) or place in opened.parents:
                raise _refusal(folder, "input folders are never overwritten")
        if os.path.lexists(folder) and not (force or _is_new_folder(folder)):
            raise _refusal(folder, f"already exists ({_FORCE})")
        there = next(parent for parent in place.parents if os.path.lexists(parent))
        if not there.is_dir():
            raise _refusal(there, "expected a folder, found a file")
        _check_folder(folder, there, set())
    except (OSError, ValueError, RuntimeError) as problem:
        raise _refusal(folder, reason_of(problem)) from None


def _checked(
    file: Path, inputs: _Inputs, force: bool, hint: str, folders: set[Path]
) -> _Identity | None:
    """Check one file and return its identity; None for devices and streams, never replaced."""
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
        raise _refusal(file, "input files are never overwritten")
    if not (force or status.st_mtime >= _since.get()):
        raise _refusal(file, f"already exists ({hint})")
    _check_folder(file, target.parent, folders)
    return status.st_dev, status.st_ino


def _is_new_folder(folder: Path) -> bool:
    """Return whether a folder and everything in it are newer than the time of the block."""
    start = _since.get()
    return all(path.lstat().st_mtime >= start for path in (folder, *folder.rglob("*")))


def _check_folder(file: Path, folder: Path, known: set[Path]) -> None:
    if folder in known:
        return
    if not folder.is_dir():
        raise _refusal(file, f"the folder {printable(folder, 300)} does not exist")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise _refusal(file, f"the folder {printable(folder, 300)} is not writable")
    known.add(folder)


class _Inputs:
    """Input files by device and inode instead of by name."""

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
                continue  # a file without a status cannot have been read

    def hold(self, target: Path, status: os.stat_result) -> bool:
        """Return whether a resolved file is an input, or is in an input folder."""
        return (status.st_dev, status.st_ino) in self._files or target.parent in self._folders


def _refusal(path: Path, why: str) -> OutputError:
    return OutputError(f"{printable(path, 300)}: {printable(why, 400)}")
