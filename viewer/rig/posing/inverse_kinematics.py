"""Inverse kinematics: joint angles that move a joint to a target position, within the limits.

Damped least squares (Wampler 1986; Nakamura and Hanafusa 1986): with the error e from the joint
to its target and the Jacobian J of the joint's position with respect to the chain's rotation DOFs,

    step = J^T (J J^T + lambda^2 I)^-1 e

A step that does not reduce the error is rejected and the damping increased (Levenberg 1944). DOFs
that a step would move beyond a limit stop there, and the others compensate.
"""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.geometry.rotation import axis_rotations, quaternion_to_matrix
from viewer.rig.hierarchy import path_to_root
from viewer.rig.kinematics import world_matrices
from viewer.rig.pose import Pose
from viewer.rig.skeleton import FIRST_ROTATION, Skeleton, joint_label

_CLOSE = 1e-7  # error below which the target is reached, as a fraction of the chain's length
_STILL = 1e-10  # step in radians below which the search ends
_LARGEST_STEP = 0.5  # maximum step in radians for which the linearisation is accurate
_BEND = 0.02  # angle in radians by which a straight chain is bent out of a singular pose
_LEAST_DAMPING, _MOST_DAMPING = 1e-4, 1e3  # limits of the damping, relative to the chain's length


@dataclass(frozen=True, slots=True, eq=False)
class Reach:
    """Result of a reach for a target."""

    dofs: Floats
    """(D,). DOFs of the whole skeleton; only rotations of the chain have changed."""
    distance: float
    """Remaining distance between the joint and its target, figure units."""
    limited: Ints
    """(N,) int32. DOFs of the chain that are at one of their limits."""


def chain_above(skeleton: Skeleton, joint: int, length: int) -> Ints:
    """Return the nearest ancestors (N,) with free rotations, at most ``length``, nearest first."""
    rotates = (skeleton.dof_kinds >= FIRST_ROTATION) & ~skeleton.locked
    able = set(skeleton.dof_joints[rotates].tolist())
    chain = [above for above in path_to_root(skeleton.parents, joint)[1:] if above in able]
    return np.array(chain[:length], dtype=np.int32)


def place_jacobian(skeleton: Skeleton, pose: Pose, world: Floats, joint: int, rows: Ints) -> Floats:
    """Return d(position of a joint)/d(its ancestors' rotation DOFs ``rows``): (3, N) per radian."""
    # With the parent's linear part A, the rotation axis a in the parent's frame (after the rows
    # that are applied later) and the vector y from the rotating joint to the moved one, the column
    # of a DOF is A (a x A^-1 y), also with scales.
    columns = np.zeros((3, len(rows)))
    end = world[joint, :3, 3]
    for turning in np.unique(skeleton.dof_joints[rows]):
        parent = int(skeleton.parents[turning])
        linear = world[parent, :3, :3] if parent >= 0 else np.eye(3)
        arm = np.linalg.solve(linear, end - world[turning, :3, 3])
        axes = rotation_axes(skeleton, pose, int(turning))
        for place in np.flatnonzero(skeleton.dof_joints[rows] == turning):
            columns[:, place] = linear @ np.cross(axes[int(rows[place])], arm)
    return columns


def rotation_axes(skeleton: Skeleton, pose: Pose, joint: int) -> dict[int, Floats]:
    """Return the axis of each rotation DOF of a joint, (3,) in its parent's frame, by DOF row."""
    own = np.flatnonzero((skeleton.dof_joints == joint) & (skeleton.dof_kinds >= FIRST_ROTATION))
    after = quaternion_to_matrix(pose.rotations[joint])
    axes = {}
    for row in own[::-1]:  # the last row is applied last, so it is the outermost
        kind = int(skeleton.dof_kinds[row]) - FIRST_ROTATION
        axes[int(row)] = after[:, kind].copy()
        after = after @ axis_rotations(kind, pose.dofs[row])
    return axes


def reach(
    skeleton: Skeleton, pose: Pose, joint: int, target: Floats, length: int = 2, rounds: int = 60
) -> Reach:
    """Move a joint as near to a target (3,) as its chain allows, never farther than the pose.

    A start outside its limits is clamped first. RigError if no joint above it can rotate.
    """
    chain = chain_above(skeleton, joint, length)
    if not len(chain):
        raise RigError(f"no joint above {joint_label(skeleton, joint)} can rotate")
    rotates = (skeleton.dof_kinds >= FIRST_ROTATION) & ~skeleton.locked
    rows = np.flatnonzero(rotates & np.isin(skeleton.dof_joints, chain)).astype(np.int32)
    return _Solver(skeleton, pose.copy(), joint, np.asarray(target, float), rows).solve(rounds)


class _Solver:
    """State of one reach: the pose, and the current damping."""

    def __init__(
        self, skeleton: Skeleton, pose: Pose, joint: int, target: Floats, rows: Ints
    ) -> None:
        self.skeleton, self.pose, self.joint = skeleton, pose, joint
        self.target, self.rows = target, rows
        self.low, self.high = skeleton.dof_limits[rows].T
        pose.dofs[rows] = np.clip(pose.dofs[rows], self.low, self.high)
        self.world = world_matrices(skeleton, pose)
        joints = np.append(skeleton.dof_joints[rows], joint)
        places = self.world[joints, :3, 3]
        self.size = float(np.linalg.norm(places - places[-1], axis=1).max()) or 1.0
        self.damping = 0.05

    def solve(self, rounds: int) -> Reach:
        """Iterate until the joint reaches the target or cannot come closer."""
        has_bent = False
        for _ in range(rounds):
            error = self._error()
            if np.linalg.norm(error) <= _CLOSE * self.size:
                break
            if self._improve(error):
                continue
            if has_bent or not self._bend(error):
                break
            has_bent = True
        dofs = self.pose.dofs[self.rows]
        at_limit = (dofs <= self.low) | (dofs >= self.high)
        distance = float(np.linalg.norm(self._error()))
        return Reach(self.pose.dofs, distance, self.rows[at_limit])

    def _error(self) -> Floats:
        return self.target - self.world[self.joint, :3, 3]

    def _improve(self, error: Floats) -> bool:
        """Take one step that reduces the error; return whether one was found."""
        jacobian = place_jacobian(self.skeleton, self.pose, self.world, self.joint, self.rows)
        start = self.pose.dofs[self.rows].copy()
        distance = np.linalg.norm(error)
        while self.damping <= _MOST_DAMPING:
            step = self._step(jacobian, error, start)
            if np.abs(step).max() < _STILL:
                break
            self._put(start + step)
            if np.linalg.norm(self._error()) < distance:
                self.damping = max(0.3 * self.damping, _LEAST_DAMPING)
                return True
            self.damping *= 4.0
        self._put(start)
        self.damping = 0.05
        return False

    def _step(self, jacobian: Floats, error: Floats, start: Floats) -> Floats:
        """Return the damped step; DOFs that reach a limit stop there, and the others continue."""
        step = np.zeros(len(start))
        free: Bools = np.ones(len(start), dtype=bool)
        damp = (self.damping * self.size) ** 2 * np.eye(3)
        for _ in range(len(start)):
            # DOFs stopped at a limit move by a known amount; the step is solved for the other DOFs.
            part = jacobian[:, free]
            left = error - jacobian[:, ~free] @ step[~free]
            step[free] = part.T @ np.linalg.solve(part @ part.T + damp, left)
            step[free] *= min(1.0, _LARGEST_STEP / max(np.abs(step[free]).max(initial=0), 1e-300))
            bounded = np.clip(start + step, self.low, self.high) - start
            stopped = free & (bounded != step) & (np.abs(bounded - step) > _STILL)
            if not stopped.any():
                return bounded
            step[stopped] = bounded[stopped]
            free &= ~stopped
            if not free.any():
                break
        return np.clip(start + step, self.low, self.high) - start

    def _bend(self, error: Floats) -> bool:
        """Bend a chain that is collinear with its target, which no small rotation brings nearer."""
        # Each DOF bends in the direction with more room to its limits. The bend counts after which
        # a few steps come nearest to the target.
        start, damping = self.pose.dofs[self.rows].copy(), self.damping
        best, nearest = None, float(np.linalg.norm(error))
        for place in range(len(start)):
            room = self.high[place] - start[place] >= start[place] - self.low[place]
            bent = start.copy()
            bent[place] += _BEND if room else -_BEND
            self._put(np.clip(bent, self.low, self.high))
            for _ in range(4):
                if not self._improve(self._error()):
                    break
            distance = float(np.linalg.norm(self._error()))
            if distance < nearest * (1.0 - 1e-6):
                best, nearest = self.pose.dofs[self.rows].copy(), distance
            self.damping = damping
        self._put(start if best is None else best)
        return best is not None

    def _put(self, values: Floats) -> None:
        self.pose.dofs[self.rows] = values
        self.world = world_matrices(self.skeleton, self.pose)
