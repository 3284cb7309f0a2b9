"""``viewer.retarget``: a motion on another figure, with the choices of the commands."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from viewer.commands._frames import Frames
from viewer.commands._keywords import arguments_of, paths_of, without_dashes
from viewer.commands._scene import SceneOptions, add_driving_arguments
from viewer.commands._settings import add_settings, settings_of
from viewer.errors import RigError, ViewerError
from viewer.formats import Source, detect
from viewer.loading import MotionSettings, load
from viewer.models import resolve
from viewer.phrases import printable
from viewer.rigs.figure import Figure
from viewer.rigs.motion.sampled_animation import clip_of, sample_animation
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.retargeting.driven_clip import driven_clip
from viewer.rigs.scene import Actor, Scene, pose_actors

_SKELETONS = ("bvh", "gltf", "fbx")
"""Formats of motions with a skeleton of their own, which drive any figure."""
_NO_MOTION = "retarget: expected a motion of joints, found none"


def retarget(
    motion: Scene | Actor | str | Path, onto: Scene | Actor | str | Path, **options: object
) -> Scene:
    """Let a motion drive a figure with other joints or proportions, as the command line does.

    Parameters
    ----------
    motion : path, Actor or Scene
        A file with a motion, or an actor that moves, such as one of ``viewer.animate``; of a
        scene, the first that moves.
    onto : path, Actor or Scene
        A file or a name such as ``"body"``, or an actor; of a scene, the first with a skin.
    **options
        Options of the command line with underscores: ``joint_map`` (a file), ``source_rest``,
        ``feet``, ``hand_contact`` (True or False), ``up``, ``unit``, ``animation`` and ``fps`` of
        the motion's file.

    Returns
    -------
    Scene
        The figure with its new motion; the ``diagnostics`` say which joints were matched.

    Raises
    ------
    RigError
        If nothing moves, or the joints do not match.
    ViewerError
        If there is no such option or value, or a file cannot be read.

    >>> import viewer
    >>> from viewer.resources import resource
    >>> viewer.retarget(resource("assets", "samples", "lift.bvh"), onto="body")[0].joints().shape
    (3, 24, 3)
    """
    arguments = arguments_of("retarget", _add_arguments, options)
    joint_map = None
    if arguments.joint_map is not None:
        from viewer.formats._joint_map import read_joint_map

        joint_map = read_joint_map(Source.open(arguments.joint_map))
    with without_dashes():
        settings = settings_of(
            MotionSettings, arguments, frame_rate=arguments.fps, joint_map=joint_map
        )
        if isinstance(motion, Scene | Actor) or isinstance(onto, Scene | Actor):
            return _between(_moving(motion, settings), _target(onto), settings)
        return _of_files(_one_path(motion), _one_path(onto), settings)


def _one_path(what: object) -> str:
    """Return the path or name that an argument consists of."""
    found = paths_of("retarget", what)
    if len(found) > 1:
        raise ViewerError(
            f"retarget: expected one path, found {len(found)}; viewer.load opens several as a scene"
        )
    return found[0]


def _of_files(source: str, target: str, settings: MotionSettings) -> Scene:
    """Return a figure that a file drives, as the command line opens them."""
    kind = detect(Source.open(resolve(source)))
    if kind == "bvh":
        scene = load(source, motion=replace(settings, model=target))
    elif kind in _SKELETONS:
        scene = load(target, motion=replace(settings, motions=(resolve(source),)))
    else:
        scene = load(source, target, motion=settings)
    if not any(actor.clip is not None for actor in scene):
        raise RigError(_NO_MOTION)
    moved = [actor for actor in scene if actor.clip is not None and actor.figure.is_attached]
    if not moved:
        why = "".join(f"; {found}" for found in scene.diagnostics[-1:])
        raise RigError(f"retarget: {printable(source)} does not drive {printable(target)}{why}")
    scene.actors = moved
    return scene


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("retargeting")
    add_driving_arguments(group)
    add_settings(group, SceneOptions, "joint_map")
    add_settings(group, MotionSettings, "up", "unit", "animation")
    add_settings(group, Frames, "fps")


def _moving(motion: Scene | Actor | str | Path, settings: MotionSettings) -> Actor:
    """Return the actor that moves."""
    if isinstance(motion, Actor):
        return motion
    scene = motion
    if not isinstance(scene, Scene):
        scene = load(*paths_of("retarget", motion), motion=settings)
    found = next((actor for actor in scene if actor.joint_motion is not None), None)
    if found is None:
        raise RigError(_NO_MOTION)
    return found


def _target(onto: Scene | Actor | str | Path) -> Actor:
    """Return the actor that is driven."""
    if isinstance(onto, Actor):
        return onto
    scene = onto if isinstance(onto, Scene) else load(*paths_of("retarget", onto))
    found = next((actor for actor in scene if actor.figure.is_attached), None)
    if found is None:
        raise RigError("retarget: expected a figure with a skin, found none")
    return found


def _between(source: Actor, target: Actor, settings: MotionSettings) -> Scene:
    """Return a copy of the target, driven by the frames of another actor."""
    sampled, figure = sample_animation(source), source.figure
    clip = clip_of(source.title, sampled, start=float(sampled.frames.times[0]))
    bare = Figure(source.title, skeleton=figure.skeleton, up=figure.up, unit=figure.unit)
    drive = settings.drive_of(SkeletonMotion(bare, replace(clip, shape_weights=None)))
    moved, notes = driven_clip(drive, target.figure)
    actor = replace(
        target.copy(), clip=moved, drive=drive, called=source.title, offset=0.0, is_present=True
    )
    pose_actors([actor], moved.start)
    files = [origin.path for origin in (*figure.origins, *target.figure.origins)]
    return Scene([actor], tuple(notes), world_up=target.figure.up, files=files)
