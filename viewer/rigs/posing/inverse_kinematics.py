"""Inverse kinematics: joint angles that move a joint to a target position, within the limits.

Damped least squares (Wampler 1986; Nakamura and Hanafusa 1986): with the error e from the joint
to its target and the Jacobian J of the joint's position with respect to the chain's rotation DOFs,

    step = G^-1 J^T (J G^-1 J^T + lambda^2 I)^-1 e

G measures a change of the DOFs by the rotation of the joints that it makes. Without it, angles
about nearly parallel axes would count as much as others, and a ball joint near gimbal lock would
twist to keep its angles small (with G = I, 7 times the shortest rotation at 70 degrees).
A step that does not reduce the error is rejected and the damping increased (Levenberg 1944). DOFs
that a step would move beyond a limit stop there, and the others compensate.

A drag (``Reaching``) begins each solution at the last one. Where the joint follows its target, that
is the smallest rotation from pose to pose. Where it cannot, because of limits or length, the pose
may have to swing to another side of what the limits forbid: then the rotation is bounded by the
movement of the target, and goes on while the target rests.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.rotation import axis_rotations, nearest_angles, quaternion_to_matrix
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.hierarchy import path_to_root
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.pose import Pose
from viewer.rigs.skeleton import FIRST_ROTATION, Skeleton, joint_label

_CLOSE = 1e-7  # error below which the target is reached, as a fraction of the chain's length
_STILL = 1e-10  # step in radians below which the search ends
_LARGEST_STEP = 0.5  # maximum step in radians for which the linearisation is accurate
_BEND = 0.02  # angle in radians by which a straight chain is bent out of a singular pose
_SADDLE = 1e-4  # curvature below which a bend brings the joint nearer, of the chain's length^2
_LEAST_DAMPING, _FIRST_DAMPING, _MOST_DAMPING = 1e-4, 0.05, 1e3  # of the chain's length
_IDENTITY = np.eye(4)
_APART = 1e-5  # step in radians of differences; their error is about its square
# Added to the squared rotation for a change of each DOF: in gimbal lock two DOFs can cancel each
# other without limit.
_ASIDE = 0.02

# Limits of a drag. Rotation for movement is in radians for each chain's length that the target
# moves: 5 degrees a centimetre for an arm of half a metre. A target that the joint follows may need
# more: the elbow of such an arm bends by 5 degrees a centimetre at 54 degrees, and faster without
# limit the straighter it is.
_RATE = np.radians(5.0) * 50.0
_MOST_NEEDED = 3.0  # what a target that is followed may need, relative to _RATE
_RETURN = 0.05  # rotation towards the pose at the start that leaves the joint in place, of _RATE
# Rotation away from a limit that leaves the joint in place, of _RATE, and the distance to the limit
# from which it starts. It is several times _RETURN, so that the start does not hold DOFs at limits.
_AVOID, _ROOM = 0.3, np.radians(25.0)
_GLIDE = np.radians(4.0)  # rotation towards a target that rests, per call
_MARGIN = 1.25  # of what a step needs, which is known by its linearisation
# Maximum steps per call towards the target and in a search for another pose, rejected ones
# included, and rounds to shorten the rotation: they bound the time of a frame.
_DRAG_STEPS, _SEARCH_STEPS, _SHORTENING_ROUNDS = 8, 3, 4
_SLOW = 1e-3  # relative decrease of the error below which a drag has settled
# Distance to the target from which a joint may be held by limits or a straight chain, and movement
# of the target after which other poses are tried again, of the chain's length.
_MISSED, _RETRY = 1e-4, 0.01
# Range at full length in which the joint lags behind its target, so that it is never straight, of
# the chain's length. A target within reach is missed by at most 1 / e of it.
_SOFT = 0.0025


@dataclass(frozen=True, slots=True, eq=False)
class Reach:
    """Result of a reach for a target."""

    dofs: Floats
    """(D,). DOFs of the whole skeleton; only rotations of the chain have changed."""
    distance: float
    """Remaining distance between the joint and its target, figure units."""
    limited: Ints
    """(N,) int32. DOFs of the chain that are at one of their limits."""
    is_settled: bool = True
    """Whether the joint is as near as it comes; otherwise it goes on if asked again."""


def chain_above(skeleton: Skeleton, joint: int, length: int) -> Ints:
    """Return the nearest ancestors (N,) with free rotations, at most ``length``, nearest first."""
    rotates = (skeleton.dof_kinds >= FIRST_ROTATION) & ~skeleton.locked
    able = set(skeleton.dof_joints[rotates].tolist())
    chain = [above for above in path_to_root(skeleton.parents, joint)[1:] if above in able]
    return np.array(chain[:length], dtype=np.int32)


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


class Position(Protocol):
    """Position of a joint as a function of the rotation DOFs above it."""

    def at(self, values: Floats) -> tuple[Floats, Floats]:
        """Return the position (3,) at DOFs (N,), and its derivatives (3, N) per radian."""
        ...

    def curvature(self, values: Floats, along: Floats) -> Floats:
        """Return the second derivatives (N, N) of the position along a vector (3,)."""
        ...


class ChainPosition:
    """Position of a joint below a chain of joints that rotate about their axes."""

    # The position is p = B_0 R_0 B_1 R_1 ... B_n, with the rotations R_i about coordinate axes k_i,
    # outermost first, and constant affine maps B_i between them, which contain rest transforms,
    # scales, and DOFs that stay. With P_i = B_0 R_0 ... B_i and the vector v_i = R_i B_(i+1) ...
    # from there to the joint, dp/dq_i = P_i (k_i x v_i), in which P_i is its linear part.

    def __init__(self, skeleton: Skeleton, pose: Pose, joint: int, rows: Ints) -> None:
        chosen, order = set(rows.tolist()), []
        path = path_to_root(skeleton.parents, joint)[::-1]
        first = path.index(int(skeleton.dof_joints[rows].min()))
        above = int(skeleton.parents[path[first]])
        linear, offset = np.eye(3), np.zeros(3)
        if above >= 0:
            world = world_matrices(skeleton, pose)[above]
            linear, offset = world[:3, :3], world[:3, 3]
        maps = []
        for each in path[first:]:
            own = np.flatnonzero(skeleton.dof_joints == each)
            place = skeleton.rest_translations[each] + pose.translations[each]
            for row in own[skeleton.dof_kinds[own] < FIRST_ROTATION]:
                place[skeleton.dof_kinds[row]] += pose.dofs[row]
            offset = offset + linear @ place
            linear = linear @ quaternion_to_matrix(pose.rotations[each])
            for row in own[skeleton.dof_kinds[own] >= FIRST_ROTATION][::-1].tolist():
                if row in chosen:
                    maps.append((linear, offset))
                    order.append(row)
                    linear, offset = np.eye(3), np.zeros(3)
                else:
                    kind = int(skeleton.dof_kinds[row]) - FIRST_ROTATION
                    linear = linear @ axis_rotations(kind, pose.dofs[row])
            linear = linear * pose.scales[each]
        self._end = np.append(offset, 1.0)
        self._maps = np.tile(np.eye(4), (len(maps), 1, 1))
        self._maps[:, :3, :3] = [pair[0] for pair in maps]
        self._maps[:, :3, 3] = [pair[1] for pair in maps]
        self._order = np.searchsorted(rows, order)
        # K v = k x v, and R = I + sin K + (1 - cos) K^2 (Rodrigues), as 4 x 4 matrices.
        axes = np.eye(3)[skeleton.dof_kinds[order] - FIRST_ROTATION]
        self._cross = np.zeros_like(self._maps)
        self._cross[:, :3, :3] = np.cross(axes[:, None], np.eye(3)).swapaxes(1, 2)
        self._square = self._cross @ self._cross

    def at(self, values: Floats) -> tuple[Floats, Floats]:
        """Return the position (3,) at DOFs (N,), and its derivatives (3, N) per radian."""
        end, _, columns = self._links(values)
        jacobian = np.empty((3, len(columns)))
        jacobian[:, self._order] = columns.T
        return end, jacobian

    def curvature(self, values: Floats, along: Floats) -> Floats:
        """Return the second derivatives (N, N) of the position along a vector (3,)."""
        # With dp/dq_j = P_i w for every rotation j at or inside of i, and dP_i/dq_i = P_i K_i,
        # d^2p/dq_i dq_j = P_i K_i w = P_i K_i P_i^-1 dp/dq_j.
        _, steps, columns = self._links(values)
        outer = steps[:, :3, :3]
        turned = outer @ self._cross[:, :3, :3] @ np.linalg.pinv(outer)
        upper = np.triu(np.einsum("iab,a,jb->ij", turned, along, columns))
        found = np.empty_like(upper)
        found[np.ix_(self._order, self._order)] = upper + np.triu(upper, 1).T
        return found

    def _links(self, values: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the position (3,), the maps P_i, (N, 4, 4), and the derivatives dp/dq_i, (N, 3).

        The last two are in the order of the chain, from the outside.
        """
        angles = values[self._order, None, None]
        turns = _IDENTITY + np.sin(angles) * self._cross + (1.0 - np.cos(angles)) * self._square
        # From the inside, B_i R_i ... B_n, and from the outside, P_i. The loops run in every step
        # of a drag: ``dot`` takes a third of the time that ``@`` takes for matrices this small.
        links = self._maps @ turns
        ends = [self._end]
        for link in links[::-1]:
            ends.append(link.dot(ends[-1]))
        steps = [self._maps[0]]
        for step in turns[:-1] @ self._maps[1:]:
            steps.append(steps[-1].dot(step))
        vectors = turns @ np.array(ends[-2::-1])[:, :, None]
        every = np.array(steps)
        columns = every @ (self._cross @ vectors)
        return ends[-1][:3], every, columns[:, :3, 0]


class FigurePosition:
    """Position of a joint of any skeleton: rules of a body model, constraints of joints above."""

    def __init__(self, skeleton: Skeleton, pose: Pose, joint: int, rows: Ints) -> None:
        self._skeleton, self._pose, self._joint, self._rows = skeleton, pose.copy(), joint, rows

    def at(self, values: Floats) -> tuple[Floats, Floats]:
        """Return the position (3,) at DOFs (N,), and its derivatives (3, N), by differences."""
        moved = [self._place(values + each) for each in _APART * np.eye(len(values))]
        back = [self._place(values - each) for each in _APART * np.eye(len(values))]
        return self._place(values), (np.array(moved) - back).T / (2.0 * _APART)

    def curvature(self, values: Floats, along: Floats) -> Floats:
        """Return the second derivatives (N, N) along a vector (3,), by differences."""
        here = self.at(values)[1]
        change = [self.at(values + each)[1] - here for each in _APART * np.eye(len(values))]
        return np.einsum("a,iaj->ij", along, change) / _APART

    def _place(self, values: Floats) -> Floats:
        self._pose.dofs[self._rows] = values
        return world_matrices(self._skeleton, self._pose)[self._joint, :3, 3]


def position_of(skeleton: Skeleton, pose: Pose, joint: int, rows: Ints) -> Position:
    """Return the position of a joint as a function of the rotation DOFs ``rows`` above it."""
    constrained = {each.joint for each in skeleton.constraints}
    is_plain = skeleton.posing is None and constrained.isdisjoint(
        path_to_root(skeleton.parents, joint)
    )
    kind = ChainPosition if is_plain else FigurePosition
    return kind(skeleton, pose, joint, rows)


class Reaching:
    """A joint that reaches for targets, each from the pose in which it reached for the last one.

    RigError if no joint above it can rotate.
    """

    def __init__(self, skeleton: Skeleton, pose: Pose, joint: int, length: int = 2) -> None:
        chain = chain_above(skeleton, joint, length)
        if not len(chain):
            raise RigError(f"no joint above {joint_label(skeleton, joint)} can rotate")
        rotates = (skeleton.dof_kinds >= FIRST_ROTATION) & ~skeleton.locked
        self._rows = np.flatnonzero(rotates & np.isin(skeleton.dof_joints, chain)).astype(np.int32)
        # Full turns change nothing, except in rules that make rotations of several DOFs.
        self._has_turns = skeleton.posing is None
        start = pose.copy()
        self._dofs = start.dofs
        self._kinds = skeleton.dof_kinds[self._rows] - FIRST_ROTATION
        self._axes = np.eye(3)[self._kinds]
        self._cross = np.cross(self._axes[:, None], np.eye(3)).swapaxes(1, 2)
        self._square = self._cross @ self._cross
        self._of_joint = np.unique(skeleton.dof_joints[self._rows], return_inverse=True)[1]
        self._is_same_joint = self._of_joint[:, None] == self._of_joint
        self._low, self._high = skeleton.dof_limits[self._rows].T
        # DOFs with a range below twice _ROOM are at ease in its middle.
        room = np.minimum(_ROOM, 0.5 * (self._high - self._low))
        self._inner_low, self._inner_high = self._low + room, self._high - room
        self._dofs[self._rows] = np.clip(self._dofs[self._rows], self._low, self._high)
        position = position_of(skeleton, start, joint, self._rows)
        self._first = _State(position, self._dofs[self._rows])
        self._goal = self._first
        pivots = world_matrices(skeleton, start)[[joint, *chain], :3, 3]
        # The chain cannot be longer than the distances between its joints.
        self._base = pivots[-1]
        self._size = float(np.linalg.norm(np.diff(pivots, axis=0), axis=1).sum()) or 1.0
        # The first target is the joint itself: the range ends there, so that the drag begins in
        # the pose that it finds.
        room = self._size - float(np.linalg.norm(self._first.place - self._base))
        self._soft = float(np.clip(room, 0.0, _SOFT * self._size))
        self._target = self._wanted = self._first.place
        self._damping = _FIRST_DAMPING
        self._metric: Floats
        self._inverse: Floats | None  # none in searches: all angles count as much
        self._metric, self._inverse = self._measured()
        self._other: _State | None = None  # from the start, searched for a nearer pose
        self._since_held = np.inf  # movement of the target since, of the chain's length

    def follow(self, target: Floats) -> Reach:
        """Rotate the chain towards a target (3,), at most as far as the target's movement needs."""
        target = np.asarray(target, dtype=np.float64)
        wanted = self._within(target, self._soft)
        moved = float(np.linalg.norm(target - self._target)) / self._size
        self._metric, inverse = self._measured()
        self._inverse = inverse
        most = _GLIDE
        if moved > 0.0:
            needed = self._step(self._goal, wanted - self._wanted, _LEAST_DAMPING)
            needs = self._turn(needed) / (_RATE * moved)
            most = _RATE * moved * min(max(1.0, _MARGIN * needs), _MOST_NEEDED)
        self._target, self._wanted = target, wanted
        goal = self._eased(self._goal, _RATE * moved, inverse)
        goal, is_settled = self._nearest(goal, _DRAG_STEPS, _SLOW)
        if moved > 0.0:
            goal = self._shortened(goal, self._goal.values, _RATE * moved)
        self._since_held += moved
        is_held = is_settled and self._left(goal) > _MISSED * self._size
        if is_held:  # the search leads far from the pose in which the rotations were measured
            self._inverse = None
        if is_held and self._other is not None:
            goal, is_settled = self._freed(goal, self._other)
        elif is_held and self._since_held >= _RETRY:
            self._since_held = 0.0
            bent = self._bent(goal)
            self._other = self._first if bent is None else None
            goal, is_settled = (goal, is_settled) if bent is None else (bent, False)
        elif is_settled:  # at the target
            self._other = None
        self._goal = goal
        is_settled &= self._other is None
        return self._shown(most, is_settled)

    def _shortened(self, state: _State, start: Floats, most: float) -> _State:
        """Return a state at the same place with a shorter rotation from the start (N,).

        Only if that is above ``most``.
        """
        # The steps towards a target are shortest one by one. A DOF that one of them stops at its
        # limit is replaced by others at once, even if it would suffice in the end. Here the sum of
        # the steps is the shortest: each minimises the rotation from the start among the DOFs that
        # reach the target by the linearisation here (sequential quadratic programming).
        for _ in range(_SHORTENING_ROUNDS):
            back = start - state.values
            turn = self._turn(back)
            if turn <= most:
                break
            for part in (1.0, 0.4):
                shorter = self._placed(self._placed(state, part * back))
                is_there = self._left(shorter) <= max(self._left(state), _MISSED * self._size)
                if is_there and self._turn(shorter.values - start) < 0.98 * turn:
                    break
            else:
                break
            state = shorter
        return state

    def _placed(self, state: _State, wish: Floats | None = None) -> _State:
        """Return the state after one undamped step to the target that is nearest to a wish."""
        error = self._wanted - state.place
        return state.at(state.values + self._step(state, error, _LEAST_DAMPING, wish))

    def _shown(self, most: float, is_settled: bool) -> Reach:
        """Rotate each joint of the shown pose towards the goal, by at most ``most``."""
        # The goal may be on the other side of what the limits forbid. If possible, the joint stays
        # at the target on the way there.
        shown = self._dofs[self._rows]
        way = self._goal.values - shown
        part = most / max(self._turn(way), 1e-300)
        if part >= 1.0:
            return self._result(self._goal, is_settled)
        direct = self._goal.at(shown + part * way)
        step = self._step(direct, self._wanted - direct.place, _FIRST_DAMPING)
        turned = direct.values + step - shown
        near = self._goal.at(shown + turned * min(1.0, most / max(self._turn(turned), 1e-300)))
        come = np.linalg.norm(way) - np.linalg.norm(self._goal.values - near.values)
        is_on_way = come > 0.5 * part * np.linalg.norm(way)
        is_better = is_on_way and self._left(near) < self._left(direct)
        return self._result(near if is_better else direct, False)

    def _within(self, target: Floats, soft: float) -> Floats:
        """Return a target (3,) moved to where the chain can reach it, on the line to its base."""
        # Soft IK: beyond d_0 = L - s the distance d becomes d_0 + s (1 - exp(-(d - d_0) / s)),
        # which continues with slope 1 and approaches the length L. For s = 0 it ends at L.
        away = target - self._base
        distance = float(np.linalg.norm(away))
        nearest = self._size - soft
        if distance <= nearest:
            return target
        if soft > 0.0:
            nearest += soft * (1.0 - float(np.exp(-(distance - nearest) / soft)))
        return self._base + nearest * unit(away)

    def _measured(self) -> tuple[Floats, Floats]:
        """Return G (N, N), and its inverse: a change d of the DOFs rotates by sqrt(d^T G d)."""
        angles = self._dofs[self._rows][:, None, None]
        turns = np.sin(angles) * self._cross + (1.0 - np.cos(angles)) * self._square
        turns += _IDENTITY[:3, :3]
        axes, after = self._axes.copy(), _IDENTITY[:3, :3]
        for row in range(len(axes) - 1, -1, -1):
            # Where the next joint begins, ``after`` rotates all axes of it, which changes no angle.
            axes[row] = after[:, self._kinds[row]]
            after = after.dot(turns[row])
        metric = axes @ axes.T * self._is_same_joint + _ASIDE * np.eye(len(axes))
        return metric, np.linalg.inv(metric)

    def _turn(self, change: Floats) -> float:
        """Return the largest rotation of a joint for a change of the DOFs (N,)."""
        squares = np.bincount(self._of_joint, change * (self._metric @ change))
        return math.sqrt(float(squares.max()))

    def _result(self, state: _State, is_settled: bool) -> Reach:
        self._dofs[self._rows] = state.values
        at_limit = (state.values <= self._low) | (state.values >= self._high)
        distance = math.dist(self._target, state.place)
        return Reach(self._unwound(), distance, self._rows[at_limit], is_settled)

    def _unwound(self) -> Floats:
        """Return DOFs (D,) of the same pose without full turns since the start.

        Steps past gimbal lock, and a target that circles, add turns without limit. Keys of such
        DOFs would spin the joint.
        """
        dofs, values = self._dofs.copy(), self._dofs[self._rows]
        if self._has_turns:
            near = nearest_angles(values, self._first.values)
            is_inside = (near >= self._low) & (near <= self._high)
            dofs[self._rows] = np.where(is_inside, near, values)
        return dofs

    def _left(self, state: _State) -> float:
        """Return the distance to the target that is solved for."""
        return math.dist(self._wanted, state.place)

    def _nearest(self, state: _State, steps: int, slow: float) -> tuple[_State, bool]:
        """Return the state whose joint is nearest to the target, and whether the search ended.

        It also ends where the distance decreases by less than ``slow`` of itself.
        """
        while steps > 0:
            distance = self._left(state)
            if distance <= _CLOSE * self._size:
                return state, True
            better, steps = self._improved(state, slow, steps)
            if better is None:
                return state, steps > 0
            state = better
            if distance - self._left(state) < slow * distance:
                return state, True
        return state, False

    def _improved(self, state: _State, slow: float, steps: int) -> tuple[_State | None, int]:
        """Return the state after one step that reduces the error, and the number of steps left.

        None if there is no such step, or if no steps are left: another call may find one.
        """
        error, distance = self._wanted - state.place, self._left(state)
        while self._damping <= _MOST_DAMPING:
            if not steps:
                return None, 0  # the next call goes on with this damping
            step = self._step(state, error, self._damping)
            promised = float(error @ (state.jacobian @ step))
            if np.abs(step).max() < _STILL or promised < slow * distance**2:
                break
            better = state.at(state.values + step)
            steps -= 1
            if self._left(better) < distance:
                self._damping = max(0.3 * self._damping, _LEAST_DAMPING)
                return better, steps
            self._damping *= 4.0
        self._damping = _FIRST_DAMPING
        return None, max(steps, 1)

    def _step(
        self, state: _State, error: Floats, damping: float, wish: Floats | None = None
    ) -> Floats:
        """Return the damped step nearest to a wish (N,), or to none; DOFs stop at their limits."""
        start, jacobian = state.values, state.jacobian
        lowest, highest = self._low - start, self._high - start
        # DOFs stopped at a limit move by a known amount; the step is solved for the other DOFs,
        # those whose rows of G^-1 J^T are not 0.
        known = np.zeros(len(start)) if wish is None else wish.copy()
        damp = (damping * self._size) ** 2 * _IDENTITY[:3, :3]
        inverse = self._inverse
        eased = jacobian.T.copy() if inverse is None else inverse @ jacobian.T
        free: Bools = np.ones(len(start), dtype=bool)
        while True:
            left = error - jacobian @ known
            step = known + eased @ np.linalg.solve(jacobian @ eased + damp, left)
            if np.abs(step).max() > _LARGEST_STEP:
                step[free] *= min(1.0, _LARGEST_STEP / float(np.abs(step[free]).max()))
            bounded = np.minimum(np.maximum(step, lowest), highest)
            stopped = np.flatnonzero(np.abs(bounded - step) > _STILL)
            if not len(stopped):
                return bounded
            for row in stopped:
                # The inverse of the metric of the DOFs that are left, by their Schur complement.
                if inverse is not None:
                    column = inverse[:, row] / inverse[row, row]
                    eased -= column[:, None] * eased[row]
                    inverse = inverse - column[:, None] * inverse[row]
                eased[row] = 0.0
            known[stopped] = bounded[stopped]
            free[stopped] = False

    def _eased(self, state: _State, most: float, inverse: Floats) -> _State:
        """Return a state nearer to the start, and away from limits, if the joint stays in place.

        Steps by the pseudoinverse alone end in another pose after each loop of the target (Klein
        and Huang 1983), so that a limb would twist during long drags. They also press DOFs against
        limits one by one, until none is left to follow the target, though other poses could.
        """
        # Downhill in the squared difference of DOFs, in the metric of the rotations.
        values = state.values
        downhill = inverse @ (self._first.values - values) / inverse.diagonal().max()
        wish = np.clip(downhill, -_RETURN * most, _RETURN * most)
        # Downhill in the squared distance to the middle, where no limit is nearer than _ROOM.
        above, below = self._inner_low - values, values - self._inner_high
        wish += _AVOID * most / _ROOM * (np.maximum(above, 0.0) - np.maximum(below, 0.0))
        if not wish.any():
            return state
        nearer = state.at(values + self._step(state, np.zeros(3), self._damping, wish))
        is_in_place = math.dist(nearer.place, state.place) <= _MISSED * self._size
        return nearer if is_in_place or self._left(nearer) <= self._left(state) else state

    def _freed(self, state: _State, other: _State) -> tuple[_State, bool]:
        """Return another state if it is nearer than one that is held, and whether it is settled."""
        # The search goes on in the next call, so that none takes long.
        least = self._left(state) - _RETRY * self._size
        other, is_settled = self._nearest(other, _SEARCH_STEPS, _SLOW)
        is_nearer = self._left(other) < least
        self._other = None if is_nearer or is_settled or least <= 0.0 else other
        return (other, is_settled) if is_nearer else (state, True)

    def _bent(self, state: _State) -> _State | None:
        """Return a state nearer than one that no small rotation improves, such as a straight one.

        None if there is none.
        """
        if self._left(state) <= _CLOSE * self._size:
            return None
        # The gradient of |e|^2 / 2, -J^T e, is zero there, up to DOFs pressed against limits. The
        # chain can still come nearer if the second derivative, H = J^T J - e . d^2p/dq^2, is
        # negative along a direction: an eigenvector with a negative eigenvalue.
        error, values = self._wanted - state.place, state.values
        push = error @ state.jacobian
        is_held = (values <= self._low) & (push < 0.0) | (values >= self._high) & (push > 0.0)
        rows = np.flatnonzero(~is_held)
        if not len(rows):
            return None
        part, distance = state.jacobian[:, rows], self._left(state)
        second = state.position.curvature(values, error)[np.ix_(rows, rows)]
        curvature = part.T @ part - second
        sizes, vectors = np.linalg.eigh(curvature)
        for vector in vectors.T[sizes < -_SADDLE * self._size**2]:
            for bend in (_BEND, -_BEND):
                moved = values.copy()
                moved[rows] += bend * vector
                better: _State | None = state.at(np.clip(moved, self._low, self._high))
                for _ in range(4):
                    if better is None:
                        break
                    if self._left(better) < distance * (1.0 - 1e-6):
                        return better
                    better, _ = self._improved(better, 0.0, _DRAG_STEPS)
        return None


class _State:
    """Rotation DOFs (N,) of a chain, with the joint's position (3,) and derivatives (3, N)."""

    def __init__(self, position: Position, values: Floats) -> None:
        self.position, self.values = position, values
        self.place, self.jacobian = position.at(values)

    def at(self, values: Floats) -> _State:
        """Return the state at other DOFs."""
        return _State(self.position, values)
