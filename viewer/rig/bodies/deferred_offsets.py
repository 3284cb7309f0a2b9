"""Offsets of blend shapes that are read on first use, and summed without being read as a whole."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from viewer.rig.arrays import Deferred, Floats

__all__ = ["DeferredOffsets"]


class DeferredOffsets(Deferred):
    """Offsets of blend shapes whose weighted sum does not need the whole array.

    Parameters
    ----------
    shape : (int, int, int)
        S, V, 3.
    load : callable
        Returns the array; see ``Deferred``.
    total : callable
        Returns sum_s w_s d_s, (V, 3), for weights (S,).
    """

    __slots__ = ("total",)

    def __init__(
        self,
        shape: tuple[int, int, int],
        load: Callable[[], Floats],
        total: Callable[[Floats], Floats],
    ) -> None:
        super().__init__(shape, np.float64, load)
        self.total = total
