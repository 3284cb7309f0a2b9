"""Checks of the arrays in an archive: finite numbers and valid indices."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Part, Phrase
from viewer.formats._archive.opening import open_archive
from viewer.formats._archive.values import Archive
from viewer.formats._neutral import held_rows, neutral_corners
from viewer.formats._source import Source
from viewer.formats._text.numbers import LARGEST
from viewer.rig.arrays import Bools, Floats, Ints

__all__ = ["archive_of", "are_indices", "corners_of", "finite"]


_ROWS = {
    "positions": "row-vertex",
    "weights": "row-vertex",
    "triangles": "row-triangle",
    "bindings": "row-joint",
    "joints": "row-joint",
    "frames": "row-frame",
}
"""Phrase key for a row, by part of a figure or motion."""


def archive_of(source: Source) -> Archive:
    """Return the archive of a source, opened once; errors as of ``open_archive``."""
    return source.once(open_archive)


def finite(
    archive: Archive,
    key: str,
    values: NDArray[Any],
    part: Part = "",
    places: NDArray[np.integer] | None = None,
) -> Floats:
    """Return numbers as float64, all finite in double and single precision.

    Parameters
    ----------
    archive : Archive
        Archive that contains the numbers.
    key : str
        Key of the numbers in the archive.
    values : (N, ...)
        Numbers to check.
    part : str
        Part of the figure or motion, see ``Diagnostic``.
    places : (N,), optional
        Vertex, joint or frame of each row; the index of the row if omitted.

    Returns
    -------
    (N, ...)
        Neutral values in place of invalid ones, unless the file is refused: NaN for positions, the
        identity for bind matrices, the previous row for frames, otherwise 0.

    Raises
    ------
    FormatError
        If a number is not finite; the message states the key and the number.
    """
    # Views of a pickle may be unaligned, and are copied because computing with them is slow.
    is_ready = values.dtype == np.float64 and values.flags.aligned
    numbers = values if is_ready else values.astype(np.float64)
    # Two reductions need no temporary array, and both propagate NaN.
    low, high = numbers.min(initial=0.0), numbers.max(initial=0.0)
    if low >= -LARGEST and high <= LARGEST:
        return numbers
    with np.errstate(invalid="ignore"):
        bad: Bools = ~(np.abs(numbers) <= LARGEST)
    _refuse_numbers(archive, key, numbers, bad, part, places)
    return _with_neutral(numbers, bad, part)


def _refuse_numbers(
    archive: Archive,
    key: str,
    numbers: Floats,
    bad: Bools,
    part: Part,
    places: NDArray[np.integer] | None,
) -> None:
    """Record an error for numbers that are not finite, or beyond single precision."""
    first = np.argwhere(bad)[0].tolist()
    found = float(numbers[tuple(first)])
    rows = np.flatnonzero(bad.reshape(len(bad), -1).any(axis=1)) if first else np.zeros(1, np.int64)
    of = rows if places is None else places[rows]
    at: Phrase | str = Phrase("element", indices=first) if first else ""
    values: dict[str, Any] = {"limit": LARGEST} if np.isfinite(found) else {}
    archive.refuse(
        f"{'W003' if part == 'weights' else 'F003'}.{'limit' if values else 'finite'}",
        item=key,
        count=int(bad.sum()),
        part=part,
        places=of if part else None,
        found=found,
        at=Phrase(_ROWS[part], index=int(of[0])) if part else at,
        **values,
    )


def _with_neutral(numbers: Floats, bad: Bools, part: Part) -> Floats:
    if part in ("frames", "bindings"):
        lost: Bools = np.asarray(bad.reshape(len(bad), -1).any(axis=1))
        if part == "frames":
            return held_rows(numbers, lost)
        # The whole matrix is replaced, as a single 0 would result in a different transform.
        return np.where(lost[:, None, None], np.eye(4), numbers)
    return np.where(bad, np.nan if part == "positions" else 0.0, numbers)


def corners_of(archive: Archive, key: str, values: NDArray[Any], n_vertices: int) -> Ints:
    """Return triangles with valid vertex indices: (T, 3) int32.

    Parameters
    ----------
    archive : Archive
        Archive that contains the numbers.
    key : str
        Key of the numbers in the archive.
    values : (T, 3)
        Vertex indices.
    n_vertices : int
        Number of vertices, V.

    Raises
    ------
    FormatError
        If an index is not between 0 and V - 1; if the file is not refused, another corner of the
        triangle replaces it.
    """
    if are_indices(values, n_vertices):
        return values.astype(np.int32)
    fits = (values >= 0) & (values < n_vertices) & (values == np.floor(values))
    archive.refuse(
        "F002.vertex-range",
        item=key,
        count=int((~fits).sum()),
        part="triangles",
        places=np.flatnonzero(~fits.all(axis=1)),
        last=n_vertices - 1,
        found=values[~fits][0],
    )
    return neutral_corners(np.where(fits, values, 0).astype(np.int64), fits)


def are_indices(values: NDArray[Any], end: int) -> bool:
    """Return whether all numbers are integers from 0 to ``end - 1``.

    >>> are_indices(np.array([0.0, 2.0]), 3), are_indices(np.array([np.nan]), 3)
    (True, False)
    """
    return bool(((values >= 0) & (values < end) & (values == np.floor(values))).all())
