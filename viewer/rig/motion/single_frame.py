"""Sampled animations of one frame: an actor's current pose, for formats that store motions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.errors import RigError
from viewer.rig.motion.clip import Clip, is_course_rig
from viewer.rig.motion.clip_edit import clip_from_pose
from viewer.rig.motion.evaluation import still_frames
from viewer.rig.motion.sampled_animation import SampledAnimation
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import DEFAULT_RATE, Timing
from viewer.rig.motion.upright import own_up, upright_actor
from viewer.rig.scene import Actor, Scene


def single_frame(
    actor: Actor, rate: float = DEFAULT_RATE, number: int = 0, time: float = 0.0
) -> SampledAnimation:
    """Return the current pose as an animation of one frame, missing while the actor is absent.

    ``motion`` has it too: one key per DOF for rigs with keyed clips. RigError without joints.
    """
    figure, pose = actor.figure, actor.pose
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
) -> tuple[SampledAnimation, str]:
    """Return ``single_frame`` upright, and its up axis, as ``upright_animation`` does."""
    up, hangs = own_up(scene, actor)
    if keeps_world or not hangs:
        return single_frame(actor, rate, number, time), f"-{up}" if hangs else up
    standing = replace(upright_actor(scene, actor), figure=actor.figure)
    return single_frame(standing, rate, number, time), up
