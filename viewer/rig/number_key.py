"""Numbers of arrays, kept to know whether the arrays still hold them."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats

__all__ = ["NumberKey"]


class NumberKey:
    """The numbers that some arrays had when the key was made.

    Keys of equal numbers are equal. Asking whether arrays still have the numbers copies nothing.

    Parameters
    ----------
    *arrays : (...)
        Of any shapes.

    >>> turned = np.zeros(3)
    >>> key = NumberKey(turned)
    >>> turned[1] = 0.5
    >>> key.is_of(turned), key.is_of(np.zeros(3)), key == NumberKey(np.zeros(3))
    (False, True, True)
    """

    __slots__ = ("_parts",)

    def __init__(self, *arrays: Floats) -> None:
        self._parts = tuple(map(bytearray, arrays))

    def is_of(self, *arrays: Floats) -> bool:
        """Return whether there are as many arrays and all hold the same numbers, bit by bit."""
        if len(arrays) != len(self._parts):
            return False
        for part, array in zip(self._parts, arrays, strict=True):
            packed = array if array.flags.c_contiguous else np.ascontiguousarray(array)
            # A bytearray compares itself with the array's memory, and no array of answers is made.
            if part != packed:
                return False
        return True

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, NumberKey):
            return NotImplemented
        return self is other or self._parts == other._parts

    def __hash__(self) -> int:
        return hash(tuple(map(bytes, self._parts)))
