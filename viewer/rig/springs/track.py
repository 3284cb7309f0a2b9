"""Rotations of spring joints over the time of a motion, computed once and in order.

The simulation starts at rest at the start of the motion and proceeds in equal steps, so the result
at a given time does not depend on what was played previously. Between two steps, rotations are
interpolated.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats, Ints
from viewer.rig.geometry.quaternion import slerp
from viewer.rig.skeleton import Skeleton
from viewer.rig.springs.simulation import STEPS_PER_SECOND, Simulation, Tails

__all__ = ["PosedJoints", "PosesAt", "SpringTrack"]

_BLOCK = 64  # number of steps that are computed and cached together
_MOST_BLOCKS = 256  # maximum number of cached blocks; others are recomputed from their stored start
_ON_STEP = 1e-6  # tolerance, as a fraction of a step, for times that are treated as that step


@dataclass(frozen=True, slots=True, eq=False)
class PosedJoints:
    """Joints of a motion without springs at F times.

    Attributes
    ----------
    world, local : (F, J, 4, 4)
        Joint-to-figure matrices, and joint-to-parent matrices without scale.
    scales : (F, J, 3)
        Local scale factors.
    places : (F, 4, 4)
        Placement of the whole figure, which ``world`` includes.
    """

    world: Floats
    local: Floats
    scales: Floats
    places: Floats


PosesAt = Callable[[Floats], PosedJoints]
"""Returns the joints at some times, in seconds."""


class SpringTrack:
    """Rotations of the spring joints of one skeleton during one motion.

    Parameters
    ----------
    skeleton : Skeleton
        Skeleton with springs.
    start, end : float
        Range of the motion in seconds; the rotations are constant outside this range.
    """

    def __init__(self, skeleton: Skeleton, start: float, end: float) -> None:
        self._simulation, self._start = Simulation(skeleton), start
        self._last = int(np.ceil(max(end - start, 0.0) * STEPS_PER_SECOND - _ON_STEP))
        self._starts: list[Tails] = []
        self._blocks: dict[int, Floats] = {}

    def rotations(self, times: Floats, poses_at: PosesAt) -> Floats:
        """Return the complete rotations of the spring joints relative to their parents.

        Parameters
        ----------
        times : (F,)
            Seconds on the motion's own clock.
        poses_at : callable
            Returns the joints of the motion; always the same ones for a track.

        Returns
        -------
        (F, N, 4)
            Unit quaternions (x, y, z, w).
        """
        steps = np.clip((times - self._start) * STEPS_PER_SECOND, 0.0, self._last)
        before: Ints = np.floor(steps + _ON_STEP).astype(np.int32)
        fractions = np.maximum(steps - before, 0.0)
        after = np.minimum(before + 1, self._last)
        needed = np.unique(np.concatenate([before, after])) // _BLOCK
        # All blocks up to the last are computed in order, because each needs its predecessor.
        blocks = {int(block): self._block(int(block), poses_at) for block in np.unique(needed)}

        def at(chosen: Ints) -> Floats:
            return np.stack([blocks[step // _BLOCK][step % _BLOCK] for step in chosen.tolist()])

        return slerp(at(before), at(after), np.where(fractions > _ON_STEP, fractions, 0.0)[:, None])

    def _block(self, block: int, poses_at: PosesAt) -> Floats:
        """Return the rotations of one block of steps: (B, N, 4)."""
        if block not in self._blocks:
            for missing in range(min(len(self._starts), block), block + 1):
                found = self._computed(missing, poses_at)
                while len(self._blocks) >= _MOST_BLOCKS:
                    del self._blocks[next(iter(self._blocks))]
                self._blocks[missing] = found
        return self._blocks[block]

    def _computed(self, block: int, poses_at: PosesAt) -> Floats:
        """Simulate one block from its stored start, and store the start of the next."""
        steps = np.arange(block * _BLOCK, min((block + 1) * _BLOCK, self._last + 1))
        poses = poses_at(self._start + steps / STEPS_PER_SECOND)
        rows = zip(poses.world, poses.local, poses.scales, poses.places, strict=True)
        rotations = []
        for number, pose in enumerate(rows):
            if block == 0 and number == 0:
                # Starting at rest, the first step applies only stiffness and gravity.
                tails = self._simulation.start(*pose)
                rotations.append(self._simulation.rests)
                continue
            if number == 0:
                tails = self._starts[block - 1]
            tails, found = self._simulation.step(tails, *pose)
            rotations.append(found)
        if len(self._starts) == block:
            self._starts.append(tails)
        return np.stack(rotations)
