"""Savitzky-Golay filter: a polynomial fitted to a window around each frame (1964)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats, Ints
from viewer.rig.cleanup.tangent import continuous, moved, relative_vectors

__all__ = ["SavitzkyGolay"]

_SECONDS = 0.2  # default length of the window, seconds
_PASSES = 2  # the second pass fits relative to the result of the first, which is less noisy


@dataclass(frozen=True, slots=True)
class SavitzkyGolay:
    """Least-squares fit of a polynomial to a window of frames, evaluated at its middle.

    Near the ends of a motion, the window stays within the motion, and the polynomial is evaluated
    away from the middle of the window. Rotations are fitted as rotation vectors relative to the
    rotation of the frame, so constant and uniform rotations are unchanged.

    Attributes
    ----------
    window : int
        Odd number of frames; 0 for 0.2 seconds.
    order : int
        Degree of the polynomial, less than the window.
    """

    window: int = 0
    order: int = 2

    def frames(self, rate: float) -> int:
        """Return the length of the window at a frame rate, frames."""
        if self.window:
            return self.window
        half = max(round(0.5 * _SECONDS * rate), (self.order + 1) // 2)
        return 2 * half + 1

    def used_frames(self, count: int, rate: float) -> int:
        """Return the window used for a run of frames, 0 if it is too short to be filtered."""
        window = min(self.frames(rate), count - 1 + count % 2)
        return window if window > self.order else 0

    def rotations(self, quaternions: Floats, rate: float) -> Floats:
        """Return filtered unit quaternions (N, ..., 4) of frames at ``rate`` per second."""
        known = continuous(quaternions)
        found = known
        for _ in range(_PASSES):
            vectors = self._fitted(len(known), rate, _relative_to(found, known))
            found = moved(found, vectors) if vectors is not None else found
        return found

    def positions(self, positions: Floats, rate: float, metres: float = 1.0) -> Floats:
        """Return filtered positions (N, ..., 3); the unit of lengths has no effect."""
        found = self._fitted(len(positions), rate, lambda rows: positions[rows] - positions)
        return positions if found is None else positions + found

    def _fitted(self, count: int, rate: float, at: Callable[[Ints], Floats]) -> Floats | None:
        """Return the fitted values of all frames; None if there are too few to fit.

        ``at`` returns the values at one frame of each window, relative to the frame to be filtered.
        """
        window = self.used_frames(count, rate)
        if not window:
            return None
        start = np.clip(np.arange(count) - window // 2, 0, count - window)
        weights = _smoothing_matrix(window, self.order)[np.arange(count) - start]
        total: Floats | None = None
        for place in range(window):
            values = at((start + place).astype(np.int32))
            part = weights[:, place].reshape(-1, *[1] * (values.ndim - 1)) * values
            total = part if total is None else total + part
        return total


def _relative_to(found: Floats, known: Floats) -> Callable[[Ints], Floats]:
    return lambda rows: relative_vectors(found, known[rows])


def _smoothing_matrix(window: int, order: int) -> Floats:
    """Return H = A (A^T A)^-1 A^T of polynomials: row i yields the fitted value at frame i."""
    place = np.linspace(-1.0, 1.0, window)
    basis, _ = np.linalg.qr(np.vander(place, order + 1))
    return basis @ basis.T
