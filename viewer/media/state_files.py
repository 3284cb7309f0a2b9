"""Files that the program keeps between runs: damaged ones are set aside, and the defaults used."""

from __future__ import annotations

import json
import sys
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from viewer.errors import OutputError, reason_of
from viewer.media.saving import save_bytes
from viewer.phrases import printable

Content = TypeVar("Content")
_LARGEST = 1 << 22  # bytes; all kept files are far smaller
_MARK = b"; viewer "


def config_file(name: str) -> Path:
    """Return the file of settings that has a name; neither it nor its folder need exist."""
    import platformdirs  # short commands need none

    return Path(platformdirs.user_config_dir("viewer", appauthor=False)) / name


def to_stderr(text: str) -> None:
    """Print a message to standard error, if there is one."""
    if sys.stderr is not None:
        sys.stderr.write(f"viewer: {text}\n")


def load_kept(
    path: Path,
    parse: Callable[[bytes], Content],
    usual: Content,
    say: Callable[[str], object] = to_stderr,
) -> Content:
    """Return the parsed content of a kept file; ``usual`` if it is missing or damaged."""
    # A damaged file, for which ``parse`` raises a ValueError, is renamed, so that it is neither
    # read again nor replaced.
    shown = printable(path, 300)
    try:
        if not path.exists():
            return usual
        if not path.is_file():  # reading a pipe would wait for ever
            raise OSError(None, "is not a regular file")
        with path.open("rb") as stream:
            data = stream.read(_LARGEST + 1)
    except (OSError, ValueError) as problem:
        say(f"{shown}: {reason_of(problem)}; the defaults are used")
        return usual
    try:
        if len(data) > _LARGEST:
            raise ValueError("too large")
        return parse(data)
    except (ValueError, RecursionError):
        aside = path.with_name(f"{path.name}.bad")
    try:
        path.replace(aside)
    except OSError as problem:
        why = reason_of(problem)
        say(f"{shown} is damaged and cannot be renamed ({why}); the defaults are used")
    else:
        say(f"{shown} was damaged: it is now called {aside.name}, and the defaults are used")
    return usual


def save_kept(path: Path, data: bytes) -> str:
    """Replace a kept file; return the reason why it could not be written, empty if it was."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        save_bytes(path, data)
    except OSError as problem:
        return str(OutputError.at(path, problem))
    except OutputError as problem:
        return str(problem)
    return ""


def as_json(data: bytes) -> Any:
    """Return the content of a JSON file; raises ValueError."""
    return json.loads(data.decode("utf-8"))


def with_checksum(text: str) -> bytes:
    """Return the bytes of a text after a comment (``;``) that contains its checksum."""
    data = text.encode("utf-8", "surrogateescape")
    return b"%s%08x\n%s" % (_MARK, zlib.crc32(data), data)


def has_checksum(data: bytes) -> bool:
    """Return whether a file begins as ``with_checksum`` writes it; earlier versions wrote none."""
    return data.startswith(_MARK[:1])


def checked(data: bytes) -> str:
    """Return the text written by ``with_checksum``; raises ValueError if any byte differs."""
    first, end, rest = data.partition(b"\n")
    if not end or first != b"%s%08x" % (_MARK, zlib.crc32(rest)):
        raise ValueError("not written completely")
    return rest.decode("utf-8")
