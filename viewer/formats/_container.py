"""A source's archive, opened once."""

from __future__ import annotations

from viewer.formats._archive import Archive, open_archive
from viewer.formats._source import Source

__all__ = ["archive_of"]


def archive_of(source: Source) -> Archive:
    """Return the archive that a source is; see ``open_archive`` for what it raises."""
    if source.archive is None:
        source.archive = open_archive(source, source.max_size)
    return source.archive
