"""A take of one frame: an actor as it is posed right now, for formats that hold motions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.errors import RigError
from viewer.rig.arrays import Floats
from viewer.rig.clip import Clip, is_course_rig
from viewer.rig.clip_edit import clip_from_pose
from viewer.rig.figure import Figure
from viewer.rig.motion import DEFAULT_RATE, Frames
from viewer.rig.pose import Pose, joint_rotations, local_matrices
from viewer.rig.rotation import matrix_to_quaternion
from viewer.rig.sampled_clip import SampledClip
from viewer.rig.scene import Actor, Scene
from viewer.rig.skeleton import Skeleton
from viewer.rig.take import Take
from viewer.rig.timing import Timing
from viewer.rig.upright import own_up, upright_actor

__all__ = ["pose_take", "posed_take"]


def pose_take(actor: Actor, rate: float = DEFAULT_RATE, number: int = 0, time: float = 0.0) -> Take:
    """Return an actor's present pose as a take of one frame.

    Parameters
    ----------
    actor : Actor
        With joints; whoever is not present has a frame that is missing.
    rate : float
        Frames a second that the take says.
    number : int
        What the frame is called.
    time : float
        Seconds of the frame.

    Returns
    -------
    Take
        Its ``motion`` holds the frame too: of rigs that move by keys a key for each DOF.

    Raises
    ------
    RigError
        If there are no joints.
    """
    figure, pose = actor.figure, actor.pose
    if figure.skeleton is None or pose is None:
        raise RigError(f"figure {figure.name} has no joints to pose")
    skeleton = figure.skeleton
    if (pose.scales != skeleton.rest_scales).any():
        # Frames know no scales of joints: the skeleton says them.
        skeleton = replace(skeleton, rest_scales=pose.scales)
        figure = replace(figure, skeleton=skeleton)
    frames = _frame(figure, skeleton, pose, actor.is_present, time)
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
        )
    return Take(actor.name, figure, rate, number, frames, motion)


def posed_take(
    scene: Scene,
    actor: Actor,
    rate: float = DEFAULT_RATE,
    number: int = 0,
    time: float = 0.0,
    keeps_world: bool = False,
) -> tuple[Take, str]:
    """Return an actor's present pose as a take, stood up where its own world hangs head down.

    Parameters
    ----------
    scene : Scene
        Says what is up.
    actor, rate, number, time
        As for ``pose_take``. Where the actor stands in the scene is left out.
    keeps_world : bool
        Leave it as its own world has it, as ``viewer.rig.take.upright_take`` does.

    Returns
    -------
    take : Take
        One frame.
    up : "y", "z", "-y" or "-z"
        The axis that points up in it; below only in worlds that are kept.
    """
    up, hangs = own_up(scene, actor)
    if keeps_world or not hangs:
        return pose_take(actor, rate, number, time), f"-{up}" if hangs else up
    standing = replace(upright_actor(scene, actor), figure=actor.figure)
    return pose_take(standing, rate, number, time), up


def _frame(figure: Figure, skeleton: Skeleton, pose: Pose, is_present: bool, time: float) -> Frames:
    moved: Floats = local_matrices(skeleton, pose)[:, :3, 3] - skeleton.rest_translations
    weights = np.zeros((1, figure.n_shapes))
    weights[0, : len(pose.shape_weights)] = pose.shape_weights  # those that are missing count as 0
    return Frames(
        np.array([time]),
        np.array([is_present]),
        matrix_to_quaternion(joint_rotations(skeleton, pose))[None],
        moved[None],
        weights,
        pose.figure_translation[None].copy(),
        np.array([pose.figure_scale]),
    )
