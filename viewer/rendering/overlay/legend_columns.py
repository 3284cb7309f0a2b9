"""Split of a legend's items into columns, for images and the window."""

from __future__ import annotations

from collections.abc import Sequence

from viewer.data_classes import dataclass

__all__ = ["LegendColumns", "legend_columns"]


@dataclass(frozen=True, slots=True)
class LegendColumns:
    """The items of each column.

    Attributes
    ----------
    counts : tuple of int
        Number of items per column, from left to right; the items fill the columns in order.
    widths : tuple of float
        Width of each column.
    left_out : int
        Number of omitted items, which a line "and N more" below the last column mentions.
    """

    counts: tuple[int, ...]
    widths: tuple[float, ...]
    left_out: int = 0

    @property
    def rows(self) -> int:
        """Number of lines of the longest column, including the line about omitted items."""
        last = self.counts[-1] + (self.left_out > 0) if self.counts else 0
        return max((*self.counts, last), default=0)


def legend_columns(widths: Sequence[float], rows: int, width: float) -> LegendColumns:
    """Split items into as few columns as possible; omitted items are counted.

    Parameters
    ----------
    widths : sequence of float
        Width of each item's swatch and name, with the gap to the next column, in any unit.
    rows : int
        Maximum number of lines per column, 1 or more.
    width : float
        Maximum total width of all columns, in the same unit. The first column is used even if it is
        wider.

    Returns
    -------
    LegendColumns
        Columns of about equal length if all items fit, otherwise full columns.

    >>> legend_columns([10.0] * 5, 4, 30.0).counts
    (3, 2)
    >>> legend_columns([10.0] * 5, 2, 20.0)
    LegendColumns(counts=(2, 1), widths=(10.0, 10.0), left_out=2)
    """
    if not widths:
        return LegendColumns((), ())
    n_columns = -(-len(widths) // rows)
    evenly = _split(widths, -(-len(widths) // n_columns))
    if n_columns == 1 or sum(evenly.widths) <= width:
        return evenly
    full = _split(widths, rows)
    if sum(full.widths) <= width:
        return full
    kept = 1
    while sum(full.widths[: kept + 1]) <= width:
        kept += 1
    counts = (*full.counts[: kept - 1], full.counts[kept - 1] - 1)
    return LegendColumns(counts, full.widths[:kept], len(widths) - sum(counts))


def _split(widths: Sequence[float], rows: int) -> LegendColumns:
    parts = [widths[first : first + rows] for first in range(0, len(widths), rows)]
    return LegendColumns(tuple(map(len, parts)), tuple(max(part) for part in parts))
