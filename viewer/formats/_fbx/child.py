"""Child process that reads an ``.fbx``: its limits, and the errors with which it can end."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import viewer
from viewer.diagnostics import Phrase
from viewer.formats._fbx.message import Arrays, unpacked
from viewer.formats._source import Source
from viewer.media.unfinished import new_prefix

__all__ = ["run_worker"]

_SECONDS = 60.0  # time limit for the smallest files, seconds
_STEP = 1 << 20  # bytes per step, which take about 0.1 s to read
_SECONDS_PER_STEP = 2.0  # seconds added to the time limit for each step
_MEMORY = 4 << 30  # bytes that the child may use for the smallest files
_MEMORY_PER_BYTE = 64  # bytes added for each byte of the file
_WORKER = "viewer.formats._fbx.worker"


def run_worker(source: Source, *arguments: str) -> tuple[Arrays, dict[str, Any]]:
    """Run the worker on a file, and return its message.

    Raises
    ------
    FormatError
        If the library is missing, refuses the file, crashes, or takes too long.
    """
    if find_spec("ufbx") is None:
        raise source.fault("F001.fbx-extra")
    if source.is_piped:
        # The library reads files, in any order.
        prefix = new_prefix(tempfile.gettempdir(), "viewer-fbx")
        with tempfile.TemporaryDirectory(prefix=prefix) as folder:
            path = Path(folder, "piped.fbx")
            path.write_bytes(source.data)
            return _run(source, path, arguments)
    return _run(source, source.path.resolve(), arguments)


def _run(source: Source, path: Path, arguments: Sequence[str]) -> tuple[Arrays, dict[str, Any]]:
    size = path.stat().st_size
    seconds = _SECONDS + _SECONDS_PER_STEP * (size / _STEP)
    command = [sys.executable, "-m", _WORKER, str(path), *arguments]
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=seconds,
            env=_environment(_MEMORY + _MEMORY_PER_BYTE * size),
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise source.fault("F001.fbx-slow", seconds=seconds) from None
    message = unpacked(done.stdout) if done.returncode == 0 else None
    if message is None:
        raise source.fault("F001.fbx-crash", how=_ending(done.returncode, done.stderr))
    if "error" in message[1]:
        raise source.fault("F002.fbx", reason=message[1]["error"])
    return message


def _environment(memory: int) -> dict[str, str]:
    """Return the child's environment, in which it finds this package and uses one thread."""
    package = str(Path(viewer.__file__).resolve().parents[1])
    paths = filter(None, (package, os.environ.get("PYTHONPATH", "")))
    limits = {"VIEWER_FBX_MEMORY": str(memory), "OPENBLAS_NUM_THREADS": "1"}
    return {**os.environ, **limits, "PYTHONPATH": os.pathsep.join(paths)}


def _ending(code: int, errors: bytes) -> Phrase:
    """Return a phrase that describes how a process ended."""
    if code < 0:
        return Phrase("ended-by-signal", number=-code)
    lines = errors.decode(errors="replace").strip().splitlines()
    return Phrase("ended-with-error", code=code, error=lines[-1] if lines else "")
