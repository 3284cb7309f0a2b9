"""All keyed motions of a figure: the animations of its file, one of which may be edited."""

from __future__ import annotations

import numpy as np

from viewer.errors import FormatError
from viewer.rig.motion.transform_clip import TransformClip
from viewer.rig.motion.upright import own_up
from viewer.rig.pose import Pose
from viewer.rig.scene import Actor, Scene, figure_pose
from viewer.rig.skeleton import FIRST_ROTATION

__all__ = ["has_own_animations", "keeps_keys", "own_animations", "still_pose"]


def has_own_animations(actor: Actor) -> bool:
    """Return whether an actor has animations and plays either one of them, edited or not, or none.

    False if constraints also move its joints, because keys do not contain their effect.
    """
    clip, skeleton = actor.clip, actor.figure.skeleton
    if skeleton is None or skeleton.constraints:
        return False
    return isinstance(clip, TransformClip) or (clip is None and bool(actor.figure.animations))


def keeps_keys(scene: Scene, actor: Actor) -> bool:
    """Return whether an actor's animations can be written unchanged, even if it is made upright."""
    return has_own_animations(actor) and not own_up(scene, actor)[1]


def own_animations(
    actor: Actor, only_played: bool = False, refused: list[FormatError] | None = None
) -> tuple[TransformClip, ...]:
    """Return the animations of an actor, including edits of the one that it plays.

    Animations without keys are omitted.

    Parameters
    ----------
    actor : Actor
        See ``has_own_animations``.
    only_played : bool
        Return only the one that it plays.
    refused : list of FormatError, optional
        Receives the errors of animations with invalid keys, which are then left out.

    Raises
    ------
    FormatError
        If the keys of an animation are invalid, and ``refused`` is not given.
    """
    played = actor.clip if isinstance(actor.clip, TransformClip) else None
    if only_played:
        clips = [] if played is None else [played]
    else:
        clips = []
        for index, animation in enumerate(actor.figure.animations):
            try:
                own = played if index == actor.animation else None
                clips.append(animation.clip() if own is None else own)
            except FormatError as problem:
                if refused is None:
                    raise
                refused.append(problem)
        if played is not None and actor.animation < 0:
            clips.append(played)
    return tuple(clip for clip in clips if clip.channels)


def still_pose(actor: Actor) -> Pose:
    """Return an actor's pose, with everything that its motion changes reset to the file's pose.

    Parameters
    ----------
    actor : Actor
        An actor with a pose.
    """
    own, pose = figure_pose(actor.figure), actor.require_pose().copy()
    if not isinstance(actor.clip, TransformClip):
        return pose
    skeleton = actor.figure.require_skeleton()
    rotates = skeleton.dof_kinds >= FIRST_ROTATION
    for channel in actor.clip.channels:
        joint, dofs = channel.joint, skeleton.dof_joints == channel.joint
        if channel.path == "rotation":
            pose.rotations[joint] = own.rotations[joint]
            np.copyto(pose.dofs, own.dofs, where=dofs & rotates)
        elif channel.path == "translation":
            pose.translations[joint] = own.translations[joint]
            np.copyto(pose.dofs, own.dofs, where=dofs & ~rotates)
        elif channel.path == "scale":
            pose.scales[joint] = own.scales[joint]
        elif channel.shapes is not None:
            pose.shape_weights[channel.shapes] = own.shape_weights[channel.shapes]
    return pose
