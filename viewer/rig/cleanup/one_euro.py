"""One Euro filter: an exponential filter whose cutoff rises with speed (Casiez et al. 2012)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats
from viewer.rig.cleanup.tangent import continuous, moved, relative_vectors

__all__ = ["OneEuro"]

_SETTLED = 1e-4  # weight below which the first value is negligible
_LONGEST = 1000  # maximum number of frames added at each end


@dataclass(frozen=True, slots=True)
class OneEuro:
    """One Euro filter, applied forwards and then backwards, so that the delays cancel.

    First, the motion is extended beyond both ends by point reflection, far enough for a pass to
    settle: uniform motion is unchanged up to its ends, and the end values are preserved.

    Each pass is x' = x' + a (x - x'), a = 1 / (1 + r / (2 pi f)) at r frames per second. The cutoff
    is f = cutoff + beta |s|, where s is the speed, filtered with the cutoff ``speed_cutoff``. For
    rotations, x - x' is the rotation vector from x' to x. At constant cutoff, both passes together
    scale a frequency of w radians per frame by a^2 / (1 - 2 (1 - a) cos w + (1 - a)^2).

    Attributes
    ----------
    cutoff : float
        Cutoff frequency at rest, Hz.
    beta : float
        Hz per radian per second for rotations, per metre per second for positions.
    speed_cutoff : float
        Cutoff frequency of the speed, Hz.
    """

    cutoff: float = 3.0
    beta: float = 2.0
    speed_cutoff: float = 1.0

    def rotations(self, quaternions: Floats, rate: float) -> Floats:
        """Return filtered unit quaternions (N, ..., 4) of frames at ``rate`` per second."""
        count = self._settling(rate)
        longer, inner = _continued(continuous(quaternions), count, _opposite_rotations)
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
        steps = relative_vectors(quaternions[:-1], quaternions[1:])
        speed = np.zeros((*quaternions.shape[1:-1], 3))
        for frame in range(1, len(found)):
            speed, factor = self._adapted(speed, steps[frame - 1] * rate, rate)
            toward = relative_vectors(found[frame - 1], quaternions[frame])
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
    """Return frames (N, ...) extended beyond both ends, and the range of the original ones.

    ``count`` is the number of frames to add at each end; ``opposite`` reflects values about a
    value.
    """
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
    return moved(middle, -relative_vectors(middle, quaternions))


def _opposite_positions(middle: Floats, positions: Floats) -> Floats:
    return 2.0 * middle - positions


def _factor(cutoff: Floats | float, rate: float) -> Floats:
    """Return a = 1 / (1 + r / (2 pi f)) for a cutoff frequency f at r frames per second."""
    turns = 2.0 * np.pi * np.asarray(cutoff, dtype=np.float64)
    return turns / (turns + rate)
