"""Overviews of a batch: a contact sheet of its pictures, or a page of HTML."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from viewer.batching.items import Result
from viewer.errors import UnsupportedFormatError
from viewer.media.saving import all_or_none
from viewer.phrases import printable

__all__ = ["PAGES", "check_overview", "overview_files", "save_overview"]

PAGES = (".html", ".htm")
"""Suffixes of pages; all other suffixes are those of pictures."""

_PICTURES = (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tif", ".tiff")


def check_overview(path: str | Path) -> None:
    """Check, before the batch starts, that a file is a page or a picture.

    Raises
    ------
    UnsupportedFormatError
        If the suffix belongs to another kind of file.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in (*PAGES, *_PICTURES):
        known = ", ".join((*PAGES[:1], *_PICTURES))
        raise UnsupportedFormatError(
            f'--overview: {printable(path, 300)}: expected {known}, found "{suffix}"'
        )


def overview_files(path: str, count: int) -> list[str]:
    """Return the files of an overview: a page, or as many sheets as the items need.

    Parameters
    ----------
    path : str
        The first file.
    count : int
        Number of items.
    """
    if Path(path).suffix.lower() in PAGES:
        return [path]
    from viewer.batching.overview.sheet import MOST_SHEETS, PER_SHEET, sheet_path

    numbers = range(2, min(-(-count // PER_SHEET), MOST_SHEETS) + 1)
    return [path, *(str(sheet_path(Path(path), number)) for number in numbers)]


def save_overview(path: str | Path, job: str, results: Sequence[Result]) -> list[str]:
    """Write an overview of a batch; return a line about each written file.

    Parameters
    ----------
    path : str or Path
        A page (``PAGES``), or a picture; several pictures are written if one cannot hold all.
    job : str
        Name of the job, which determines the title and the data shown for each item.
    results : sequence of Result
        Results in any order.

    Raises
    ------
    ViewerError
        If a sheet is requested, but no item has written a picture.
    OutputError
        If a file cannot be written.
    """
    path = Path(path)
    check_overview(path)
    if path.suffix.lower() in PAGES:
        from viewer.batching.overview.page import save_page

        return save_page(path, job, results)
    from viewer.batching.overview.sheet import save_sheets

    with all_or_none(map(Path, overview_files(str(path), len(results)))):
        return save_sheets(path, results)
