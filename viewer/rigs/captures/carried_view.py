"""Cameras that a joint of a figure carries, or nodes of its file move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from viewer.rigs.arrays import Floats
from viewer.rigs.captures.cameras import CameraPath, CameraView, extrinsics, view_at
from viewer.rigs.figure import Figure
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.motion.transform_clip import Animation, TransformClip
from viewer.rigs.scene import Actor, Scene, pose_actors
from viewer.rigs.skinning import joint_matrices


def carrier_of(view: CameraView, actors: Sequence[Actor]) -> Actor | None:
    """Return the actor that moves a camera with its joint or clip; None if no actor does."""
    mount = view.mount
    if mount is None:
        return None
    return next((actor for actor in actors if actor.figure.record is mount.record), None)


def view_in(view: CameraView, scene: Scene) -> CameraView:
    """Return a camera at the time of a scene and, if a joint carries it, in the scene's pose."""
    mount, actor = view.mount, carrier_of(view, scene.actors)
    if mount is None or actor is None or actor.own_pose is None:
        return view_at(view, scene.time or 0.0)
    world = actor.placement
    if mount.joint >= 0:
        joints = joint_matrices(actor.figure, actor.own_pose)
        if mount.joint >= len(joints):
            return view
        world = world @ joints[mount.joint]
    matrix = mount.matrix if mount.path is None else _moved(mount.path, actor, scene.time or 0.0)
    rotation, translation = extrinsics(world @ matrix)
    return replace(view, rotation=rotation, translation=translation, mount=None)


def played_with(path: CameraPath, clip: TransformClip | None) -> Animation | None:
    """Return the animation of a camera that belongs to the clip of a figure; None without one."""
    if clip is None or clip.number < 0:
        return None
    return next((each for each in path.animations if each.number == clip.number), None)


def moving_alone(scene: Scene) -> list[str]:
    """Return the names of the cameras that move in a clip without channels for any figure."""
    found = []
    for view in scene.views:
        actor = carrier_of(view, scene.actors)
        clip = None if actor is None else actor.transforms
        path = None if view.mount is None else view.mount.path
        is_still = clip is not None and not clip.channels
        if path is not None and is_still and played_with(path, clip) is not None:
            found.append(view.name)
    return found


def _moved(path: CameraPath, actor: Actor, time: float) -> Floats:
    """Return the matrix of a camera's nodes at one time of the scene's clock: (4, 4)."""
    nodes, animation = Actor(Figure("", skeleton=path.nodes)), played_with(path, actor.transforms)
    if animation is not None:
        nodes.clip, nodes.offset = animation.clip(), actor.offset
        pose_actors([nodes], time)
    return np.asarray(world_matrices(path.nodes, nodes.pose)[-1])
