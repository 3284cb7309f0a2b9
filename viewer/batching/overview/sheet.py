"""Overview as contact sheets: the picture of each item with its name, and failed items marked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from viewer.batching.items import Result
from viewer.batching.tables import ordered, row_message
from viewer.errors import ViewerError
from viewer.media.captioned_sheet import CaptionedCell, captioned_sheet
from viewer.media.image import save_image
from viewer.media.thumbnails import thumbnail
from viewer.phrases import counted, printable

__all__ = ["MOST_SHEETS", "PER_SHEET", "save_sheets", "sheet_path"]

PER_SHEET = 120
"""Maximum number of cells on a sheet."""

MOST_SHEETS = 50
"""Maximum number of sheets; further items are not shown."""

_CELL = (240, 320)  # maximum size of a picture, pixels
_FINISHED = ("done", "unchanged")


def save_sheets(path: Path, results: Sequence[Result]) -> list[str]:
    """Write one sheet or several: ``sheet.png``, ``sheet-2.png``; see ``save_overview``."""
    rows = ordered(results)
    shown = rows[: PER_SHEET * MOST_SHEETS]
    if not any(result.outputs or result.status not in _FINISHED for result in shown):
        raise ViewerError(
            f"--overview: {printable(path, 300)}: no picture was written; name a page such as "
            f"{printable(path.stem, 100)}.html for a table of the items"
        )
    lines = []
    for first in range(0, len(shown), PER_SHEET):
        part = shown[first : first + PER_SHEET]
        number = first // PER_SHEET + 1
        target = sheet_path(path, number)
        save_image(target, captioned_sheet([_cell(result) for result in part]))
        failed = sum(result.status not in _FINISHED for result in part)
        marked = f", {failed} of them failed" if failed else ""
        lines.append(f"{printable(target, 300)}: {counted(len(part), 'item')}{marked}")
    if len(rows) > len(shown):
        lines.append(f"the sheets show the first {len(shown):,} of {len(rows):,} items")
    return lines


def sheet_path(path: Path, number: int) -> Path:
    """Return the file of a sheet; the first has number 1."""
    return path if number == 1 else path.with_stem(f"{path.stem}-{number}")


def _cell(result: Result) -> CaptionedCell:
    name = printable(result.item.name, 200)
    if result.status not in _FINISHED:
        return CaptionedCell(name, None, f"{result.status}\n{row_message(result)}", True)
    for output in result.outputs:
        pixels = thumbnail(output, _CELL)
        if pixels is not None:
            return CaptionedCell(name, pixels)
    return CaptionedCell(name, None, "no picture")
