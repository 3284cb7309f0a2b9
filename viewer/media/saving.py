"""Atomic file writing: a temporary file first, then a rename."""

from __future__ import annotations

import contextlib
import os
import stat
from collections.abc import Iterable, Iterator
from contextvars import ContextVar
from pathlib import Path
from typing import IO

from viewer.diagnostics.record import note_output
from viewer.errors import OutputError
from viewer.interrupts import hold, poll, raising
from viewer.media.file_names import file_stem
from viewer.media.unfinished import new_prefix, note_unfinished
from viewer.phrases import printable
from viewer.progress import report, report_bytes
from viewer.streams import is_stdout, write_stdout


def as_words(name: str) -> list[bytes] | None:
    """Return the words of a name as bytes, or None if joining them would not give the same name.

    >>> as_words("left leg"), as_words(" leg")
    ([b'left', b'leg'], None)
    """
    try:
        text = name.encode("utf-8", "surrogateescape")
    except UnicodeEncodeError:  # a lone surrogate, which decoding never yields
        return None
    words = text.split()
    comes_back = b" ".join(words).decode("utf-8", "surrogateescape") == name
    return words if comes_back and not set(text) & set(b"{}") else None


def free_path(folder: Path, stem: str, suffix: str, data: bytes | None = None) -> Path:
    """Return an unused path: ``fox.png``, then ``fox-2.png``, and so on."""
    safe = file_stem(stem)
    path, number = folder / f"{safe}{suffix}", 1
    # A dangling link counts as used: writing to it would create a file elsewhere.
    while os.path.lexists(path) and not _holds(path, data):
        number += 1
        path = folder / f"{safe}-{number}{suffix}"
    return path


def _holds(path: Path, data: bytes | None) -> bool:
    with contextlib.suppress(OSError):
        is_as_long = data is not None and path.is_file() and path.stat().st_size == len(data)
        return is_as_long and path.read_bytes() == data
    return False


_written: ContextVar[dict[Path, bytes] | None] = ContextVar("written files", default=None)


@contextlib.contextmanager
def keeping_written() -> Iterator[dict[Path, bytes]]:
    """Keep the bytes of each file written in the block, since a pipe cannot be read back."""
    written: dict[Path, bytes] = {}
    token = _written.set(written)
    try:
        yield written
    finally:
        _written.reset(token)


def save_text(path: str | Path, text: str) -> None:
    """Write text as UTF-8 with LF line endings; see ``save_bytes``."""
    save_bytes(path, text.encode("utf-8", "surrogateescape"))


def save_bytes(path: str | Path, data: bytes) -> None:
    """Replace a file's content atomically, or leave it unchanged."""
    # A link is followed. A device or pipe is written to directly and never replaced, as is standard
    # output, even if redirected to a file. The new file keeps the old permissions.
    save_parts(path, [data])


def save_parts(
    path: str | Path, parts: Iterable[bytes], n_lines: int = 0, reports: bool = True
) -> None:
    """Write a file in parts, so that its content need not fit into memory; see ``save_bytes``.

    ``parts``: its content; errors of the iterable leave the file unchanged. ``n_lines``: expected
    number of lines, to which reported progress refers; 0 if unknown. ``reports``: whether to report
    progress; False if the iterable does.
    """
    hold()  # a signal that arrives after the rename must not turn success into failure
    poll()
    path = Path(path)
    if reports:
        parts = _reported(parts, path.name, n_lines)
    kept = _written.get()
    if kept is not None or is_stdout(path):
        parts = [b"".join(parts)]
    if kept is not None:
        (kept[path],) = parts
    if is_stdout(path):
        write_stdout(path, *parts)
        return
    try:
        mode = _mode(path)
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(None, "is a folder")
        if not stat.S_ISREG(mode):
            # Closing may fail too: /dev/full reports its error only then. A pipe without a reader
            # blocks forever, so signals must be able to interrupt it. The path is not resolved:
            # /dev/stdout may lead to a nameless pipe.
            with raising(), path.open("wb") as stream:
                for part in parts:
                    stream.write(part)
        else:
            file = Replacement(path)
            try:
                with file.open() as stream:
                    for part in parts:
                        stream.write(part)
                file.commit()
            except BaseException:  # including Ctrl-C: the temporary file must not be left behind
                file.discard()
                raise
    except (OSError, ValueError, RuntimeError) as problem:
        raise OutputError.at(path, problem) from None


class Replacement:
    """A temporary file next to its target, which it then replaces."""

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.temporary: Path | None = None
        try:
            mode = _mode(self.path)
            if stat.S_ISDIR(mode):
                raise IsADirectoryError(None, "is a folder")
            if not stat.S_ISREG(mode) or is_stdout(self.path):
                raise ValueError("is not a regular file, and a video must be written to one")
            self._target, self._permissions = self.path.resolve(), stat.S_IMODE(mode)
            _require_folder(self._target)
        except (OSError, ValueError, RuntimeError) as problem:
            raise self.error(problem) from None

    def error(self, problem: Exception) -> OutputError:
        """Return a one-line error with the path."""
        return OutputError.at(self.path, problem)

    def open(self, ends_like_target: bool = False) -> IO[bytes]:
        """Create the temporary file and open it."""
        import tempfile

        folder, name = self._target.parent, self._target.name
        suffix = self._target.suffix if ends_like_target else ""
        try:
            prefix = new_prefix(folder, name.removesuffix(suffix))
            handle, name = tempfile.mkstemp(dir=folder, prefix=prefix, suffix=suffix)
            self.temporary = Path(name)
            note_unfinished(self.temporary)
            return os.fdopen(handle, "wb")
        except OSError as problem:
            self.discard()
            raise self.error(problem) from None

    def begin(self) -> Path:
        """Create the temporary file for a library that opens it by its name, and return that."""
        with self.open(ends_like_target=True):
            assert self.temporary is not None
            return self.temporary

    def commit(self, in_any_thread: bool = False) -> int:
        """Replace the target with the temporary file; return its size in bytes."""
        assert self.temporary is not None  # created by begin()
        try:
            with self.temporary.open("rb+") as stream:
                os.fsync(stream.fileno())
            size = self.temporary.stat().st_size
            self.temporary.chmod(self._permissions)
            poll(in_any_thread)  # the last point at which a signal can stop the write
            self.temporary.replace(self._target)
        except OSError as problem:
            self.discard()
            raise self.error(problem) from None
        self.temporary = None
        note_output(self.path)
        return size

    def discard(self) -> None:
        """Remove the temporary file, if there is one."""
        if self.temporary is not None:
            with contextlib.suppress(OSError):
                self.temporary.unlink(missing_ok=True)
            self.temporary = None


_Copies = dict[Path, Path | None]  # copies by resolved path; None if no file existed
_outer: ContextVar[_Copies | None] = ContextVar("copies of the innermost all_or_none", default=None)


@contextlib.contextmanager
def all_or_none(paths: Iterable[Path]) -> Iterator[None]:
    """Restore all of several files that belong together if writing one of them fails."""
    # An inner block that succeeds passes its copies to the outer one, which may still fail.
    hold()  # signals must not leave copies behind
    poll()
    copies: _Copies = {}
    outer = _outer.get()
    token = _outer.set(copies)
    try:
        for path in paths:
            _keep_copy(path, copies)
        yield
        if outer is not None:
            for target in copies.keys() - outer.keys():
                outer[target] = copies.pop(target)
    except BaseException:
        for target, copy in copies.items():
            with contextlib.suppress(OSError):
                if copy is None:
                    target.unlink(missing_ok=True)
                else:
                    copy.replace(target)
        raise
    finally:
        _outer.reset(token)
        for copy in filter(None, copies.values()):
            with contextlib.suppress(OSError):
                copy.unlink(missing_ok=True)


def _keep_copy(path: Path, copies: _Copies) -> None:
    """Copy the file at a path; None stands for a missing file. Devices are left alone."""
    if is_stdout(path):
        return
    try:
        target = path.resolve()
        if not target.exists():
            copies[target] = None
        elif target.is_file():
            import shutil
            import tempfile

            handle, name = tempfile.mkstemp(
                dir=target.parent, prefix=new_prefix(target.parent, target.name)
            )
            os.close(handle)
            try:
                shutil.copy2(target, name)
            except BaseException:
                with contextlib.suppress(OSError):
                    Path(name).unlink()
                raise
            copies[target] = Path(name)
    except (OSError, ValueError, RuntimeError) as problem:
        raise OutputError.at(path, problem) from None


def _mode(target: Path) -> int:
    """Return the target's type and permissions, or those that a new file would get."""
    try:
        return target.stat().st_mode
    except FileNotFoundError:
        mask = os.umask(0)
        os.umask(mask)
        return stat.S_IFREG | (0o666 & ~mask)


def _reported(parts: Iterable[bytes], name: str, n_lines: int) -> Iterator[bytes]:
    """Yield parts, and report each when it has been written."""
    n_bytes, done, what = 0, 0, f"writing {name}"
    for part in parts:
        yield part
        n_bytes += len(part)
        if n_lines:
            done += part.count(b"\n")
            report(min(done, n_lines), n_lines, "lines", what)
        else:
            report_bytes(n_bytes, 0, what)


def _require_folder(target: Path) -> None:
    if not target.parent.is_dir():
        raise FileNotFoundError(None, f"the folder {printable(target.parent, 300)} does not exist")
