"""Where results go: checked before any work is done."""

from __future__ import annotations

from pathlib import Path

from viewer.errors import OutputError, printable
from viewer.formats._save import refuse_inputs
from viewer.streams import is_stdout, require_stdout

__all__ = ["PICTURES", "check_output"]

PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".gif", ".ppm", ".tga", ".tif", ".tiff", ".webp")
"""Suffixes of pictures that can be written."""


def check_output(output: Path, inputs: list[Path], force: bool) -> None:
    """Refuse, before anything is done, to replace a file nobody said may be replaced.

    Raises
    ------
    OutputError
        If the output is one of the inputs, a folder, or exists without ``--force``.
    """
    shown = printable(output, 300)
    require_stdout(output)
    try:
        if output.is_dir():
            raise OutputError(f"{shown}: is a folder")
        refuse_inputs([output], inputs)
        if output.is_file() and not force and not is_stdout(output):
            raise OutputError(f"{shown}: exists already (--force replaces it)")
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or problem
        raise OutputError(f"{shown}: {reason}") from None
