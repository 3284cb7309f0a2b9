"""Cameras of a file of nodes, as camera views in the rest pose."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from viewer.formats._nodes.ancestors import with_ancestors
from viewer.formats._nodes.content import NodeCamera, NodeTree
from viewer.formats._nodes.joints import make_joints, rest_worlds
from viewer.rig.arrays import Floats
from viewer.rig.captures.camera_view import CameraView
from viewer.rig.geometry.rotation import nearest_rotations

__all__ = ["views_of"]

_HEIGHT = 1080  # height of a view, pixels
_ASPECT = 16.0 / 9.0  # aspect ratio of cameras that specify none
# Converts x right, y up, z backwards to x right, y down, z forward.
_TO_OPENCV = np.diag([1.0, -1.0, -1.0])


def views_of(
    tree: NodeTree, order: list[int], cameras: tuple[NodeCamera, ...]
) -> tuple[tuple[CameraView, ...], list[str]]:
    """Return the perspective cameras of a scene.

    Parameters
    ----------
    tree : NodeTree
        All nodes.
    order : list of int
        Nodes of the scene, parents first.
    cameras : tuple of NodeCamera
        The file's cameras.

    Returns
    -------
    views : tuple of CameraView
        Cameras in the space of the scene.
    left_out : list of str
        Names of the orthographic cameras.
    """
    chosen = [node for node in order if tree.cameras[node] >= 0]
    if not chosen:
        return (), []
    needed = with_ancestors(tree.parents.tolist(), chosen)
    joints = make_joints(tree, [node for node in order if node in needed])
    worlds = rest_worlds(joints)
    views, left_out = [], []
    for node in chosen:
        camera = cameras[int(tree.cameras[node])]
        name = tree.names[node] or camera.name or f"camera {node}"
        if camera.vertical_angle is None:
            left_out.append(name)
        else:
            world = worlds[joints.carrier[node]]
            view = _view(name, world, camera.vertical_angle, camera.aspect or _ASPECT)
            views.append(replace(view, near=camera.near, far=camera.far))
    return tuple(views), left_out


def _view(name: str, world: Floats, vertical_angle: float, aspect: float) -> CameraView:
    """Return a view with square pixels; scales of the node's ancestors are ignored."""
    size = max(1, round(_HEIGHT * aspect)), _HEIGHT
    focal = 0.5 * _HEIGHT / math.tan(0.5 * vertical_angle)
    rotation = _TO_OPENCV @ nearest_rotations(world[:3, :3])[0].T
    return CameraView(
        name=name,
        intrinsic=np.array(
            [[focal, 0.0, 0.5 * size[0]], [0.0, focal, 0.5 * size[1]], [0.0, 0.0, 1.0]]
        ),
        rotation=rotation,
        translation=-rotation @ world[:3, 3],
        size=size,
    )
