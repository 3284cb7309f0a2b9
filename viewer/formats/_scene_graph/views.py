"""Cameras of a file of nodes, as camera views that the nodes above them move."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from collections.abc import Set as AbstractSet

import numpy as np

from viewer.data_classes import dataclass
from viewer.formats._scene_graph.content import NodeCamera, NodeFile, NodeTree
from viewer.formats._scene_graph.grouping import Members
from viewer.formats._scene_graph.joints import Joints, make_joints, rest_worlds, skeleton_of
from viewer.rigs.captures.cameras import CameraMount, CameraPath, CameraView, extrinsics
from viewer.rigs.file_record import FileRecord
from viewer.rigs.hierarchy import path_to_root, with_ancestors
from viewer.rigs.motion.transform_clip import Animation

_HEIGHT = 1080  # height of a view, pixels
_ASPECT = 16.0 / 9.0  # aspect ratio of cameras that specify none


@dataclass(frozen=True, slots=True, eq=False)
class Carrier:
    """A figure whose joints can carry cameras, and the cameras that its animations move."""

    record: FileRecord
    joints: Joints
    cameras: AbstractSet[int] = frozenset()


def moved_cameras(
    file: NodeFile, groups: Sequence[Members], order: Sequence[int]
) -> list[set[int]]:
    """Return for each figure the cameras that animated nodes move, other than joints."""
    found = [set[int]() for _ in groups]
    joints = [set(each.nodes) for each in groups]
    plays = [
        {at for at, each in enumerate(file.animations) if each.nodes & {*own, *group.meshes}}
        for own, group in zip(joints, groups, strict=True)
    ]
    for node in order:
        if file.tree.cameras[node] < 0 or any(node in own for own in joints):
            continue
        path = path_to_root(file.tree.parents, node)
        above = next((at for at in path if any(at in own for own in joints)), None)
        own = path if above is None else path[: path.index(above)]
        moving = {at for at, each in enumerate(file.animations) if not each.nodes.isdisjoint(own)}
        if moving:
            # Of the figures with the nearest joint above, or of all, it belongs to the one that
            # plays most of the animations.
            owners = [at for at, each in enumerate(joints) if above is None or above in each]
            found[max(owners, key=lambda at: len(plays[at] & moving))].add(node)
    return found


def views_of(
    tree: NodeTree,
    order: list[int],
    cameras: tuple[NodeCamera, ...],
    carriers: Sequence[Carrier] = (),
    animations: Callable[[Joints], tuple[Animation, ...]] = lambda _: (),
) -> tuple[tuple[CameraView, ...], list[str]]:
    """Return perspective cameras in the space of the scene, and names of orthographic ones."""
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
            continue
        width, height = max(1, round(_HEIGHT * (camera.aspect or _ASPECT))), _HEIGHT
        focal = 0.5 * height / math.tan(0.5 * camera.vertical_angle)
        # glTF projects the axis of the camera to the centre of the picture. Pixel coordinates begin
        # at the centre of the first pixel, so the principal point is at (W - 1) / 2, (H - 1) / 2.
        across, down = 0.5 * (width - 1.0), 0.5 * (height - 1.0)
        rotation, translation = extrinsics(worlds[joints.carrier[node]])
        views.append(
            CameraView(
                name=name,
                intrinsic=np.array([[focal, 0.0, across], [0.0, focal, down], [0.0, 0.0, 1.0]]),
                rotation=rotation,
                translation=translation,
                size=(width, height),
                near=camera.near,
                far=camera.far,
                mount=_mount(tree, node, carriers, animations),
            )
        )
    return tuple(views), left_out


def _mount(
    tree: NodeTree,
    node: int,
    carriers: Sequence[Carrier],
    animations: Callable[[Joints], tuple[Animation, ...]],
) -> CameraMount | None:
    """Return the joint at or above a camera, or animated nodes below that; None without either."""
    mover = next((carrier for carrier in carriers if node in carrier.cameras), None)
    choice = carriers if mover is None else (mover,)
    owner, joint, below = mover, -1, list[int]()
    for above in path_to_root(tree.parents, node):
        found = next((each for each in choice if above in each.joints.carrier), None)
        if found is not None:
            owner, joint = found, found.joints.carrier[above]
            break
        below.append(above)
    if owner is None:
        return None
    if not below:
        return CameraMount(owner.record, joint, np.eye(4))
    # Without the nodes above, the rest transforms are relative to the joint.
    chain = make_joints(tree, below[::-1])
    path = None if mover is None else CameraPath(skeleton_of(chain), animations(chain))
    return CameraMount(owner.record, joint, rest_worlds(chain)[-1], path)
