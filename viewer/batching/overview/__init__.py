"""Overviews of a batch: a contact sheet of its pictures, or a page of HTML."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from viewer.batching.items import Result
from viewer.errors import UnsupportedFormatError
from viewer.phrases import printable

__all__ = ["PAGES", "check_overview", "save_overview"]

PAGES = (".html", ".htm")
"""Suffixes of pages; all others are those of pictures."""

_PICTURES = (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tif", ".tiff")


def check_overview(path: str | Path) -> None:
    """Refuse a file that is neither a page nor a picture, before the batch starts.

    Raises
    ------
    UnsupportedFormatError
        If the suffix is that of another kind of file.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in (*PAGES, *_PICTURES):
        known = ", ".join((*PAGES[:1], *_PICTURES))
        raise UnsupportedFormatError(
            f'--overview: {printable(path, 300)}: expected {known}, found "{suffix}"'
        )


def save_overview(path: str | Path, job: str, results: Sequence[Result]) -> list[str]:
    """Write an overview of a batch; return lines about the files written.

    Parameters
    ----------
    path : str or Path
        A page (``PAGES``), or a picture, of which there are several if one has no room for all.
    job : str
        Name of the job, for titles and for what is shown of each item.
    results : sequence of Result
        Results in any order.

    Raises
    ------
    ViewerError
        If a sheet is asked for, but no item has written a picture.
    OutputError
        If a file cannot be written.
    """
    path = Path(path)
    check_overview(path)
    if path.suffix.lower() in PAGES:
        from viewer.batching.overview.page import save_page

        return save_page(path, job, results)
    from viewer.batching.overview.sheet import save_sheets

    return save_sheets(path, results)
