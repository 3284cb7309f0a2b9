"""Element types and shapes of arrays in files, checked before memory is allocated."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Phrase
from viewer.formats._misfit import MisfitError

__all__ = ["array_dtype", "item_count", "shaped"]

_DTYPE = re.compile(r"[<>=|]?(?:b1|[iu][1248]|f[248]|[SU]([1-9][0-9]{0,6}))")
_LONGEST_TEXT = 1 << 20  # maximum number of characters in one element
_MAX_AXES = 32
# Maximum size of an array; numpy has no larger ones, even if an axis is 0.
_MAX_BYTES = 1 << 60
_LAST_LETTER = 0x10FFFF  # last code point of Unicode; numpy stores 4 bytes without checking them


def array_dtype(code: str) -> np.dtype[Any] | None:
    """Return a numeric or string dtype by its numpy spelling, or None for other types.

    Records, sub-arrays, objects, dates and platform-dependent types are not supported.

    >>> array_dtype(">f4"), array_dtype("|O"), array_dtype("S0")
    (dtype('>f4'), None, None)
    """
    match = _DTYPE.fullmatch(code)
    if match is None or int(match[1] or 1) > _LONGEST_TEXT:
        return None
    return np.dtype(code)


def item_count(shape: tuple[int, ...], item_size: int) -> int | None:
    """Return the number of elements of a shape, or None if numpy does not support it.

    >>> item_count((6890, 3), 8), item_count((0, 1 << 62), 8)
    (20670, None)
    """
    # An axis of length 0 makes the product 0 even if other axes are too long.
    if (
        len(shape) > _MAX_AXES
        or math.prod(max(side, 1) for side in shape) > _MAX_BYTES // item_size
    ):
        return None
    return math.prod(shape)


def shaped(flat: NDArray[Any], shape: tuple[int, ...], is_fortran: bool) -> NDArray[Any]:
    """Return flat values in their shape, C order and native byte order; copied if needed.

    Raises
    ------
    MisfitError
        If an element of a string array is not a valid character.
    """
    if flat.dtype.kind == "b" and flat.size and int(flat.view(np.uint8).max()) > 1:
        # numpy accepts any byte as bool, and then computes wrong results.
        flat = flat.view(np.uint8) != 0
    array = flat.reshape(shape, order="F" if is_fortran else "C")
    array = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("=")).reshape(shape)
    if array.dtype.kind == "U" and array.size:
        last = int(array.reshape(-1).view(np.uint32).max())
        if last > _LAST_LETTER:
            raise MisfitError(Phrase("array-letter", found=last))
    return array
