"""Smoothing of clips: filters of rotations in their tangent space, and of positions.

``OneEuro`` adapts its cutoff to the speed: still poses are smoothed strongly, quick motions hardly.
``SavitzkyGolay`` fits polynomials, which keeps the height and width of peaks. Both filter rotations
as rotation vectors relative to a nearby rotation, so that uniform rotations are unchanged.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats, Ints, runs_of
from viewer.rigs.cleanup.frames import Captured, in_frame_order
from viewer.rigs.geometry.quaternion import (
    align_signs,
    conjugate,
    multiply,
    quaternion_to_rotation_vector,
    rotation_vector_to_quaternion,
)

# One Euro filter (Casiez, Roussel and Vogel 2012).

# Weight below which the first value is negligible: after n frames it is (1 - a)^n. A motion of 1 m
# is then off by 0.1 mm.
_SETTLED = 1e-4
_LONGEST = 1000  # maximum number of frames added at each end, for cutoffs close to 0

# Savitzky-Golay filter.
_SECONDS = 0.2  # default length of the window, seconds
_PASSES = 2  # the second pass fits relative to the result of the first, which is less noisy


class Filter(Protocol):
    """A filter of consecutive frames."""

    def rotations(self, quaternions: Floats, rate: float) -> Floats:
        """Return filtered unit quaternions (N, J, 4) of N frames at ``rate`` frames per second."""

    def positions(self, positions: Floats, rate: float, metres: float) -> Floats:
        """Return filtered positions (N, J, 3); ``metres`` is the length of their unit."""


def smoothed(clip: Captured, chosen: Filter, metres: float = 1.0) -> Captured:
    """Filter rotations and translations between gaps; ``metres``: length of the clip's unit."""
    ordered = in_frame_order(clip)
    rate = ordered.timing.frame_rate
    before = np.concatenate([[0], np.cumsum(ordered.timing.present)])
    runs = [slice(int(before[a]), int(before[b])) for a, b in runs_of(ordered.timing.present)]
    if ordered.points is not None:
        return replace(ordered, points=_points(ordered.points, runs, chosen, rate, metres))
    rotations = ordered.rotations.copy()
    for rows in runs:
        rotations[rows] = chosen.rotations(rotations[rows], rate)

    def filtered(positions: Floats | None) -> Floats | None:
        if positions is None or not len(positions) or not np.ptp(positions, axis=0).any():
            return positions
        found = positions.copy()
        for rows in runs:
            found[rows] = chosen.positions(found[rows], rate, metres)
        return found

    place = ordered.figure_translations
    place = filtered(None if place is None else place[:, None])
    return replace(
        ordered,
        rotations=rotations,
        translations=filtered(ordered.translations),
        figure_translations=None if place is None else place[:, 0],
    )


def run_lengths(clip: Captured) -> list[int]:
    """Return the lengths of the runs of frames that are filtered separately."""
    if clip.points is None:
        return [stop - start for start, stop in runs_of(clip.timing.present)]
    rows = clip.timing.rows
    seen = (clip.points[rows, :, 3] > 0.0) & (rows >= 0)[:, None]
    return [stop - start for each in seen.T for start, stop in runs_of(each)]


def _points(
    points: Floats, runs: list[slice], chosen: Filter, rate: float, metres: float
) -> Floats:
    """Return filtered points (N, K, 4); a point is filtered while it is visible."""
    result = points.copy()
    for rows in runs:
        part = result[rows]
        # Points that are visible in the same frames are filtered together.
        together = defaultdict[tuple[int, int], list[int]](list)
        for point in range(points.shape[1]):
            for span in runs_of(part[:, point, 3] > 0.0):
                together[span].append(point)
        for (start, stop), numbers in together.items():
            seen = part[start:stop, numbers, :3]
            part[start:stop, numbers, :3] = chosen.positions(seen, rate, metres)
    return result


@dataclass(frozen=True, slots=True)
class OneEuro:
    """One Euro filter, applied forwards and then backwards, so that the delays cancel.

    First, the motion is extended beyond both ends by point reflection, far enough for a pass to
    settle: uniform motion is unchanged up to its ends, and the end values are preserved.

    Each pass is x' = x' + a (x - x'), a = 1 / (1 + r / (2 pi f)) at r frames per second. The cutoff
    is f = cutoff + beta |s|, where s is the speed, filtered with the cutoff ``speed_cutoff``. For
    rotations, x - x' is the rotation vector from x' to x. At constant cutoff, both passes together
    scale a frequency of w radians per frame by a^2 / (1 - 2 (1 - a) cos w + (1 - a)^2).
    """

    cutoff: float = 3.0
    """Cutoff frequency at rest, Hz."""
    beta: float = 2.0
    """Hz per radian per second for rotations, per metre per second for positions."""
    speed_cutoff: float = 1.0
    """Cutoff frequency of the speed, Hz."""

    def rotations(self, quaternions: Floats, rate: float) -> Floats:
        """Return filtered unit quaternions (N, ..., 4) of frames at ``rate`` per second."""
        count = self._settling(rate)
        longer, inner = _continued(_continuous(quaternions), count, _opposite_rotations)
        once = self._turned(longer, rate)
        return self._turned(once[::-1], rate)[::-1][inner]

    def positions(self, positions: Floats, rate: float, metres: float = 1.0) -> Floats:
        """Return filtered positions (N, ..., 3); ``metres`` is the length of their unit."""
        longer, inner = _continued(positions, self._settling(rate), _opposite_positions)
        once = self._shifted(longer, rate, metres)
        return self._shifted(once[::-1], rate, metres)[::-1][inner]

    def _settling(self, rate: float) -> int:
        """Return the number of frames after which the initial value of a pass is negligible."""
        slowest = float(_factor(min(self.cutoff, self.speed_cutoff), rate))
        return min(int(np.ceil(np.log(_SETTLED) / np.log1p(-slowest))), _LONGEST)

    def _turned(self, quaternions: Floats, rate: float) -> Floats:
        found = quaternions.copy()
        steps = _relative_vectors(quaternions[:-1], quaternions[1:])
        speed = np.zeros((*quaternions.shape[1:-1], 3))
        for frame in range(1, len(found)):
            speed, factor = self._adapted(speed, steps[frame - 1] * rate, rate)
            toward = _relative_vectors(found[frame - 1], quaternions[frame])
            found[frame] = moved(found[frame - 1], factor * toward)
        return found

    def _shifted(self, positions: Floats, rate: float, metres: float) -> Floats:
        found = positions.copy()
        speed = np.zeros(positions.shape[1:])
        steps = np.diff(positions, axis=0) * (rate * metres)
        for frame in range(1, len(found)):
            speed, factor = self._adapted(speed, steps[frame - 1], rate)
            found[frame] = found[frame - 1] + factor * (positions[frame] - found[frame - 1])
        return found

    def _adapted(self, speed: Floats, measured: Floats, rate: float) -> tuple[Floats, Floats]:
        """Return the filtered speed (..., 3), and the factor a of this frame (..., 1)."""
        speed = speed + _factor(self.speed_cutoff, rate) * (measured - speed)
        size = np.linalg.norm(speed, axis=-1, keepdims=True)
        return speed, _factor(self.cutoff + self.beta * size, rate)


def _continued(
    values: Floats, count: int, opposite: Callable[[Floats, Floats], Floats]
) -> tuple[Floats, slice]:
    """Return frames (N, ...) with ``count`` more reflected at each end, and the old ones' range."""
    total = len(values)
    added = 0
    while added < count and len(values) > 1:
        step = min(count - added, len(values) - 1)
        before = opposite(values[0], values[step:0:-1])
        after = opposite(values[-1], values[-2 : -step - 2 : -1])
        values = np.concatenate([before, values, after])
        added += step
    return values, slice(added, added + total)


def _opposite_rotations(middle: Floats, quaternions: Floats) -> Floats:
    """Return rotations by the opposite angle from the middle: b exp(-v) of b exp(v)."""
    return moved(middle, -_relative_vectors(middle, quaternions))


def _opposite_positions(middle: Floats, positions: Floats) -> Floats:
    return 2.0 * middle - positions


def _factor(cutoff: Floats | float, rate: float) -> Floats:
    """Return a = 1 / (1 + r / (2 pi f)) for a cutoff frequency f at r frames per second."""
    # A first-order low-pass filter: x' follows x with the time constant T = 1 / (2 pi f). One step
    # of 1 / r seconds by the implicit Euler method is x' += (x - x') / (1 + r T).
    turns = 2.0 * np.pi * np.asarray(cutoff, dtype=np.float64)
    return turns / (turns + rate)


@dataclass(frozen=True, slots=True)
class SavitzkyGolay:
    """Least-squares polynomial through a window of frames, evaluated at its middle.

    Near the ends of a motion the window stays inside it, and the polynomial is evaluated off its
    middle. Rotations are fitted as vectors relative to the frame's own, so that uniform rotation is
    unchanged.
    """

    window: int = 0
    """Odd number of frames; 0 for 0.2 seconds."""
    order: int = 2
    """Degree of the polynomial, less than the window."""

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
        known = _continuous(quaternions)
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
        """Fit the values that ``at`` gives for a frame of each window; None for too few frames."""
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
    return lambda rows: _relative_vectors(found, known[rows])


def _smoothing_matrix(window: int, order: int) -> Floats:
    """Return H = A (A^T A)^-1 A^T of polynomials: row i yields the fitted value at frame i."""
    # The polynomial with coefficients c has the values A c at the frames of a window, where row i
    # of A has the powers of place i. The least-squares fit of values y is c = (A^T A)^-1 A^T y
    # (Savitzky and Golay 1964), so A c = H y. Powers up to a high order are nearly dependent, so H
    # is made of an orthonormal basis Q of A's columns: H = Q Q^T.
    place = np.linspace(-1.0, 1.0, window)
    basis, _ = np.linalg.qr(np.vander(place, order + 1))
    return basis @ basis.T


def _continuous(quaternions: Floats) -> Floats:
    """Return quaternions (N, ..., 4) with signs such that consecutive ones are nearest."""
    result = quaternions.copy()
    align_signs(result)
    return result


def moved(base: Floats, vectors: Floats) -> Floats:
    """Return b exp(v) of unit quaternions (..., 4) and rotation vectors (..., 3), normalised."""
    found = multiply(base, rotation_vector_to_quaternion(vectors))
    return found / np.linalg.norm(found, axis=-1, keepdims=True)


def _relative_vectors(base: Floats, quaternions: Floats) -> Floats:
    """Return rotation vectors v (..., 3) with q = b exp(v); q's sign decides up to 2 pi."""
    return quaternion_to_rotation_vector(multiply(conjugate(base), quaternions))
