"""Rows of one element of a ``.ply``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.formats._ply.header import Element

__all__ = ["Numbers", "Places", "Table", "list_places"]

Places = NDArray[np.int64]
Numbers = NDArray[Any]


@dataclass(slots=True)
class Table:
    """One element's rows.

    Attributes
    ----------
    element : Element
        Declaration of the element in the header.
    columns : dict of str to (N,)
        Properties of the element that are not lists.
    lists : dict of str to ((N,), (M,))
        List properties: the number of values of each row, and the values of all rows.
    offset_of : callable or None
        Returns the offset of a row; slow, for errors only. None in a binary file.
    is_first : bool
        Whether it is the first element with its name; later ones are read and discarded.
    """

    element: Element
    columns: dict[str, Numbers] = field(default_factory=dict)
    lists: dict[str, tuple[Places, Numbers]] = field(default_factory=dict)
    offset_of: Callable[[int], int] | None = None
    is_first: bool = True

    def offset(self, row: int) -> int | None:
        """Return the offset of a row in the file; None in a binary file, which has no lines."""
        return None if self.offset_of is None else self.offset_of(row)


def list_places(starts: Places, counts: Places, step: int) -> Places:
    """Return the positions of all values of lists that begin at ``starts``."""
    total = np.cumsum(counts) - counts
    return np.repeat(starts - total * step, counts) + np.arange(counts.sum()) * step
