"""Vertices and joints of an actor in the scene's space, at one time or of all frames."""

from __future__ import annotations

import numpy as np

from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.motion.evaluation import (
    Frames,
    frames_of,
    pose_actors,
    pose_of,
    still_frames,
    world_frames,
)
from viewer.rigs.motion.sampled_animation import sample_animation
from viewer.rigs.scene import Actor
from viewer.rigs.skinning import Skinning, deform


def vertices(actor: Actor, time: float | None = None, skinning: Skinning | None = None) -> Floats:
    """Return an actor's vertices in the scene's space, at one time or of all frames.

    Parameters
    ----------
    actor : Actor
        Actor whose figure has a mesh.
    time : float, optional
        Seconds of its motion; all frames of the motion if omitted, one without a motion.
    skinning : Skinning, optional
        Skinning method and options.

    Returns
    -------
    (V, 3) or (F, V, 3)
        float64 at the time, or of all frames; NaN where the actor is absent.

    Raises
    ------
    RigError
        If the figure has no mesh.

    >>> import viewer
    >>> viewer.vertices(viewer.load("fox")[0]).shape
    (1, 7561, 3)
    """
    figure, mesh = actor.figure, actor.figure.require_mesh()
    if figure.skeleton is None:
        placed = apply_transform(actor.placement, mesh.positions)
        return placed[None] if time is None else placed
    frames = _frames(actor, time)
    found = np.full((frames.n_frames, mesh.n_vertices, 3), np.nan)
    for frame in np.flatnonzero(frames.present).tolist():
        posed, _ = deform(figure, pose_of(figure, frames, frame), skinning or Skinning())
        found[frame] = apply_transform(actor.placement, posed)
    return found if time is None else found[0]


def joints(actor: Actor, time: float | None = None) -> Floats:
    """Return the positions of an actor's joints, as ``vertices`` does for its mesh.

    Parameters
    ----------
    actor : Actor
        Actor whose figure has a skeleton.
    time : float, optional
        Seconds of its motion; all frames of the motion if omitted, one without a motion.

    Returns
    -------
    (J, 3) or (F, J, 3)
        float64 at the time, or of all frames; NaN where the actor is absent.

    Raises
    ------
    RigError
        If the figure has no skeleton.
    """
    actor.figure.require_skeleton()
    frames = _frames(actor, time)
    places = world_frames(actor.figure, frames)[..., :3, 3]
    placed = apply_transform(actor.placement, places.reshape(-1, 3)).reshape(places.shape)
    placed[~frames.present] = np.nan
    return placed if time is None else placed[0]


def at(actor: Actor, time: float) -> Actor:
    """Return a copy of an actor in its pose at a time, which no longer moves.

    Parameters
    ----------
    actor : Actor
        Actor with or without a motion.
    time : float
        Seconds of its motion.

    Returns
    -------
    Actor
        Independent of the first one; only the figure is shared.
    """
    copy = actor.copy()
    pose_actors([copy], time)
    copy.clip = None
    return copy


def _frames(actor: Actor, time: float | None) -> Frames:
    """Return the frames of an actor's motion, or one at a time; its pose without a motion."""
    motion = actor.joint_motion
    if motion is None:
        return still_frames(actor.figure, actor.require_pose())
    if time is None:
        return sample_animation(actor).frames
    return frames_of(actor.figure, motion, np.array([time - actor.offset]), actor.pose)
