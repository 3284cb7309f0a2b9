"""Fitting of a joint's DOFs to a given rotation, within their limits.

A joint's rotation relative to its parent is R(quaternion) E_n ... E_1, where each E rotates about
one axis. Three DOFs about three different axes have a closed form with two solutions (Tait-Bryan
angles); of the solutions within the limits, the one closer to the current values is used. Otherwise
each DOF is set in turn to its optimum with the others fixed, repeatedly: with M the product of the
factors around E_k and of the target rotation's transpose, the trace to maximise is

    trace(M E_k(t)) = M_kk + (M_ii + M_jj) cos t + (M_ij - M_ji) sin t,   (i, j) = (k + 1, k + 2)
"""

from __future__ import annotations

import math

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.geometry.rotation import (
    TURN,
    axis_rotations,
    matrix_to_euler,
    nearest_angles,
    quaternion_to_matrix,
)
from viewer.rigs.pose import Pose
from viewer.rigs.skeleton import FIRST_ROTATION, Skeleton

_SWEEPS = 200
_STILL = 1e-10  # largest change in the last sweep, radians
_ROUNDING = 1e-9  # tolerance in radians for a value that exceeds its limit


@dataclass(frozen=True, slots=True, eq=False)
class RotationFit:
    """Result of fitting a joint's DOFs to a rotation."""

    dofs: Floats
    """(D,). DOFs of the whole skeleton; only rotations of the joint have changed."""
    error: float
    """Angle between the target rotation and the resulting rotation, radians."""
    limited: Ints
    """(N,) int32. Rotation DOFs of the joint that are at a limit, if there is an error."""


def rotation_dofs(skeleton: Skeleton, joint: int, free: bool = False) -> Ints:
    """Return the DOF rows (N,) of a joint's rotations, in order of application."""
    chosen = (skeleton.dof_joints == joint) & (skeleton.dof_kinds >= FIRST_ROTATION)
    if free:
        chosen &= ~skeleton.locked
    return np.flatnonzero(chosen).astype(np.int32)


def rotates_freely(skeleton: Skeleton, joint: int) -> bool:
    """Return whether a joint has three free rotations about three different axes, in any order."""
    kinds = skeleton.dof_kinds[rotation_dofs(skeleton, joint, free=True)]
    every = skeleton.dof_kinds[rotation_dofs(skeleton, joint)]
    return len(kinds) == len(every) == 3 and len(set(kinds.tolist())) == 3


def nearest_dofs(skeleton: Skeleton, pose: Pose, joint: int, rotation: Floats) -> RotationFit:
    """Return the DOFs that rotate a joint as near as possible to (3, 3), relative to its parent.

    Of equally good solutions, the one nearest to the pose's DOFs is used.
    """
    rows = rotation_dofs(skeleton, joint)
    low, high = skeleton.dof_limits[rows].T
    axes = (skeleton.dof_kinds[rows] - FIRST_ROTATION).tolist()
    wanted = quaternion_to_matrix(pose.rotations[joint]).T @ rotation
    solver = _Solver(axes, low, high, pose.dofs[rows], wanted)
    dofs = pose.dofs.copy()
    dofs[rows] = values = solver.best()
    error = solver.error(values)
    at_limit = ((values <= low) | (values >= high)) & (error > 1e-6)
    return RotationFit(dofs, error, rows[at_limit])


class _Solver:
    """Fit of angles about coordinate axes, the first applied first, whose product is a rotation."""

    def __init__(
        self, axes: list[int], low: Floats, high: Floats, present: Floats, wanted: Floats
    ) -> None:
        self.axes, self.low, self.high, self.wanted = axes, low, high, wanted
        self.present = np.clip(present, low, high)

    def best(self) -> Floats:
        """Return the exact angles nearest to the current ones; without exact ones, the best."""
        exact = self._exact()
        within = [
            values
            for values in exact
            if (np.abs(np.clip(values, self.low, self.high) - values) <= _ROUNDING).all()
        ]
        if within:
            near = min(within, key=lambda values: float(np.abs(values - self.present).max()))
            return np.clip(near, self.low, self.high)
        starts = [self.present, *(np.clip(values, self.low, self.high) for values in exact)]
        found = [self._improved(start.copy()) for start in starts]
        errors = [self.error(values) for values in found]
        # The current values are tried first; other values replace them only if they are clearly
        # better.
        return found[int(np.argmin(np.round(errors, 7)))]

    def error(self, values: Floats) -> float:
        """Return the angle between the rotation of some values and the goal, from 0 to pi."""
        # R - R^T has the sine of the angle, the trace its cosine; atan2 of both is accurate at 0
        # and pi.
        left = self.wanted.T @ self._product(values, range(len(values)))
        sine = np.linalg.norm([left[2, 1] - left[1, 2], left[0, 2] - left[2, 0],
                               left[1, 0] - left[0, 1]])  # fmt: skip
        return math.atan2(0.5 * float(sine), 0.5 * (float(np.trace(left)) - 1.0))

    def _product(self, values: Floats, places: range) -> Floats:
        product = np.eye(3)
        for place in places:
            product = axis_rotations(self.axes[place], values[place]) @ product
        return product

    def _exact(self) -> list[Floats]:
        """Return both closed-form solutions for three different axes; an empty list otherwise."""
        if len(self.axes) != 3 or len(set(self.axes)) != 3:
            return []
        # Axes are renamed to x, y, z; an odd permutation is a reflection, which negates angles.
        renamed = self.wanted[np.ix_(self.axes, self.axes)]
        sign = 1.0 if (self.axes[1] - self.axes[0]) % 3 == 1 else -1.0
        x, y, z = matrix_to_euler(renamed)
        pair = np.array([[x, y, z], [x + math.pi, math.pi - y, z + math.pi]])
        return [self._wrapped(sign * values) for values in pair]

    def _wrapped(self, values: Floats) -> Floats:
        """Add multiples of 2 pi: nearest to the current values, within the limits if possible."""
        near = nearest_angles(values, self.present)
        inside = nearest_angles(near, np.clip(near, self.low, self.high))
        # A range that crosses -pi or pi may contain the value one full rotation away.
        for shift in (-TURN, TURN):
            moved = near + shift
            inside = np.where((moved >= self.low) & (moved <= self.high), moved, inside)
        is_inside = (near >= self.low - _ROUNDING) & (near <= self.high + _ROUNDING)
        return np.where(is_inside, near, inside)

    def _improved(self, values: Floats) -> Floats:
        """Optimise each value with the others fixed until none changes."""
        count = len(values)
        for _ in range(_SWEEPS):
            before = values.copy()
            for place in range(count):
                around = (
                    self._product(values, range(place))
                    @ self.wanted.T
                    @ self._product(values, range(place + 1, count))
                )
                values[place] = self._best_one(place, around, float(values[place]))
            if np.abs(values - before).max(initial=0.0) < _STILL:
                break
        return values

    def _best_one(self, place: int, around: Floats, now: float) -> float:
        """Return the nearest of the angles within the limits that maximise the trace."""
        axis = self.axes[place]
        i, j = (axis + 1) % 3, (axis + 2) % 3
        cosine, sine = around[i, i] + around[j, j], around[i, j] - around[j, i]
        if math.hypot(cosine, sine) < 1e-12:
            return now  # all angles are equally suitable
        # c cos t + s sin t is largest at t = atan2(s, c), and decreases on both sides of it.
        top = math.atan2(sine, cosine)
        top -= TURN * round((top - now) / TURN)
        low, high = float(self.low[place]), float(self.high[place])
        for candidate in (top, top - TURN, top + TURN):
            if low <= candidate <= high:
                return candidate
        return low if math.cos(low - top) >= math.cos(high - top) else high
