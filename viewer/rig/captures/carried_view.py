"""Cameras that a joint of a figure carries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from viewer.rig.captures.camera_view import CameraView, extrinsics, view_at
from viewer.rig.scene import Actor, Scene
from viewer.rig.skinning import joint_matrices

__all__ = ["carrier_of", "view_in"]


def carrier_of(view: CameraView, actors: Sequence[Actor]) -> Actor | None:
    """Return the actor whose joint carries a camera; None if no actor does."""
    mount = view.mount
    if mount is None:
        return None
    return next((actor for actor in actors if actor.figure.record is mount.record), None)


def view_in(view: CameraView, scene: Scene) -> CameraView:
    """Return a camera at the time of a scene and, if a joint carries it, in the scene's pose.

    Parameters
    ----------
    view : CameraView
        One of the scene's cameras.
    scene : Scene
        The scene, posed at its time.
    """
    mount, actor = view.mount, carrier_of(view, scene.actors)
    if mount is None or actor is None or actor.pose is None:
        return view_at(view, scene.time or 0.0)
    joints = joint_matrices(actor.figure, actor.pose)
    if mount.joint >= len(joints):
        return view
    rotation, translation = extrinsics(actor.placement @ joints[mount.joint] @ mount.matrix)
    return replace(view, rotation=rotation, translation=translation, mount=None)
