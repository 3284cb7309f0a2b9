"""Where ``viewer rig`` writes to: looked at before any work is done."""

from __future__ import annotations

from pathlib import Path

from viewer.commands._output import check_output
from viewer.export._rigged_files import files_of
from viewer.formats._save import require_folder
from viewer.streams import require_stdout

__all__ = ["check_files"]


def check_files(output: Path, inputs: list[Path], force: bool) -> None:
    """Refuse, before any work, to replace what nobody said may be replaced.

    Raises
    ------
    UnsupportedFormatError, OutputError
        As ``files_of`` and ``check_output``; also if the folder does not exist.
    """
    require_stdout(output)
    for file in files_of(output):
        check_output(file, inputs, force)
    require_folder(output)
