"""A source's archive, opened once, and the numbers in it, checked alike."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Part
from viewer.formats._archive import Archive
from viewer.formats._archive_opening import open_archive
from viewer.formats._numbers import LARGEST
from viewer.formats._source import Source
from viewer.formats._tolerant import mended_corners
from viewer.rig.arrays import Bools, Floats, Ints

__all__ = ["archive_of", "are_indices", "corners_of", "finite"]


_NOUNS = {
    "positions": "vertex",
    "weights": "vertex",
    "triangles": "triangle",
    "bindings": "joint",
    "joints": "joint",
    "frames": "row",
}
"""What a row is, by what of a figure or motion it is."""


def archive_of(source: Source) -> Archive:
    """Return the archive that a source is; see ``open_archive`` for what it raises."""
    if source.archive is None:
        source.archive = open_archive(source, source.max_size)
        source.archive.source = source
    return source.archive


def finite(
    archive: Archive,
    key: str,
    values: NDArray[Any],
    part: Part = "",
    places: NDArray[np.integer] | None = None,
) -> Floats:
    """Return numbers as float64, all of them finite, on the GPU too.

    Parameters
    ----------
    archive : Archive
        Where they are from.
    key : str
        What they are called there.
    values : (N, ...)
        Any numbers.
    part : str
        What of a figure or motion they are, where faults are noted, see ``Fault``.
    places : (N,), optional
        Which vertex, joint or frame each row is of; its index if omitted.

    Returns
    -------
    (N, ...)
        Where faults are noted, 0 in place of what is not finite; NaN in place of positions.

    Raises
    ------
    FormatError
        With the key, and how many are not.
    """
    # Views of a pickle may begin at any address: whoever computes with one should copy it.
    is_ready = values.dtype == np.float64 and values.flags.aligned
    numbers = values if is_ready else values.astype(np.float64)
    # Two reductions need no memory, and NaN passes through both.
    low, high = numbers.min(initial=0.0), numbers.max(initial=0.0)
    if low >= -LARGEST and high <= LARGEST:
        return numbers
    if archive.is_tolerant:
        return _mended(archive, key, numbers, part, places)
    if np.isfinite([low, high]).all():
        worst = high if high > LARGEST else low
        raise archive.error(key, f"expected numbers up to {LARGEST:.2g}, found {worst:g}")
    count = int((~np.isfinite(numbers)).sum())
    raise archive.error(key, f"expected finite numbers, found {count} that are not")


def _mended(
    archive: Archive, key: str, numbers: Floats, part: Part, places: NDArray[np.integer] | None
) -> Floats:
    """Note all numbers that are not finite, and return the others."""
    with np.errstate(invalid="ignore"):
        bad: Bools = ~(np.abs(numbers) <= LARGEST)
    first = np.argwhere(bad)[0].tolist()
    rows = np.flatnonzero(bad.reshape(len(bad), -1).any(axis=1)) if first else np.zeros(1, np.int64)
    at = rows if places is None else places[rows]
    place = f" at {', '.join(map(str, first))}" if first else ""
    place = f" at {_NOUNS[part]} {at[0]}" if part else place
    error = archive.error(key, f"expected finite numbers, found {numbers[tuple(first)]:g}{place}")
    error.code = "W003" if part == "weights" else "F003"
    archive.refuse(error, int(bad.sum()), part, at if part else ())
    return np.where(bad, np.nan if part == "positions" else 0.0, numbers)


def corners_of(archive: Archive, key: str, values: NDArray[Any], n_vertices: int) -> Ints:
    """Return triangles whose corners are vertices: (T, 3) int32.

    Parameters
    ----------
    archive : Archive
        Where they are from.
    key : str
        What they are called there.
    values : (T, 3)
        Vertex indices.
    n_vertices : int
        V.

    Raises
    ------
    FormatError
        If an index is not from 0 to V - 1; where faults are noted, it becomes another corner.
    """
    if are_indices(values, n_vertices):
        return values.astype(np.int32)
    fits = (values >= 0) & (values < n_vertices) & (values == np.floor(values))
    error = archive.error(
        key, f"expected a vertex from 0 to {n_vertices - 1}, found {values[~fits][0]:.16g}"
    )
    archive.refuse(error, int((~fits).sum()), "triangles", np.flatnonzero(~fits.all(axis=1)))
    return mended_corners(np.where(fits, values, 0).astype(np.int64), fits)


def are_indices(values: NDArray[Any], end: int) -> bool:
    """Return whether all numbers are whole and from 0 to ``end - 1``.

    >>> are_indices(np.array([0.0, 2.0]), 3), are_indices(np.array([np.nan]), 3)
    (True, False)
    """
    return bool(((values >= 0) & (values < end) & (values == np.floor(values))).all())
