"""Sampled animations of one frame: an actor's current pose, for formats that store motions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.errors import RigError
from viewer.rig.constraints.evaluation import constrained
from viewer.rig.figure import Figure
from viewer.rig.geometry.rotation import matrix_to_quaternion
from viewer.rig.motion.clip import Clip, is_course_rig
from viewer.rig.motion.clip_edit import clip_from_pose
from viewer.rig.motion.evaluation import Frames
from viewer.rig.motion.sampled_animation import SampledAnimation
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import DEFAULT_RATE, Timing
from viewer.rig.motion.upright import own_up, upright_actor
from viewer.rig.pose import Pose, joint_rotations, local_matrices
from viewer.rig.scene import Actor, Scene


def single_frame(
    actor: Actor, rate: float = DEFAULT_RATE, number: int = 0, time: float = 0.0
) -> SampledAnimation:
    """Return an actor's current pose as an animation of one frame.

    ``actor``: actor with joints; the frame of an absent actor is missing. ``rate``: nominal frames
    per second of the animation. ``time``: time of the frame in seconds. Returns animation whose
    ``motion`` also contains the frame: one key per DOF for rigs with keyed clips. Raises
    ``RigError`` if there are no joints.
    """
    figure, pose = actor.figure, actor.pose
    if figure.skeleton is None or pose is None:
        raise RigError(f"figure {figure.name} has no joints to pose")
    figure, frames = pose_frames(figure, pose, actor.is_present, time)
    skeleton = figure.require_skeleton()
    if is_course_rig(skeleton) and not isinstance(actor.clip, SampledClip):
        motion: Clip | SampledClip = clip_from_pose(skeleton, pose, actor.name, time, time)
    else:
        motion = SampledClip(
            actor.name,
            Timing(rate, np.zeros(1, dtype=np.int32), first_frame=number, start=time),
            frames.rotations,
            frames.translations,
            frames.figure_translations,
            frames.figure_scales,
            frames.shape_weights,
            frames.scales,
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
) -> tuple[SampledAnimation, str]:
    """Return an actor's current pose, rotated upright if its world is upside down.

    ``actor``, ``rate``, ``number``, ``time``: as for ``single_frame``. The actor's placement in the
    scene is ignored. ``keeps_world``: keep the orientation of the actor's own world, as in
    ``upright_animation``. Returns ``animation``: animation of one frame; ``up``: up axis of the
    frame; negative axes occur only if ``keeps_world`` is True.
    """
    up, hangs = own_up(scene, actor)
    if keeps_world or not hangs:
        return single_frame(actor, rate, number, time), f"-{up}" if hangs else up
    standing = replace(upright_actor(scene, actor), figure=actor.figure)
    return single_frame(standing, rate, number, time), up


def pose_frames(
    figure: Figure, pose: Pose | None, is_present: bool = True, time: float = 0.0
) -> tuple[Figure, Frames]:
    """Return one pose as frames, and the figure that they animate.

    ``figure``: figure with or without a skeleton. ``pose``: pose of the figure; None for a figure
    without a skeleton. ``time``: time of the frame in seconds.
    """
    skeleton, weights = figure.skeleton, np.zeros((1, figure.n_shapes))
    place, scale = np.zeros((1, 3)), np.ones(1)
    rotated, moved, scales = np.zeros((1, 0, 4)), np.zeros((1, 0, 3)), np.zeros((1, 0, 3))
    if pose is not None:
        # Missing weights are treated as 0.
        weights[0, : len(pose.shape_weights)] = pose.shape_weights
        place, scale = pose.figure_translation[None].copy(), np.array([pose.figure_scale])
    if pose is not None and skeleton is not None:
        scales = pose.scales[None].copy()
        places = local_matrices(skeleton, pose)[:, :3, 3]
        moved = (places - skeleton.rest_translations)[None]
        turns = matrix_to_quaternion(joint_rotations(skeleton, pose))
        rotated = constrained(skeleton, turns, places, pose.scales)[None]
    present, times = np.array([is_present]), np.array([time])
    return figure, Frames(times, present, rotated, moved, scales, weights, place, scale)
