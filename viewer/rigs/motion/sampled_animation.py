"""Motions at a fixed rate, for export: poses or captured points of actors; keys baked to frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.captures.points import PointLayout
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.quaternion import multiply
from viewer.rigs.geometry.rotation import matrix_to_quaternion
from viewer.rigs.geometry.vectors import HANGING, SignedUp, Up
from viewer.rigs.motion.clip import Clip, is_course_rig
from viewer.rigs.motion.clip_edit import clip_from_pose
from viewer.rigs.motion.evaluation import (
    Frames,
    JointMotion,
    frames_of,
    rest_translations_of,
    still_frames,
)
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import DEFAULT_RATE, Timing, frame_at, frame_times
from viewer.rigs.motion.transform_clip import TransformClip
from viewer.rigs.motion.upright import own_up, upright_actor
from viewer.rigs.pose import Pose
from viewer.rigs.scene import Actor, Motion, Scene


@dataclass(frozen=True, slots=True, eq=False)
class SampledAnimation:
    """A figure with one pose per frame."""

    name: str
    """Name of the actor."""
    figure: Figure
    """Figure without a shape applied; the shape is in ``frames``."""
    frame_rate: float
    """Frames per second."""
    first_frame: int
    """Number of the first frame."""
    frames: Frames
    """Poses, in time order; gaps are in ``frames.present``."""
    motion: JointMotion
    """The motion from which the frames were sampled."""
    base: Pose | None = None
    """Provides the properties that the motion does not animate."""
    gender: str = ""
    """Gender of a captured body, else of the body model; empty if it is unknown."""
    is_rotated: bool = False
    """Whether the frames are rotated upright, see ``upright_animation``; the motion is never
    rotated."""


def sample_animation(
    actor: Actor,
    rate: float | None = None,
    frames: tuple[int, int | None] | None = None,
    interpolate: bool = False,
) -> SampledAnimation:
    """Sample an actor's clip at a rate; by default ``frame_rate``, which keeps captured frames.

    ``frames``: first and end frame (exclusive; None: the clip's end) from the clip's start at that
    rate. RigError without a clip, or if no frame is in the range.
    """
    motion, figure = actor.joint_motion, actor.figure
    if motion is None or figure.skeleton is None:
        raise RigError(f"{actor.name} has no motion of joints")
    own = motion.frame_rate
    rate = own if rate is None else rate
    first, stop = frame_range(motion, rate, frames)
    times = frame_times(motion.start, motion.end, rate)[first:stop]
    if len(times) < stop - first:
        times = motion.start + np.arange(first, stop) / rate
    shift = motion.timing.first_frame if motion.timing is not None and rate == own else 0
    sampled = frames_of(figure, motion, times, actor.own_pose, interpolate)
    base = None if actor.own_pose is None else actor.own_pose.copy()
    gender = actor.shape_space.gender or figure.shape_space.gender
    return SampledAnimation(actor.name, figure, rate, first + shift, sampled, motion, base, gender)


def clip_of(name: str, animation: SampledAnimation, start: float = 0.0) -> SampledClip:
    """Return a clip of the frames, which begins at a time in seconds; -1 are missing frames."""
    frames = animation.frames
    rows = np.where(frames.present, np.arange(frames.n_frames), -1).astype(np.int32)
    return SampledClip(name, Timing(animation.frame_rate, rows, start=start), *frames.arrays)


def frames_at(animation: SampledAnimation, times: Floats) -> Frames:
    """Sample an animation's motion at times (T,) in seconds, rotated upright if its frames are."""
    found = frames_of(animation.figure, animation.motion, times, animation.base)
    return _rotated_upright(animation.figure, found) if animation.is_rotated else found


def frame_range(
    motion: Motion, rate: float, frames: tuple[int, int | None] | None
) -> tuple[int, int]:
    """Return first and end frame (exclusive) for ``sample_animation``; RigError if none is left."""
    count = frame_at(motion.end - motion.start, rate) + 1
    first, asked = (0, None) if frames is None else frames
    stop = count if asked is None else asked
    if motion.kind != "curves":
        stop = min(stop, count)  # unlike other motions, DOF curves extend beyond their keys
    if not 0 <= first < stop:
        found = f"{first} to {'the end' if asked is None else asked}"
        raise RigError(f"frames: expected a range within 0 to {count}, found {found}")
    return first, stop


def upright_animation(
    scene: Scene,
    actor: Actor,
    rate: float | None = None,
    frames: tuple[int, int | None] | None = None,
    interpolate: bool = False,
    keeps_world: bool = False,
) -> tuple[SampledAnimation, SignedUp]:
    """Sample an actor's clip, rotated upright if its world hangs, and the frames' up axis.

    Placement in the scene is ignored. An axis is negative only if ``keeps_world``.
    """
    animation = sample_animation(actor, rate, frames, interpolate)
    up, hangs = own_up(scene, actor)
    if not hangs:
        return animation, up
    if keeps_world:
        return animation, HANGING[up]
    return replace(
        animation, frames=_rotated_upright(animation.figure, animation.frames), is_rotated=True
    ), up


def _rotated_upright(figure: Figure, frames: Frames) -> Frames:
    """Return the frames rotated by 180 degrees about x."""
    return rotated_frames(figure, frames, np.diag([1.0, -1.0, -1.0]))


def rotated_frames(figure: Figure, frames: Frames, rotation: Floats) -> Frames:
    """Rotate frames and the root's path by Q (3, 3)."""
    # The root joint is at p = s (rest + t) + T in the figure. R' = Q R, and T' = Q p - s (rest + t)
    # brings it to Q p.
    rotations = frames.rotations.copy()
    roots = np.flatnonzero(figure.require_skeleton().parents < 0)
    rotations[:, roots] = multiply(matrix_to_quaternion(rotation), rotations[:, roots])
    rest = rest_translations_of(figure, frames.shape_weights)[:, 0]
    inner = frames.figure_scales[:, None] * (rest + frames.translations[:, 0])
    place = (inner + frames.figure_translations) @ rotation.T - inner
    return replace(frames, rotations=rotations, figure_translations=place)


def baked(
    figure: Figure, clip: Clip | TransformClip, rate: float | None = None, base: Pose | None = None
) -> SampledClip:
    """Return poses from start to the last whole frame; ``rate``: that of the keys if omitted."""
    if rate is None:
        rate = DEFAULT_RATE if isinstance(clip, Clip) else clip.frame_rate
    times = frame_times(clip.start, clip.end, rate)
    frames = frames_of(figure, clip, times, base)
    return SampledClip(
        clip.name,
        Timing(rate, np.arange(len(times), dtype=np.int32), start=clip.start),
        frames.rotations,
        frames.translations,
        shape_weights=frames.shape_weights if figure.n_shapes else None,
        scales=frames.scales,
    )


def single_frame(
    actor: Actor, rate: float = DEFAULT_RATE, number: int = 0, time: float = 0.0
) -> SampledAnimation:
    """Return the current pose as an animation of one frame, missing while the actor is absent.

    ``motion`` has it too: one key per DOF for rigs with keyed clips. RigError without joints.
    """
    figure, pose = actor.figure, actor.own_pose
    if figure.skeleton is None or pose is None:
        raise RigError(f"figure {figure.name} has no joints to pose")
    frames, skeleton = still_frames(figure, pose, actor.is_present, time), figure.skeleton
    if is_course_rig(skeleton) and actor.captured is None:
        motion: Clip | SampledClip = clip_from_pose(skeleton, pose, actor.name, time, time)
    else:
        motion = SampledClip(
            actor.name,
            Timing(rate, np.zeros(1, dtype=np.int32), first_frame=number, start=time),
            *frames.arrays,
        )
    gender = actor.shape_space.gender or figure.shape_space.gender
    return SampledAnimation(actor.name, figure, rate, number, frames, motion, gender=gender)


def upright_single_frame(
    scene: Scene,
    actor: Actor,
    rate: float = DEFAULT_RATE,
    number: int = 0,
    time: float = 0.0,
    keeps_world: bool = False,
) -> tuple[SampledAnimation, SignedUp]:
    """Return ``single_frame`` upright, and its up axis, as ``upright_animation`` does."""
    up, hangs = own_up(scene, actor)
    if keeps_world or not hangs:
        return single_frame(actor, rate, number, time), HANGING[up] if hangs else up
    standing = replace(upright_actor(scene, actor), figure=actor.figure)
    return single_frame(standing, rate, number, time), up


@dataclass(frozen=True, slots=True, eq=False)
class SampledPoints:
    """Captured points at a fixed rate."""

    name: str
    """Name of the actor."""
    layout: PointLayout
    """Names and limbs of the K points."""
    frame_rate: float
    """Frames per second."""
    first_frame: int
    """Number of the first frame."""
    times: Floats
    """(F,). Seconds."""
    present: Bools
    """(F,) bool. Whether the person is present."""
    points: Floats
    """(F, K, 3). In the unit of the capture; NaN where a point is not visible."""
    confidences: Floats
    """(F, K). 0 where a point is not visible."""


def sample_upright_points(
    scene: Scene,
    actor: Actor,
    rate: float | None = None,
    frames: tuple[int, int | None] | None = None,
    interpolate: bool = False,
) -> tuple[SampledPoints, Up]:
    """Return an actor's sampled points, rotated upright if upside down, and their up axis."""
    motion, layout = actor.clip, actor.figure.points
    if motion is None or motion.points is None or layout is None:
        raise RigError(f"{actor.name} has no motion of points")
    own = motion.timing.frame_rate
    rate = own if rate is None else rate
    first, stop = frame_range(motion, rate, frames)
    times: Floats = motion.start + np.arange(first, stop) / rate
    found = motion.sample(None, times, interpolate)
    assert found.points is not None  # it is a motion of points
    rows = np.where(found.present[:, None, None], found.points, 0.0)
    up, hangs = own_up(scene, actor)
    places, confidences = rows[..., :3], rows[..., 3]
    if hangs:
        places = places * np.array([1.0, -1.0, -1.0])
    places = np.where(confidences[..., None] > 0.0, places, np.nan)
    start = first + (motion.timing.first_frame if rate == own else 0)
    return SampledPoints(
        actor.name, layout, rate, start, times, found.present, places, confidences
    ), up
