"""A source's archive, opened once, and the numbers in it, checked alike."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.formats._archive import Archive, open_archive
from viewer.formats._numbers import LARGEST
from viewer.formats._source import Source
from viewer.rig.arrays import Floats

__all__ = ["archive_of", "are_indices", "finite"]


def archive_of(source: Source) -> Archive:
    """Return the archive that a source is; see ``open_archive`` for what it raises."""
    if source.archive is None:
        source.archive = open_archive(source, source.max_size)
    return source.archive


def finite(archive: Archive, key: str, values: NDArray[Any]) -> Floats:
    """Return numbers as float64, all of them finite, on the GPU too.

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
    if np.isfinite([low, high]).all():
        worst = high if high > LARGEST else low
        raise archive.error(key, f"expected numbers up to {LARGEST:.2g}, found {worst:g}")
    count = int((~np.isfinite(numbers)).sum())
    raise archive.error(key, f"expected finite numbers, found {count} that are not")


def are_indices(values: NDArray[Any], end: int) -> bool:
    """Return whether all numbers are whole and from 0 to ``end - 1``.

    >>> are_indices(np.array([0.0, 2.0]), 3), are_indices(np.array([np.nan]), 3)
    (True, False)
    """
    return bool(((values >= 0) & (values < end) & (values == np.floor(values))).all())
