"""Rows of a ``.ply`` that all have the same size, as in most files.

Their columns are views of one array, so positions of individual numbers are not needed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.formats._ply.header import Element

_WHOLE = 2.0**31

__all__ = ["Columns", "compact", "even_binary", "even_text"]

Numbers = NDArray[Any]
Columns = tuple[dict[str, Numbers], dict[str, tuple[NDArray[np.int64], Numbers]]]
"""Properties by name, and lists by name. A list consists of the number of values of each row, and
all values."""


def even_text(element: Element, block: Numbers) -> Columns | None:
    """Split rows of numbers into the columns of an element, (N, C).

    Returns None if the rows do not fit, or have lists of different lengths.
    """
    lists = [prop.name for prop in element.properties if prop.count_kind]
    width = block.shape[1] - len(element.properties)
    if len(element.properties) == 0 or len(lists) > 1 or width < 0 or (width and not lists):
        return None
    columns: dict[str, Numbers] = {}
    found: dict[str, tuple[NDArray[np.int64], Numbers]] = {}
    at = 0
    for prop in element.properties:
        if prop.count_kind:
            if (block[:, at] != width).any():
                return None
            values = compact(block[:, at + 1 : at + 1 + width])
            found[prop.name] = _equal_counts(len(block), width), values.reshape(-1)
            at += width
        else:
            columns[prop.name] = block[:, at]
        at += 1
    return columns, found


def even_binary(
    element: Element, data: bytes, start: int, order: str, counts: list[int]
) -> tuple[Columns, int] | None:
    """Return the columns of an element, and the size of its rows in bytes.

    ``counts`` are the lengths of the lists in the first row. Returns None if other rows have other
    lengths, or the file is too short.
    """
    left = iter(counts)
    fields: list[tuple[Any, ...]] = []
    for number, prop in enumerate(element.properties):
        if prop.count_kind:
            fields += [
                (f"n{number}", order + prop.count_kind),
                (f"v{number}", order + prop.kind, (next(left),)),
            ]
        else:
            fields.append((f"v{number}", order + prop.kind))
    kind = np.dtype(fields)
    if element.count == 0 or start + kind.itemsize * element.count > len(data):
        return None
    rows = np.frombuffer(data, dtype=kind, count=element.count, offset=start)
    columns: dict[str, Numbers] = {}
    found: dict[str, tuple[NDArray[np.int64], Numbers]] = {}
    for number, prop in enumerate(element.properties):
        values = rows[f"v{number}"]
        if prop.count_kind:
            width = values.shape[1]
            if (rows[f"n{number}"] != width).any():
                return None
            flat = values.astype(prop.kind, copy=False).reshape(-1)
            found[prop.name] = _equal_counts(len(rows), width), flat
        else:
            columns[prop.name] = values
    return (columns, found), kind.itemsize


def compact(values: Numbers) -> Numbers:
    """Return whole numbers as int32, of half the size, and others unchanged."""
    fits = values.size and values.min() > -_WHOLE and values.max() < _WHOLE
    if values.dtype == np.int32 or not fits:
        return values
    whole = values.astype(np.int32)
    return whole if (whole == values).all() else values


def _equal_counts(count: int, size: int) -> NDArray[np.int64]:
    # A single number represents all equal counts.
    return np.broadcast_to(np.int64(size), (count,))
