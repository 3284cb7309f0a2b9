"""Keys that identify the contents of arrays, to detect changes."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats

__all__ = ["NumberKey"]


class NumberKey:
    """A snapshot of the contents of some arrays.

    Keys of equal contents are equal. ``is_of`` compares without copying.

    Parameters
    ----------
    *arrays : (...)
        Of any shapes.

    >>> angles = np.zeros(3)
    >>> key = NumberKey(angles)
    >>> angles[1] = 0.5
    >>> key.is_of(angles), key.is_of(np.zeros(3)), key == NumberKey(np.zeros(3))
    (False, True, True)
    """

    __slots__ = ("_parts",)

    def __init__(self, *arrays: Floats) -> None:
        self._parts = tuple(map(bytearray, arrays))

    def is_of(self, *arrays: Floats) -> bool:
        """Return whether the arrays have the contents of the key, bit by bit."""
        if len(arrays) != len(self._parts):
            return False
        for part, array in zip(self._parts, arrays, strict=True):
            packed = array if array.flags.c_contiguous else np.ascontiguousarray(array)
            # A bytearray compares with the array's memory directly, without a temporary array.
            if part != packed:
                return False
        return True

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, NumberKey):
            return NotImplemented
        return self is other or self._parts == other._parts

    def __hash__(self) -> int:
        return hash(tuple(map(bytes, self._parts)))
