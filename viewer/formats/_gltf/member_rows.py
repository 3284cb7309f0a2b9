"""Members of all objects in a table, read together as arrays."""

from __future__ import annotations

from itertools import chain
from typing import Any

import numpy as np

from viewer.formats._gltf.elements import Table
from viewer.formats._text.numbers import LARGEST
from viewer.rig.arrays import Floats, Ints

__all__ = ["member_indices", "member_rows"]

_NUMBERS = ({int}, {float}, {int, float})


def member_rows(table: Table, name: str, width: int) -> tuple[Ints, Floats]:
    """Return the objects that have a member, and the member's numbers.

    Parameters
    ----------
    table : Table
        Table that contains only objects.
    name : str
        Name of the member.
    width : int
        Numbers per object.

    Returns
    -------
    places : (N,) int32
        Indices of the objects.
    rows : (N, width)
        Finite numbers.

    Raises
    ------
    FormatError
        If a member is anything other than ``width`` finite numbers.
    """
    places = [place for place, values in enumerate(table.items) if name in values]
    items = [table.items[place][name] for place in places]
    rows = _array(items, width)
    if rows is None:
        # At least one member is invalid; reading them one by one finds it.
        for place in places:
            table[place].numbers(name, width)
    return np.array(places, dtype=np.int32), np.zeros((0, width)) if rows is None else rows


def _array(items: list[Any], width: int) -> Floats | None:
    """Return lists of numbers as an array; None if any item is not such a list."""
    if set(map(type, items)) - {list} or set(map(len, items)) - {width}:
        return None
    if items and set(map(type, chain.from_iterable(items))) not in _NUMBERS:
        return None
    try:
        rows = np.array(items, dtype=np.float64).reshape(-1, width)
    except OverflowError:  # a whole number beyond the range of double precision
        return None
    return rows if (np.abs(rows) <= LARGEST).all() else None


def member_indices(table: Table, name: str, count: int, what: str) -> Ints:
    """Return an index below ``count`` from a member of each object, -1 if it is missing: (N,).

    Raises
    ------
    FormatError
        If a member is not such an index; see ``Element.index``.
    """
    result = np.full(len(table), -1, dtype=np.int32)
    for place, values in enumerate(table.items):
        if name in values:
            result[place] = table[place].index(name, count, what)
    return result
