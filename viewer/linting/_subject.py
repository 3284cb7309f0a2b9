"""The subject of checks: an actor, its frame numbers, and its track.

A check gets one ``Subject`` and returns findings about it. Checks of motion look at its ``Track``,
the clip evaluated frame by frame in the scene, which is computed once for all of them. Keyed clips
have no frames of their own: they are sampled at ``key_times``, and ``Counting`` gives these times
the frame numbers that the timeline shows.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.diagnostics.codes import Severity
from viewer.linting._finding import NO_TIMES, Finding, LintOptions
from viewer.phrases import rounded
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.feet.body import body_size
from viewer.rigs.feet.contacts import FootPath
from viewer.rigs.feet.legs import animal_legs, legs_of
from viewer.rigs.feet.soles import soles_of, soles_of_feet
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.quaternion import align_signs, multiply
from viewer.rigs.geometry.transform import apply_transform, mean_scale
from viewer.rigs.geometry.vectors import Up, axis_vector, lengths_of
from viewer.rigs.hierarchy import path_to_root
from viewer.rigs.inspection.faults import NO_INDICES, Fault, Invalid, valid
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.motion.animation_choice import animation_labels
from viewer.rigs.motion.clip import Clip
from viewer.rigs.motion.evaluation import JointMotion, frames_between, frames_of, world_frames
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.motion.timing import Timing
from viewer.rigs.motion.transform_clip import TransformClip
from viewer.rigs.retargeting.source_rest import with_source_rest
from viewer.rigs.scalars import length_text
from viewer.rigs.scene import Actor, Scene, time_span
from viewer.rigs.shape import rest_joints, shaped
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.units import METRES

Indices = NDArray[np.int64]
_IndicesLike = NDArray[np.int64] | Ints | list[int]

# Size of a figure
_STRAYS = 0.02  # maximum fraction of stray vertices at each end of an axis
_FAR = 10.0  # strays are ignored if they enlarge the bounding box by more than this factor
_PROP = 0.1  # relative size of a skeleton below which its mesh determines the size
_MOST_JOINTS = 0.5  # minimum fraction of the joints that are below one that carries the body
_STAYS = 1e-3  # relative distance up to which a translation is rounding
_QUADRUPED = 4  # number of legs
_POSES = 3  # minimum number of changes between held poses that are a motion
_ROUNDING = 1e-6  # relative movement up to which a pose is held
# Frames
_TOGETHER = 1000  # frames per batch, which limits the memory for their matrices
_MOST = 200_000  # maximum number of sampling times of a keyed clip
_ON_STEP = 1e-6  # tolerance, as a fraction of a step
_ON_FRAME = 1e-6  # tolerance, as a fraction of a frame, within which a time counts as that frame's


@dataclass(frozen=True, slots=True, eq=False)
class Subject:
    """One actor to check."""

    actor: Actor
    """The actor, which is not modified."""
    index: int = 0
    """Index of the actor in its scene."""
    up: Up = "y"
    """The scene's up axis."""
    options: LintOptions = field(default_factory=LintOptions)
    """Thresholds of the checks."""
    counting: Counting | None = None
    """Frame numbering of keyed clips; None to number each clip separately."""
    invalid: Invalid = field(default_factory=dict)
    """Data that a reader replaced."""
    people: tuple[Actor, ...] = ()
    """All captured people of the scene, in its order."""
    # Results that several checks need are computed once: ``track_of`` caches them here.
    tracks: list[Track] = field(default_factory=list)
    """Cached track of the actor's clip; may be empty."""

    def valid(self, part: str, count: int) -> Bools:
        """Return which of ``count`` items of a part, a key of ``invalid``, are valid: (count,)."""
        return valid(self.invalid, part, count)

    def lacks(self, *parts: str) -> bool:
        """Return whether a reader replaced data of one of these parts, keys of ``invalid``."""
        return any(len(self.invalid.get(part, ())) for part in parts)

    def length(self, length: float) -> str:
        """Return a length as text: in millimetres if the unit is known, else relative to size."""
        figure = self.actor.figure
        if figure.unit in METRES:
            return length_text(figure, length)
        return f"{rounded(length)} units" + self._relative(length)

    def speed(self, speed: float, is_limit: bool = False) -> str:
        """Return a speed in m/s, else in units and, unless a limit, in sizes per second."""
        unit = self.actor.figure.unit
        if unit in METRES:
            return f"{rounded(speed * METRES[unit])} m/s"
        size = 0.0 if is_limit else self.size()
        relative = f" ({rounded(speed / size)} times its size)" if size > 0.0 else ""
        return f"{rounded(speed)} units per second{relative}"

    def size(self) -> float:
        """Return the diagonal of the mesh without strays, or else of the rest joints, or 0."""
        figure = self.actor.figure
        if figure.mesh is None:
            return 0.0 if figure.skeleton is None else box_size(bounding_box(rest_joints(figure)))
        positions = figure.mesh.positions
        size = box_size(bounding_box(positions))
        if len(positions) == 0:
            return size
        # Partitioning finds both quantiles of an axis without sorting.
        inner = np.quantile(positions, [_STRAYS, 1.0 - _STRAYS], axis=0, method="nearest")
        usual = box_size(inner)
        if not size > _FAR * usual > 0.0:
            return size
        near = np.linalg.norm(positions - inner.mean(axis=0), axis=1) < _FAR / 2 * usual
        return box_size(bounding_box(positions[near]))

    def times(self, timing: Timing, frames: NDArray[np.integer]) -> Floats:
        """Return the times (N,) of frames of the actor's motion on the scene's clock."""
        return timing.start + frames / timing.frame_rate + self.actor.offset

    def _relative(self, length: float) -> str:
        size = self.size()
        return f" ({rounded(100.0 * length / size)} % of the figure's size)" if size > 0.0 else ""

    def faults(self, faults: Iterable[Fault]) -> list[Finding]:
        """Return faults of the actor's figure as findings about it."""
        return [
            self.found(
                fault.message,
                severity=fault.severity,
                vertices=fault.vertices,
                triangles=fault.triangles,
                joints=fault.joints,
                at=fault.at,
                **fault.values,
            )
            for fault in faults
        ]

    def found(
        self,
        key: str,
        *,
        part: Literal["mesh", "skeleton", "clip"] = "mesh",
        severity: Severity | None = None,
        vertices: _IndicesLike = NO_INDICES,
        triangles: _IndicesLike = NO_INDICES,
        joints: _IndicesLike = NO_INDICES,
        frames: _IndicesLike = NO_INDICES,
        times: Floats = NO_TIMES,
        seek: float | None = None,
        at: tuple[str, int] | None = None,
        **values: object,
    ) -> Finding:
        """Return a finding about this actor, with the values of the message ``key``."""
        return Finding(
            Diagnostic(key, level=severity, values=values),
            actor=self.index,
            name=self.actor.name,
            part=part,
            vertices=np.asarray(vertices, dtype=np.int32),
            triangles=np.asarray(triangles, dtype=np.int32),
            joints=np.asarray(joints, dtype=np.int32),
            frames=np.asarray(frames, dtype=np.int32),
            times=times,
            seek=seek,
            motion=self._motion() if part == "clip" else "",
            animation=self.actor.animation if part == "clip" else -1,
            at=at,
        )

    def _motion(self) -> str:
        """Return the label of the animation that the actor plays, if its figure has several."""
        figure, index = self.actor.figure, self.actor.animation
        if index < 0 or len(figure.animations) < 2:
            return ""
        return animation_labels(figure)[index]


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A motion evaluated frame by frame."""

    times: Floats
    """(F,): times on the scene's clock, in seconds."""
    numbers: Ints
    """(F,): number of each frame in the file; for keyed clips, the frame of the timeline. Several
    rows may have the same frame."""
    present: Bools
    """(F,): whether the row is defined: the actor is present, and the data of the file is valid."""
    positions: Floats
    """(F, J, 3): joints in scene space."""
    rotations: Floats
    """(F, J, 4): local rotations: unit quaternions."""
    translations: Floats
    """(F, J, 3): offsets of the joints from their rest translations, relative to the parent."""
    scales: Floats
    """(F, J, 3) or (1, J, 3): local scale factors."""
    per_frame: int
    """Rows per frame: keyed clips are also evaluated between frames."""
    stepped: Bools
    """(F, J): whether a key without interpolation, of the joint or of an ancestor, is between the
    previous row and this one: such jumps are intended."""
    size: float
    """Size of the skeleton at rest, in scene units."""
    scale: float
    """Scene units per figure unit."""
    feet: Ints
    """(N,): the joint of each foot nearest to the ground; empty unless joint names identify two
    feet, or the skeleton has the shape of a quadruped's."""
    soles: Floats
    """(F, N): height of each foot's lowest point in the scene."""
    paths: tuple[FootPath, ...]
    """Path of each foot in the scene."""
    body: float
    """Size of the body: twice the length of its longest leg, or its height, in scene units."""
    stance: Figure
    """The figure; a captured skeleton whose rest pose does not stand has the estimated one of
    retargeting."""

    @property
    def n_frames(self) -> int:
        """Number of frames from the first to the last in which the actor is present."""
        there = self.numbers[self.present]
        return int(there[-1]) - int(there[0]) + 1 if len(there) else 0

    def on_frames(self) -> Indices:
        """Return the rows at the frames of the file: (N,)."""
        return np.arange(0, len(self.times), self.per_frame)

    def is_blocked(self) -> bool:
        """Return whether all poses are held, as animators block a motion, or draw it on twos."""
        steps = lengths_of(np.diff(self.positions[self.on_frames()], axis=0)).max(axis=1)
        changes = steps > _ROUNDING * self.size
        is_held = not (changes[1:] & changes[:-1]).any()
        # A body at rest that is displaced, and maybe returns, is not blocked.
        return is_held and int(changes.sum()) >= _POSES

    def turns(self, rows: Indices) -> Floats:
        """Return the rotations of rows without changes of sign between them: (N, J, 4)."""
        turns = self.rotations[rows]
        align_signs(turns)
        return turns

    def of_each(self, rows: Indices) -> Indices:
        """Return rows, keeping only the first of each frame: (N,)."""
        _, first = np.unique(self.numbers[rows], return_index=True)
        return rows[np.sort(first)]


def track_of(subject: Subject) -> Track | None:
    """Return the cached track of an actor's skeleton; None if it has none."""
    if not subject.tracks:
        track = _track(subject)
        if track is None:
            return None
        subject.tracks.append(track)
    return subject.tracks[0]


def travelling_joints(track: Track, skeleton: Skeleton) -> Ints:
    """Return the joints that carry the body: roots, and moved joints above most others: (K,)."""
    moves = np.ptp(track.translations[track.present], axis=0).max(axis=1, initial=0.0)
    carries, n_below = skeleton.parents < 0, np.ones(skeleton.n_joints)
    for joint in range(skeleton.n_joints - 1, -1, -1):
        if skeleton.parents[joint] >= 0:
            n_below[skeleton.parents[joint]] += n_below[joint]
    moved = (moves * track.scale > _STAYS * track.size) & (n_below > _MOST_JOINTS * len(n_below))
    return np.flatnonzero(carries | moved).astype(np.int32)


def ends_of(limb: Sequence[str], names: Sequence[str], skeleton: Skeleton) -> list[int]:
    """Return the joints at the end of a limb: wrist or ankle, or else those of a hand or foot.

    ``limb``: meanings of its upper part, hinge and end; ``names``: those of all joints. Empty
    without a hinge.
    """
    if limb[2] in names:
        return [names.index(limb[2])]
    if limb[1] not in names:
        return []
    below = np.flatnonzero(skeleton.parents == names.index(limb[1])).tolist()
    # Joints that twist a forearm are not of the hand.
    return [joint for joint in below if names[joint]] or below


def world_turns(rotations: Floats, skeleton: Skeleton, joint: int) -> Floats:
    """Return the rotation of a joint relative to the figure in each frame: (F, 4)."""
    result = rotations[:, joint]
    for above in path_to_root(skeleton.parents, joint)[1:]:
        result = multiply(rotations[:, above], result)
    return result


def _track(subject: Subject) -> Track | None:
    actor = subject.actor
    figure, clip, skeleton = actor.figure, actor.joint_motion, actor.figure.skeleton
    if clip is None or skeleton is None:
        return None
    if clip.timing is not None:
        timing = clip.timing
        count, per_frame = timing.n_frames, 1
        times = timing.times
        numbers = timing.first_frame + np.arange(count, dtype=np.int32)
    else:
        times = key_times(subject, clip)
        count, per_frame = len(times), _per_frame(subject, clip)
        numbers = frame_numbers(subject, times)
    frames = frames_of(figure, clip, times, actor.own_pose)
    scale = mean_scale(actor.placement)
    is_bound = figure.is_attached and not subject.lacks("bindings")
    stance = _stance(figure, clip)
    legs = animal_legs(skeleton.parents, rest_joints(stance), axis_vector(figure.up))
    # Only quadrupeds: insects are modelled with the tips of their legs in the ground.
    legs = legs if len(legs) == _QUADRUPED else []
    soles = None
    if count:
        stands = shaped(stance, frames.shape_weights[0])
        paws = [[leg.toe] for leg in legs]
        soles = soles_of_feet(stands, paws, is_bound) if legs else soles_of(stands, is_bound)
    feet = np.zeros(0, dtype=np.int32) if soles is None else soles.joints
    joints, lowest = np.empty((count, skeleton.n_joints, 3)), np.empty((count, len(feet)))
    heels = np.empty((count, len(feet), 3))
    for start in range(0, count, _TOGETHER):
        part = slice(start, start + _TOGETHER)
        world = world_frames(figure, frames_between(frames, part))
        joints[part] = world[..., :3, 3]
        if soles is not None:
            lowest[part] = soles.scene_heights(world, actor.placement, subject.up)
            heels[part] = np.einsum("fnab,nb->fna", world[:, soles.ankles, :3], soles.heels)
    placed = apply_transform(actor.placement, joints)
    hips = {leg.toe if legs else leg.ankle: leg.hip for leg in legs or legs_of(skeleton)}
    paths = []
    for number, foot in enumerate(feet.tolist()):
        heel = apply_transform(actor.placement, heels[:, number])
        ankle = int(soles.ankles[number]) if soles is not None else foot
        # Without a hip, the body is assumed to stand.
        hip = placed[:, hips[ankle]] if ankle in hips else heel + axis_vector(subject.up)
        paths.append(FootPath(placed[:, foot] if foot != ankle else heel, heel, hip))
    return Track(
        times=times + actor.offset,
        numbers=numbers,
        present=frames.present & _known(subject, clip, count),
        positions=placed,
        rotations=frames.rotations,
        translations=frames.translations,
        scales=frames.scales,
        per_frame=per_frame,
        stepped=_stepped(clip, skeleton, times),
        size=scale * _size(subject, stance),
        scale=scale,
        feet=feet,
        soles=lowest,
        paths=tuple(paths),
        body=scale * body_size(stance),
        stance=stance,
    )


def _stance(figure: Figure, clip: JointMotion) -> Figure:
    """Return a figure whose rest pose shows where soles and heels are in the space of the feet."""
    if figure.mesh is not None or clip.kind != "sampled":
        return figure
    # The bones of some captures rest along one axis, or in the axes of their parents.
    return with_source_rest(SkeletonMotion(figure, clip), "auto")[0].figure


def _stepped(clip: JointMotion, skeleton: Skeleton, times: Floats) -> Bools:
    """Return where keys without interpolation move a joint or its ancestors: (F, J)."""
    result = np.zeros((len(times), skeleton.n_joints), dtype=np.bool_)
    if clip.kind != "transforms":
        return result
    for channel in clip.channels:
        if channel.joint >= 0 and channel.interpolation == "step":
            rows = np.searchsorted(times, channel.times)
            result[rows[rows < len(times)], channel.joint] = True
    for joint, parent in enumerate(skeleton.parents.tolist()):
        if parent >= 0:
            result[:, joint] |= result[:, parent]
    return result


def _size(subject: Subject, figure: Figure) -> float:
    """Return the size of the skeleton, or of the mesh if that is much larger: a prop on a joint."""
    joints, mesh = box_size(bounding_box(rest_joints(figure))), subject.size()
    return joints if joints > _PROP * mesh else mesh


def key_times(subject: Subject, clip: Clip | TransformClip) -> Floats:
    """Return the times of a keyed clip's frames, and steps between them: (F,), on its clock."""
    rate = subject.options.frame_rate or clip.frame_rate
    rate *= _per_frame(subject, clip)
    count = min(math.floor((clip.end - clip.start) * rate + _ON_STEP) + 1, _MOST)
    return clip.start + np.arange(count) / rate


def _per_frame(subject: Subject, clip: Clip | TransformClip) -> int:
    """Return the number of times per frame at which a keyed clip is evaluated."""
    options = subject.options
    return max(1, math.ceil(options.rate / (options.frame_rate or clip.frame_rate)))


def frame_numbers(subject: Subject, times: Floats) -> Ints:
    """Return the frames of the timeline at times of a keyed clip: (F,) int32."""
    actor = subject.actor
    assert actor.clip is not None  # checked by the callers
    rate = subject.options.frame_rate or actor.clip.frame_rate
    counting = subject.counting or Counting(rate, actor.clip.start + actor.offset)
    return counting.numbers(times + actor.offset)


def _known(subject: Subject, clip: JointMotion, count: int) -> Bools:
    """Return which frames have valid data from the file: (F,)."""
    if clip.timing is None:
        return np.ones(count, dtype=np.bool_)
    rows = clip.timing.rows
    return subject.valid("frames", clip.n_rows)[rows] | (rows < 0)


@dataclass(frozen=True, slots=True)
class Counting:
    """Frame numbering of a timeline."""

    rate: float
    """Frames per second."""
    origin: float
    """Time of the first frame on the scene's clock, in seconds."""
    first: int = 0
    """Number of the first frame."""

    def numbers(self, times: Floats) -> Ints:
        """Return the frame shown at each time of the scene's clock: (N,) int32."""
        places = np.floor((times - self.origin) * self.rate + _ON_FRAME)
        return places.astype(np.int32) + np.int32(self.first)


def counting_of(scene: Scene, keyed_rate: float) -> Counting:
    """Return a scene's frame numbering: its longest capture's, or from the earliest start."""
    moving = [actor for actor in scene.actors if actor.clip is not None]
    captured = [(each.timing, actor.offset) for actor in moving if (each := actor.captured)]
    if not captured:
        return Counting(keyed_rate, time_span(moving)[0])
    timing, offset = max(captured, key=lambda one: one[0].end - one[0].start)
    return Counting(timing.frame_rate, timing.start + offset, timing.first_frame)
