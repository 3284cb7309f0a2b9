"""Animations of one figure's file on another figure."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from viewer.errors import RigError
from viewer.formats import Source
from viewer.loading.cast import Cast
from viewer.loading.skeleton_motions import drive_somebody
from viewer.rig.figure import Figure, FigureGroup
from viewer.rig.motion.animation_choice import chosen_animation
from viewer.rig.motion.sampled_animation import baked
from viewer.rig.motion.skeleton_motion import SkeletonMotion
from viewer.rig.retargeting.drive import Drive
from viewer.rig.scene import Actor

if TYPE_CHECKING:
    from viewer.formats import Content
    from viewer.loading.settings import MotionSettings

__all__ = ["drive_by_figures", "motion_in"]


def motion_in(source: Source, content: Content, wanted: str) -> SkeletonMotion:
    """Return the motion of a file that was passed as a motion.

    Parameters
    ----------
    source : Source
        The file.
    content : Content
        Its contents.
    wanted : str
        The animation, see ``chosen_animation``.

    Raises
    ------
    FormatError
        If it has no motion of a skeleton.
    RigError
        If there is no such animation.
    """
    if isinstance(content, SkeletonMotion):
        return content
    figures = content.figures if isinstance(content, FigureGroup) else (content,)
    for figure in figures:
        if isinstance(figure, Figure) and figure.skeleton is not None and figure.animations:
            return _motion_of(figure, wanted)
    raise source.fault("F002.no-motion")


def _motion_of(figure: Figure, wanted: str) -> SkeletonMotion:
    """Return an animation of a figure as the motion of its skeleton, sampled at its own rate."""
    chosen = chosen_animation([figure], wanted) or figure.animations[0]
    clip = baked(figure, chosen.clip())
    bare = Figure(figure.name, skeleton=figure.skeleton, up=figure.up, unit=figure.unit)
    return SkeletonMotion(bare, clip)


def drive_by_figures(cast: Cast, wanted: str, settings: MotionSettings) -> bool:
    """Let skeletons with animations, but without a mesh, move figures that have no motion.

    A skeleton that moves another figure is not shown itself. It does not move figures of its own
    file, which is a scene and not a motion. Returns whether any skeleton moves a figure.

    Parameters
    ----------
    cast : Cast
        The actors before they play animations.
    wanted : str
        The animation, see ``chosen_animation``.
    settings : MotionSettings
        The requested match of joints, and whether feet are planted.

    Raises
    ------
    RigError
        If no figure matches, although a joint map is given.
    """
    found = False
    for actor in [*cast.actors]:
        figure = actor.figure
        if figure.mesh is not None or actor.clip is not None or not figure.animations:
            continue
        others = _of_other_files(cast, actor)
        if not any(other.figure.is_attached and other.clip is None for other in others):
            continue
        try:
            motion = _motion_of(figure, wanted)
        except RigError:
            continue  # reported when the animations are started
        drive = Drive(motion, joint_map=settings.joint_map, plants_feet=settings.feet)
        path = actor.origin or Path(figure.name)
        if drive_somebody(path, drive, cast, np.eye(4), others)[0]:
            cast.take(next(n for n, other in enumerate(cast.actors) if other is actor))
            found = True
    return found


def _of_other_files(cast: Cast, actor: Actor) -> list[Actor]:
    """Return the other actors, except those of figures from the same file."""
    place = next(index for index, other in enumerate(cast.actors) if other is actor)
    group = cast.groups[place]
    return [
        other
        for other, of_other in zip(cast.actors, cast.groups, strict=True)
        if other is not actor and (group is None or of_other is not group)
    ]
