"""The file by which programs find a window: its port and token, readable by the user alone."""

from __future__ import annotations

import json
import os
import stat
import warnings
from pathlib import Path

import platformdirs

from viewer.data_classes import dataclass
from viewer.errors import OutputError, ViewerError, reason_of
from viewer.phrases import printable

VARIABLE = "VIEWER_CONNECTION_FILE"
"""Environment variable that names another file."""
_LARGEST = 4096  # bytes


@dataclass(frozen=True, slots=True)
class Connection:
    """Where a window listens."""

    port: int
    token: str
    pid: int
    """Process of the window."""


def file_path(path: str | Path | None = None) -> Path:
    """Return a given file, or that of the environment, or the usual one."""
    given = path or os.environ.get(VARIABLE)
    return Path(given) if given else _folder() / "window.json"


def _folder() -> Path:
    """Return the user's runtime folder, created for the user alone."""
    with warnings.catch_warnings():
        # Newer versions warn where the system names no runtime folder; that in /tmp is checked.
        warnings.simplefilter("ignore")
        folder = Path(platformdirs.user_runtime_dir("viewer", appauthor=False))
    try:
        folder.mkdir(parents=True, mode=0o700, exist_ok=True)
        status = folder.stat()
    except OSError as problem:
        raise OutputError.at(folder, problem) from None
    # Another user may have created it first, where the system has no runtime folders.
    if hasattr(os, "getuid") and (status.st_uid != os.getuid() or status.st_mode & 0o022):
        raise OutputError(
            f"{printable(folder, 300)}: expected a folder of your own that nobody else can write; "
            "name another file with --connection-file"
        )
    return folder


def write_file(path: Path, port: int, token: str) -> None:
    """Write the file, which only its owner can read from its creation on."""
    text = json.dumps({"port": port, "token": token, "pid": os.getpid()})
    aside = path.with_name(f"{path.name}.{os.getpid()}")
    try:
        aside.unlink(missing_ok=True)
        handle = os.open(aside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "w") as stream:
            stream.write(text)
        aside.replace(path)
    except OSError as problem:
        raise OutputError.at(path, problem) from None


def read_file(path: Path) -> Connection | None:
    """Return the content of the file; None if there is none."""
    try:
        with path.open("rb") as stream:
            status = os.fstat(stream.fileno())
            data = stream.read(_LARGEST + 1)
    except FileNotFoundError:
        return None
    except OSError as problem:
        raise ViewerError(f"{printable(path, 300)}: {reason_of(problem)}") from None
    is_own = not hasattr(os, "getuid") or status.st_uid == os.getuid()
    if not is_own or (os.name == "posix" and stat.S_IMODE(status.st_mode) & 0o077):
        raise ViewerError(f"{printable(path, 300)}: expected a file that only you can read")
    try:
        told = json.loads(data)
        return Connection(int(told["port"]), str(told["token"]), int(told["pid"]))
    except (ValueError, KeyError, TypeError):
        raise ViewerError(
            f"{printable(path, 300)}: expected the port and token of a window, found other data"
        ) from None
