"""Checks of the arrays in an archive: finite numbers and valid indices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Part, Phrase, wording
from viewer.formats._archive.opening import open_archive
from viewer.formats._archive.values import Archive, Axes
from viewer.formats._placeholders import neutral_corners
from viewer.formats._source import Source
from viewer.formats._text.numbers import LARGEST
from viewer.formats._translation_limit import FARTHEST
from viewer.phrases import listed, optional, rounded
from viewer.rigs.arrays import Bools, Deferred, Floats, Ints

_ROWS = {
    "positions": "vertex {index}",
    "weights": "vertex {index}",
    "triangles": "triangle {index}",
    "bindings": "joint {index}",
    "joints": "joint {index}",
}
"""A row, by part of a figure or motion."""


def archive_of(source: Source) -> Archive:
    """Return the archive of a source, opened once; errors as of ``open_archive``."""
    return source.once(open_archive)


def finite(
    archive: Archive,
    key: str,
    values: NDArray[np.generic],
    part: Part = "",
    places: NDArray[np.integer] | None = None,
) -> Floats:
    """Return numbers (N, ...) as float64, all finite in single precision, or refuse the file.

    If it is read nevertheless, invalid ones become NaN for positions, the identity for bind
    matrices, otherwise 0. ``places`` (N,): vertex or joint of each row.
    """
    numbers, bad = _invalid(values)
    if bad is None:
        return numbers
    rows = np.flatnonzero(bad.reshape(len(bad), -1).any(axis=1)) if bad.ndim else np.zeros(1, int)
    of = rows if places is None else places[rows]
    message, found = _problem(numbers, bad)
    if part:
        found["at"] = optional(" at {}", Phrase(_ROWS[part], index=int(of[0])))
    archive.refuse(
        f"{'W003' if part == 'weights' else 'F003'}.{message}",
        item=key,
        count=int(bad.sum()),
        part=part,
        places=of if part else None,
        **found,
    )
    if part == "bindings":
        # The whole matrix is replaced, as a single 0 would result in a different transform.
        lost: Bools = np.asarray(bad.reshape(len(bad), -1).any(axis=1))
        return np.where(lost[:, None, None], np.eye(4), numbers)
    return np.where(bad, np.nan if part == "positions" else 0.0, numbers)


def finite_array(archive: Archive, key: str, shape: Axes | None, part: Part = "") -> Floats:
    """Return an array of a shape as float64; see ``Archive.array`` and ``finite``."""
    return finite(archive, key, archive.array(key, shape).values(), part)


def last_axis_first(archive: Archive, key: str, array: Deferred) -> Deferred:
    """Return directions (V, 3, N), as models store them, as (N, V, 3), read on first use."""

    def load() -> Floats:
        rows = np.moveaxis(array.values(), 2, 0)
        return finite(archive, key, np.ascontiguousarray(rows, np.float64))

    return Deferred((array.shape[2], *array.shape[:2]), np.float64, load)


def finite_or_nan(archive: Archive, key: str, values: NDArray[np.generic]) -> Floats:
    """Return numbers of frames as float64, NaN (later a gap) for those that ``finite`` refuses."""
    numbers, bad = _invalid(values)
    if bad is None:
        return numbers
    message, found = _problem(numbers, bad)
    archive.leave_gap(f"F003.{message}", item=key, **found)
    return np.where(bad, np.nan, numbers)


def within_reach(archive: Archive, key: str, found: Floats) -> Floats:
    """Return translations (..., 3) of a key, NaN for those beyond the limit of all motions."""
    far = np.abs(found) > FARTHEST
    if not far.any():
        return found
    place = np.argwhere(far)[0]
    archive.leave_gap(
        "F003.motion-reach: {item}: expected numbers within ±{limit}, found {found:g} in "
        "frame {frame}",
        item=key,
        limit=rounded(FARTHEST, 2),
        found=float(found[tuple(place)]),
        frame=int(place[0]),
    )
    return np.where(far, np.nan, found)


def _invalid(values: NDArray[np.generic]) -> tuple[Floats, Bools | None]:
    """Return numbers as float64, and a mask of those not finite or beyond single precision."""
    # Views of a pickle may be unaligned, and are copied because computing with them is slow.
    is_ready = values.dtype == np.float64 and values.flags.aligned
    numbers = values.astype(np.float64, copy=not is_ready)
    # Two reductions need no temporary array, and both propagate NaN.
    low, high = numbers.min(initial=0.0), numbers.max(initial=0.0)
    if low >= -LARGEST and high <= LARGEST:
        return numbers, None
    with np.errstate(invalid="ignore"):
        return numbers, np.asarray(~(np.abs(numbers) <= LARGEST))


def _problem(numbers: Floats, bad: Bools) -> tuple[str, dict[str, object]]:
    """Return the message about the first invalid number, without its code, and its values."""
    first = np.argwhere(bad)[0].tolist()
    found = float(numbers[tuple(first)])
    values: dict[str, object] = {
        "found": found,
        "at": optional(" at {}", Phrase("{indices}", indices=listed(first)) if first else ""),
    }
    if np.isfinite(found):
        return wording.TOO_FAR, {**values, "limit": rounded(LARGEST, 2)}
    return wording.NOT_FINITE, values


def corners_of(archive: Archive, key: str, values: NDArray[np.number], n_vertices: int) -> Ints:
    """Return vertex indices of triangles (T, 3) as int32; invalid ones are refused or replaced."""
    if are_indices(values, n_vertices):
        return values.astype(np.int32)
    fits = (values >= 0) & (values < n_vertices) & (values == np.floor(values))
    archive.refuse(
        wording.VERTEX_RANGE,
        item=key,
        count=int((~fits).sum()),
        part="triangles",
        places=np.flatnonzero(~fits.all(axis=1)),
        last=n_vertices - 1,
        found=values[~fits][0],
    )
    return neutral_corners(np.where(fits, values, 0).astype(np.int64), fits)


def are_indices(values: NDArray[np.number], end: int) -> bool:
    """Return whether all numbers are integers from 0 to ``end - 1``."""
    return bool(((values >= 0) & (values < end) & (values == np.floor(values))).all())
