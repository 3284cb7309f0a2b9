"""Simulation of spring joints by Verlet integration in equal steps, and its playback.

A ``SpringTrack`` simulates a motion once and in order: from rest at its start, in equal steps, so
that the result at a given time does not depend on what was played previously. Between two steps,
rotations are interpolated. A ``SpringMotion`` makes an actor's pose and baked frames follow its
tracks.

With the position c of the point now and p one step before, the head h and rest direction a of
the joint in its posed parent, and a step of t seconds, a step computes ::

    n = c + (1 - drag) (c - p) + t (stiffness a + gravity)
    n = h + length (n - h) / |n - h|

and then moves n out of each collider along the shortest path and restores its length. The joint's
rotation is the smallest one that points it at n. Inertia, the first two terms, is evaluated in the
space of the joint's centre. Joints are updated from the root to the tips, after the joints that
carry their colliders.

Source: ``VRMC_springBone`` 1.0, github.com/vrm-c/vrm-specification.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.quaternion import between, multiply, slerp
from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.geometry.transform import affine_matrices
from viewer.rigs.geometry.vectors import axis_vector, inverse_transposed, unit
from viewer.rigs.motion.evaluation import JointMotion, frames_of, rest_translations_of, world_frames
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing, frame_times
from viewer.rigs.pose import Pose, PoseKey, pose_key, set_joint_rotations
from viewer.rigs.scene import Actor, still_pose
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.springs.spring_joints import INSIDE, PLANE, Springs

STEPS_PER_SECOND = 60
"""Simulation steps per second; the result depends on this rate, as in other programs."""
_STEP = 1.0 / STEPS_PER_SECOND
_SHORT = 1e-12
_FLAT = 1e-30  # determinant below which a matrix is treated as singular
_BLOCK = 64  # number of steps that are computed and cached together
_MOST_BLOCKS = 256  # maximum number of cached blocks; others are recomputed from their stored start
_ON_STEP = 1e-6  # tolerance, as a fraction of a step, for times that are treated as that step


@dataclass(frozen=True, slots=True, eq=False)
class Tails:
    """The swinging points, each in the space of its centre: (N, 3) now and one step before."""

    now: Floats
    before: Floats


@dataclass(frozen=True, slots=True, eq=False)
class _Level:
    """Joints that depend on those of the previous levels only."""

    joints: Ints  # (L,)
    parents: Ints  # (L,), -1 for a root
    rows: Ints  # (N',), the spring joints among them
    places: Ints  # (N',), their positions in joints
    hits: tuple[tuple[Ints, Ints], ...]  # positions in rows and colliders, one collider at a time


class Simulation:
    """Evaluator of the spring joints of one skeleton."""

    def __init__(self, skeleton: Skeleton) -> None:
        if skeleton.springs is None:
            raise ValueError("expected a skeleton with springs")
        self._springs: Springs = skeleton.springs
        rests = skeleton.rest_rotations[self._springs.joints]
        self._rests = rests / np.linalg.norm(rests, axis=-1, keepdims=True)
        self._linear = quaternion_to_matrix(self._rests)
        self._axes = unit(self._springs.tails)
        self._levels = _levels(skeleton, self._springs)

    @property
    def rests(self) -> Floats:
        """Rotations of the spring joints at rest: (N, 4)."""
        return self._rests

    def start(self, world: Floats, local: Floats, scales: Floats, place: Floats) -> Tails:
        """Return points at rest, with spring joints in rest pose; arguments as for ``step``."""
        springs, world = self._springs, world.copy()
        points = np.zeros((springs.n_joints, 3))
        for level in self._levels:
            heads = self._heads(level, world, local, place)
            rows = level.rows
            tails = springs.tails[rows] * scales[springs.joints[rows]]
            points[rows] = _points(heads[level.places], tails)
            world[level.joints] = _scaled(heads, scales[level.joints])
        points = _points(_inverse(self._centers(world)), points)
        return Tails(points, points)

    def step(
        self, tails: Tails, world: Floats, local: Floats, scales: Floats, place: Floats
    ) -> tuple[Tails, Floats]:
        """Return the points after a step, and the spring joints' rotations in parents (N, 4).

        ``world``, ``local`` (J, 4, 4): the pose at the end of the step, without springs; local ones
        without ``scales`` (J, 3). ``place`` (4, 4): of the whole figure.
        """
        springs, world = self._springs, world.copy()
        now = np.empty_like(tails.now)
        rotations = np.empty((springs.n_joints, 4))
        for level in self._levels:
            heads = self._heads(level, world, local, place)
            rows, at = level.rows, level.places
            if len(rows):
                factors = scales[springs.joints[rows]]
                points = self._moved(level, tails, world, heads[at], factors)
                arcs = self._arcs(rows, heads[at], points, factors)
                rotations[rows] = multiply(self._rests[rows], arcs)
                heads[at, :3, :3] = heads[at, :3, :3] @ quaternion_to_matrix(arcs)
                centers = self._centers(world, rows)
                now[rows] = _points(_inverse(centers), points)
            world[level.joints] = _scaled(heads, scales[level.joints])
        return Tails(now, tails.now), rotations

    def _heads(self, level: _Level, world: Floats, local: Floats, place: Floats) -> Floats:
        """Return world matrices without the joints' own scales, spring joints in rest rotation."""
        own = local[level.joints]
        own[level.places, :3, :3] = self._linear[level.rows]
        above = np.where((level.parents >= 0)[:, None, None], world[level.parents], place)
        found: Floats = above @ own
        return found

    def _centers(self, world: Floats, rows: Ints | None = None) -> Floats:
        """Return the matrices from center space to figure space: (N, 4, 4)."""
        centers = self._springs.centers if rows is None else self._springs.centers[rows]
        found: Floats = np.where((centers >= 0)[:, None, None], world[centers], np.eye(4))
        return found

    def _moved(
        self, level: _Level, tails: Tails, world: Floats, heads: Floats, factors: Floats
    ) -> Floats:
        """Return the points of one level in figure space after one step: (N', 3)."""
        springs, rows = self._springs, level.rows
        origins = heads[:, :3, 3]
        rest = np.einsum("nab,nb->na", heads[:, :3, :3], springs.tails[rows] * factors)
        lengths = np.linalg.norm(rest, axis=-1, keepdims=True)
        speed = (tails.now[rows] - tails.before[rows]) * (1.0 - springs.drags[rows, None])
        points = _points(self._centers(world, rows), tails.now[rows] + speed)
        points = points + _STEP * springs.stiffness[rows, None] * unit(rest)
        points = points + _STEP * springs.gravities[rows]
        points = _at_length(points, origins, lengths, rest)
        for chosen, which in level.hits:
            moved, is_inside = self._pushed(points[chosen], rows[chosen], which, world)
            held = _at_length(moved, origins[chosen], lengths[chosen], rest[chosen])
            points[chosen] = np.where(is_inside[:, None], held, points[chosen])
        return points

    def _pushed(
        self, points: Floats, rows: Ints, which: Ints, world: Floats
    ) -> tuple[Floats, Bools]:
        """Return points moved to the surface of one collider each, and which were beyond it."""
        shapes = self._springs.colliders
        matrices = world[shapes.joints[which]]
        start = _points(matrices, shapes.offsets[which])
        along = _points(matrices, shapes.tails[which]) - start
        delta, kinds = points - start, shapes.kinds[which]
        # A normal stays perpendicular to its scaled plane only by the inverse transpose.
        own_normals = shapes.tails[which] - shapes.offsets[which]
        linear = np.moveaxis(matrices[:, :3, :3], 0, -1)
        normals = unit(inverse_transposed(linear, own_normals))
        heights = np.einsum("na,na->n", normals, delta)
        square = np.einsum("na,na->n", along, along)
        fraction = np.einsum("na,na->n", along, delta) / np.maximum(square, _SHORT)
        delta = delta - np.clip(fraction, 0.0, 1.0)[:, None] * along
        own, reach = self._springs.radii[rows], np.linalg.norm(delta, axis=-1)
        # Within a hollow shape, the point is moved towards the axis.
        signs = np.where(kinds == INSIDE, -1.0, 1.0)
        distance = signs * (reach - shapes.radii[which]) - own
        directions = signs[:, None] * unit(delta)
        is_plane = kinds == PLANE
        distance = np.where(is_plane, heights - own, distance)
        directions = np.where(is_plane[:, None], normals, directions)
        return points - directions * distance[:, None], distance < 0.0

    def _arcs(self, rows: Ints, heads: Floats, points: Floats, factors: Floats) -> Floats:
        """Return the smallest rotations from the rest directions to the points: (N', 4)."""
        away = (points - heads[:, :3, 3])[..., None]
        local = np.linalg.solve(_regular(heads[:, :3, :3]), away)[..., 0]
        start, end = self._axes[rows], unit(local / np.where(factors == 0.0, 1.0, factors))
        return between(start, end)


def _levels(skeleton: Skeleton, springs: Springs) -> list[_Level]:
    """Return spring joints and all below them, after their parents and colliders' joints."""
    depths = np.full(skeleton.n_joints, -1)
    is_spring = np.zeros(skeleton.n_joints, dtype=np.bool_)
    is_spring[springs.joints] = True
    needs: list[list[int]] = []
    for joint, parent in enumerate(skeleton.parents.tolist()):
        moves = parent >= 0 and depths[parent] >= 0
        depths[joint] = 0 if moves or is_spring[joint] else -1
        needs.append([parent] if moves else [])
    for joint, obstacles in zip(springs.joints.tolist(), springs.obstacles, strict=True):
        for carrier in dict.fromkeys(springs.colliders.joints[[*obstacles]].tolist()):
            if depths[carrier] >= 0 and not _depends(needs, carrier, joint):
                needs[joint].append(carrier)
    is_settled = False
    while not is_settled:
        is_settled = True
        for joint in np.flatnonzero(depths >= 0).tolist():
            depth = max((int(depths[needed]) + 1 for needed in needs[joint]), default=0)
            is_settled &= depth == depths[joint]
            depths[joint] = depth
    row_of = np.full(skeleton.n_joints, -1, dtype=np.int32)
    row_of[springs.joints] = np.arange(springs.n_joints)
    levels = []
    for depth in range(int(depths.max(initial=-1)) + 1):
        joints: Ints = np.flatnonzero(depths == depth).astype(np.int32)
        places: Ints = np.flatnonzero(is_spring[joints]).astype(np.int32)
        rows = row_of[joints[places]]
        # The first colliders of all points, then the second colliders, and so on.
        listed = [springs.obstacles[row] for row in rows]
        most = max(map(len, listed), default=0)
        pairs = []
        for rank in range(most):
            chosen = [place for place, each in enumerate(listed) if len(each) > rank]
            which = [listed[place][rank] for place in chosen]
            pairs.append((np.array(chosen, np.int32), np.array(which, np.int32)))
        hits = tuple(pairs)
        levels.append(_Level(joints, skeleton.parents[joints], rows, places, hits))
    return levels


def _depends(needs: list[list[int]], joint: int, on: int) -> bool:
    """Return whether a joint is another one, or depends on it directly or indirectly."""
    seen, stack = {joint}, [joint]
    while stack:
        fresh = [needed for needed in needs[stack.pop()] if needed not in seen]
        seen.update(fresh)
        stack += fresh
    return on in seen


def _points(matrices: Floats, points: Floats) -> Floats:
    """Return points transformed by one matrix each: (N, 3)."""
    found: Floats = np.einsum("nab,nb->na", matrices[:, :3, :3], points) + matrices[:, :3, 3]
    return found


def _inverse(matrices: Floats) -> Floats:
    regular = matrices.copy()
    regular[:, :3, :3] = _regular(matrices[:, :3, :3])
    return np.asarray(np.linalg.inv(regular), dtype=np.float64)


def _regular(linear: Floats) -> Floats:
    """Return (N, 3, 3) with singular matrices, those of joints of scale 0, as identities."""
    is_flat = np.abs(np.linalg.det(linear)) < _FLAT
    found: Floats = np.where(is_flat[:, None, None], np.eye(3), linear)
    return found


def _scaled(matrices: Floats, scales: Floats) -> Floats:
    """Return matrices with the scales of the joints applied first."""
    matrices[:, :3, :3] *= scales[:, None, :]
    return matrices


def _at_length(points: Floats, origins: Floats, lengths: Floats, rest: Floats) -> Floats:
    """Move points to a distance from their origins, in the rest direction if it is undefined."""
    away = points - origins
    distance = np.linalg.norm(away, axis=-1, keepdims=True)
    away = np.where(distance > _SHORT, away / np.maximum(distance, _SHORT), unit(rest))
    found: Floats = origins + lengths * away
    return found


@dataclass(frozen=True, slots=True, eq=False)
class PosedJoints:
    """Joints of a motion without springs at F times."""

    world: Floats
    local: Floats
    """(F, J, 4, 4). Joint-to-figure matrices, and joint-to-parent matrices without scale."""
    scales: Floats
    """(F, J, 3). Local scale factors."""
    places: Floats
    """(F, 4, 4). Placement of the whole figure, which ``world`` includes."""


_PosesAt = Callable[[Floats], PosedJoints]
"""Returns the joints at some times, in seconds."""


class SpringTrack:
    """Rotations of spring joints from ``start`` to ``end`` seconds, constant outside of these."""

    def __init__(self, skeleton: Skeleton, start: float, end: float) -> None:
        self._simulation, self._start = Simulation(skeleton), start
        self._last = int(np.ceil(max(end - start, 0.0) * STEPS_PER_SECOND - _ON_STEP))
        self._starts: list[Tails] = []
        self._blocks: dict[int, Floats] = {}

    def rotations(self, times: Floats, poses_at: _PosesAt) -> Floats:
        """Return the spring joints' rotations in parents (F, N, 4) at times (F,) of the motion."""
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

    def _block(self, block: int, poses_at: _PosesAt) -> Floats:
        """Return the rotations of one block of steps: (B, N, 4)."""
        if block not in self._blocks:
            for missing in range(min(len(self._starts), block), block + 1):
                found = self._computed(missing, poses_at)
                while len(self._blocks) >= _MOST_BLOCKS:
                    del self._blocks[next(iter(self._blocks))]
                self._blocks[missing] = found
        return self._blocks[block]

    def _computed(self, block: int, poses_at: _PosesAt) -> Floats:
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


_MOST_TRACKS = 4


class SpringMotion:
    """Simulation of spring joints that ``Actor.springs`` holds while enabled; copies may share it.

    It is cached until the clip, or what the clip does not animate, changes. ``up`` (3,): up
    direction of the clip's world in figure space, with which gravity rotates; by default the
    figure's up axis.
    """

    def __init__(self, up: Floats | None = None) -> None:
        self._up = up
        self._tracks: dict[tuple[int, PoseKey], tuple[JointMotion, SpringTrack]] = {}

    def swing(self, actor: Actor, time: float) -> None:
        """Rotate an actor's spring joints, in place, once its clip has posed it."""
        clip, skeleton = actor.joint_motion, actor.figure.skeleton
        if clip is None or skeleton is None or skeleton.springs is None:
            return
        rotations = self.rotations(actor, np.array([time]))[0]
        matrices = quaternion_to_matrix(rotations)
        pose = actor.pose
        set_joint_rotations(skeleton, pose, skeleton.springs.joints, matrices, "dofs")

    def rotations(self, actor: Actor, times: Floats) -> Floats:
        """Return the rotations of the spring joints (F, N, 4) at times (F,) in seconds."""
        clip, figure = actor.joint_motion, actor.figure
        if clip is None:
            raise RigError(f"{actor.name} has no motion of joints")
        base, skeleton = still_pose(actor), actor.figure.require_skeleton()
        if skeleton.springs is not None:
            _rest(actor.figure, skeleton.springs, base)
        key = id(clip), pose_key(base)
        if key not in self._tracks:
            while len(self._tracks) >= _MOST_TRACKS:
                del self._tracks[next(iter(self._tracks))]
            track = SpringTrack(self.skeleton_of(figure), clip.start, clip.end)
            # A reference to the clip keeps it alive, so that no other clip gets its id.
            self._tracks[key] = clip, track
        track = self._tracks[key][1]
        return track.rotations(times, lambda at: _posed(figure, clip, at, base))

    def skeleton_of(self, figure: Figure) -> Skeleton:
        """Return the skeleton with gravity in the world of the clip."""
        skeleton, own = figure.require_skeleton(), axis_vector(figure.up)
        if self._up is None or skeleton.springs is None or np.allclose(own, self._up):
            return skeleton
        turn = quaternion_to_matrix(between(own, self._up))
        springs = skeleton.springs
        turned = replace(springs, gravities=springs.gravities @ turn.T)
        return replace(skeleton, springs=turned)


def springs_for(actor: Actor, up: str) -> SpringMotion | None:
    """Return an actor's simulation in a scene whose up axis is ``up``; None without springs."""
    if not has_springs(actor):
        return None
    return SpringMotion(unit(actor.placement[:3, :3].T @ axis_vector(up)))


def has_springs(actor: Actor) -> bool:
    """Return whether an actor's figure has spring joints."""
    skeleton = actor.figure.skeleton
    return skeleton is not None and skeleton.springs is not None


def release_springs(actor: Actor) -> None:
    """Reset the spring joints of a pose to rest, in place, for instance to switch them off."""
    skeleton = actor.figure.skeleton
    if skeleton is not None and skeleton.springs is not None and actor.own_pose is not None:
        _rest(actor.figure, skeleton.springs, actor.own_pose)


def with_baked_springs(actor: Actor, rate: float | None = None) -> SampledClip:
    """Return frames with springs at a rate: the motion's, or the simulation's, if omitted."""
    clip, skeleton = actor.joint_motion, actor.figure.require_skeleton()
    if clip is None or skeleton.springs is None:
        raise RigError(f"{actor.name} has no motion of spring joints")
    if rate is None:
        rate = STEPS_PER_SECOND if clip.kind == "curves" else clip.frame_rate
    times = frame_times(clip.start, clip.end, rate)
    frames = frames_of(actor.figure, clip, times, actor.own_pose)
    rotations = frames.rotations.copy()
    swings = actor.springs if isinstance(actor.springs, SpringMotion) else SpringMotion()
    rotations[:, skeleton.springs.joints] = swings.rotations(actor, times)
    rows: Ints = np.arange(len(times), dtype=np.int32)
    return SampledClip(
        clip.name,
        Timing(rate, np.where(frames.present, rows, -1).astype(np.int32), start=clip.start),
        rotations,
        frames.translations if frames.translations.any() else None,
        frames.figure_translations if frames.figure_translations.any() else None,
        frames.figure_scales if (frames.figure_scales != 1.0).any() else None,
        frames.shape_weights if actor.figure.n_shapes else None,
        frames.scales,
    )


def _rest(figure: Figure, springs: Springs, pose: Pose) -> None:
    """Reset spring joints to their rest rotation, in place."""
    own, skeleton = figure_pose(figure), figure.require_skeleton()
    pose.rotations[springs.joints] = own.rotations[springs.joints]
    chosen = np.isin(skeleton.dof_joints, springs.joints) & (skeleton.dof_kinds >= 3)
    np.copyto(pose.dofs, own.dofs, where=chosen)


def _posed(figure: Figure, clip: JointMotion, times: Floats, base: Pose) -> PosedJoints:
    """Return the joints of a motion without springs."""
    frames = frames_of(figure, clip, times, base, interpolate=True)
    world, count = world_frames(figure, frames), frames.n_frames
    local = affine_matrices(
        quaternion_to_matrix(frames.rotations),
        rest_translations_of(figure, frames.shape_weights) + frames.translations,
    )
    places = affine_matrices(
        frames.figure_scales[:, None, None] * np.eye(3), frames.figure_translations
    )
    scales = np.broadcast_to(frames.scales, (count, *frames.scales.shape[1:]))
    return PosedJoints(world, local, scales, places)
