"""Where results go: checked before any work is done."""

from __future__ import annotations

from pathlib import Path

from viewer.errors import OutputError, printable
from viewer.formats._save import refuse_inputs

__all__ = ["PICTURES", "STDOUT", "check_output"]

PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".gif", ".ppm", ".tga", ".tif", ".tiff", ".webp")
"""Suffixes of pictures that can be written."""

STDOUT = ("/dev/stdout", "/dev/fd/1", "/proc/self/fd/1")
"""Names of the output stream."""


def check_output(output: Path, inputs: list[Path], force: bool) -> None:
    """Refuse, before anything is done, to replace a file nobody said may be replaced.

    Raises
    ------
    OutputError
        If the output is one of the inputs, a folder, or exists without ``--force``.
    """
    shown = printable(output, 300)
    try:
        if output.is_dir():
            raise OutputError(f"{shown}: is a folder")
        refuse_inputs([output], inputs)
        if output.is_file() and not force and str(output) not in STDOUT:
            raise OutputError(f"{shown}: exists already (--force replaces it)")
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or problem
        raise OutputError(f"{shown}: {reason}") from None
