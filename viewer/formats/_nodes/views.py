"""Cameras of a file of nodes, as camera views that the joints above them carry."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from viewer.data_classes import dataclass
from viewer.formats._nodes.ancestors import with_ancestors
from viewer.formats._nodes.content import NodeCamera, NodeTree
from viewer.formats._nodes.joints import Joints, make_joints, rest_worlds
from viewer.rig.arrays import Floats
from viewer.rig.captures.camera_view import CameraMount, CameraView, extrinsics
from viewer.rig.file_record import FileRecord

__all__ = ["Carrier", "views_of"]

_HEIGHT = 1080  # height of a view, pixels
_ASPECT = 16.0 / 9.0  # aspect ratio of cameras that specify none


@dataclass(frozen=True, slots=True, eq=False)
class Carrier:
    """A figure whose joints can carry cameras."""

    record: FileRecord
    joints: Joints


def views_of(
    tree: NodeTree,
    order: list[int],
    cameras: tuple[NodeCamera, ...],
    carriers: Sequence[Carrier] = (),
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
    carriers : sequence of Carrier
        The figures of the file.

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
            mount = _mount(tree, node, carriers)
            views.append(_view(name, world, camera.vertical_angle, camera, mount))
    return tuple(views), left_out


def _mount(tree: NodeTree, node: int, carriers: Sequence[Carrier]) -> CameraMount | None:
    """Return the nearest joint at or above a camera's node; None if no figure has one."""
    below: list[int] = []
    while node >= 0:
        for carrier in carriers:
            joint = carrier.joints.carrier.get(node)
            if joint is not None:
                # Without the nodes above, the rest transforms are relative to the joint.
                chain = make_joints(tree, below[::-1])
                matrix = rest_worlds(chain)[chain.carrier[below[0]]] if below else np.eye(4)
                return CameraMount(carrier.record, joint, matrix)
        below.append(node)
        node = int(tree.parents[node])
    return None


def _view(
    name: str, world: Floats, angle: float, camera: NodeCamera, mount: CameraMount | None
) -> CameraView:
    """Return a view with square pixels; scales of the node's ancestors are ignored.

    glTF projects the axis of the camera to the centre of the picture. Pixel coordinates begin at
    the centre of the first pixel, so the principal point is at (W - 1) / 2, (H - 1) / 2.
    """
    aspect = camera.aspect or _ASPECT
    width, height = max(1, round(_HEIGHT * aspect)), _HEIGHT
    focal = 0.5 * height / math.tan(0.5 * angle)
    across, down = 0.5 * (width - 1.0), 0.5 * (height - 1.0)
    rotation, translation = extrinsics(world)
    return CameraView(
        name=name,
        intrinsic=np.array([[focal, 0.0, across], [0.0, focal, down], [0.0, 0.0, 1.0]]),
        rotation=rotation,
        translation=translation,
        size=(width, height),
        near=camera.near,
        far=camera.far,
        mount=mount,
    )
