"""Cameras of a scene in a glTF file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from viewer.diagnostics import Diagnostic
from viewer.export._gltf.body import Built
from viewer.export._gltf.document import Document, text_of
from viewer.export._gltf.keyed import Clips
from viewer.export._gltf.nodes import Tree
from viewer.rig.arrays import Floats
from viewer.rig.captures.camera_view import CameraPath, CameraView
from viewer.rig.captures.carried_view import carrier_of, played_with
from viewer.rig.geometry.rotation import matrix_to_quaternion, nearest_rotations
from viewer.rig.motion.transform_clip import TransformClip
from viewer.rig.scene import Actor

__all__ = ["add_cameras"]

# OpenCV's cameras look along z with y down, those of glTF along -z with y up.
_FLIP = np.diag([1.0, -1.0, -1.0])
_NEAR = 0.01  # distance of the near plane, which glTF requires, in metres: closer than any figure
# Largest distance of the principal point from the centre that is not reported, pixels: calibrations
# of a centred lens state W / 2 or, in OpenCV's coordinates, (W - 1) / 2.
_CENTRED = 0.5 + 1e-6
_EXACT = 1e-9  # tolerance for a matrix that is a rotation


def add_cameras(
    document: Document,
    views: Sequence[CameraView],
    to_file: Floats,
    written: Sequence[tuple[Actor, Built]],
    together: Clips | None = None,
    clips: Sequence[Sequence[TransformClip] | None] = (),
    alone: Sequence[str] = (),
) -> list[Diagnostic]:
    """Add the cameras of a scene; return notes about what glTF cannot store.

    ``document``: modified in place; already has a scene.
    ``views``: the cameras, in the space of the scene.
    ``to_file`` (4, 4): scene space to the space of the file.
    ``written``: the figures of the file, whose joints carry some of the cameras.
    ``together``, ``clips``: the animations of the file, and those written for each figure.
    ``alone``: names of cameras whose motion is not written.
    """
    nodes, moving = document.root["nodes"], dict.fromkeys(alone)
    keyed = dict(zip([actor for actor, _ in written], clips, strict=False))
    built, actors = dict(written), [actor for actor, _ in written]
    for view in views:
        camera: dict[str, Any] = {"name": text_of(view.name)} if view.name else {}
        focal_x, focal_y = float(view.intrinsic[0, 0]), float(view.intrinsic[1, 1])
        width, height = _size(view)
        angle = 2.0 * math.atan(0.5 * height / focal_y)
        aspect = (width / focal_x) / (height / focal_y)
        lens = {"yfov": angle, "aspectRatio": aspect, **_planes(view, to_file)}
        index = document.add("cameras", {**camera, "type": "perspective", "perspective": lens})
        item = {**camera, "camera": index}
        carrier, mount = carrier_of(view, actors), view.mount
        path = None if carrier is None or mount is None else mount.path
        played = () if carrier is None or path is None else keyed.get(carrier) or ()
        if view.motion is not None or (path is not None and not _is_kept(path, played)):
            moving.setdefault(view.name)
        if carrier is not None and mount is not None and (mount.joint >= 0 or played):
            if path is not None and together is not None and played:
                node = _add_path(document, path, item, together, played)
            else:
                node = document.add("nodes", {**item, **_placed(mount.matrix)})
            if mount.joint >= 0:
                joint = built[carrier].tree.joints[mount.joint]
                nodes[joint].setdefault("children", []).append(node)
                continue
            matrix = to_file @ carrier.placement
            if np.abs(matrix - np.eye(4)).max() > _EXACT:
                name = f"above {nodes[node].get('name', 'camera')}"
                node = document.add("nodes", {"name": name, "children": [node], **_placed(matrix)})
            document.root["scenes"][0]["nodes"].append(node)
            continue
        center = to_file @ np.append(-view.rotation.T @ view.translation, 1.0)
        turned = nearest_rotations(to_file[:3, :3])[0] @ view.rotation.T @ _FLIP
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = turned, center[:3]
        node = document.add("nodes", {**item, **_placed(matrix)})
        document.root["scenes"][0]["nodes"].append(node)
    bent = [view.name for view in views if _is_bent(view)]
    found = {"X003.camera-lenses": bent, "X003.camera-motions": [*moving]}
    return [
        Diagnostic(key, values={"n": len(names), "names": names})
        for key, names in found.items()
        if names
    ]


def _is_kept(path: CameraPath, clips: Sequence[TransformClip]) -> bool:
    """Return whether all animations of a camera belong to some clips of a figure."""
    numbers = {clip.number for clip in clips}
    return all(animation.number in numbers for animation in path.animations)


def _add_path(
    document: Document,
    path: CameraPath,
    item: dict[str, Any],
    together: Clips,
    clips: Sequence[TransformClip],
) -> int:
    """Add the nodes above a camera and their keys in some clips; return the topmost node.

    ``item``: the members of the camera's node other than its transform.
    """
    rest, made = path.nodes, list[int]()
    for joint, parent in enumerate(rest.parents.tolist()):
        node: dict[str, Any] = {"name": text_of(rest.names[joint])} if rest.names[joint] else {}
        node |= item if joint == rest.n_joints - 1 else {}
        node["translation"] = rest.rest_translations[joint].tolist()
        node["rotation"] = rest.rest_rotations[joint].tolist()
        node["scale"] = rest.rest_scales[joint].tolist()
        made.append(document.add("nodes", node))
        if parent >= 0:
            document.root["nodes"][made[parent]]["children"] = [made[joint]]
    found = [played_with(path, clip) for clip in clips]
    own = [animation.clip() for animation in found if animation is not None]
    none = np.zeros(0, dtype=np.int32)
    together.add(own, Tree(made[0], -1, made, []), (), none, np.zeros(0))
    return made[0]


def _placed(matrix: Floats) -> dict[str, list[float]]:
    """Return the members of a node with a transform."""
    linear = matrix[:3, :3]
    if np.abs(linear @ linear.T - np.eye(3)).max() > _EXACT or np.linalg.det(linear) < 0.0:
        return {"matrix": matrix.T.ravel().tolist()}
    rotation = matrix_to_quaternion(linear)
    return {"translation": matrix[:3, 3].tolist(), "rotation": rotation.tolist()}


def _planes(view: CameraView, to_file: Floats) -> dict[str, float]:
    """Return the distances of the clipping planes."""
    scale = float(np.cbrt(abs(np.linalg.det(to_file[:3, :3]))))
    near = _NEAR if view.near is None else scale * view.near
    return {"znear": near} | ({} if view.far is None else {"zfar": scale * view.far})


def _size(view: CameraView) -> tuple[float, float]:
    """Return the width and height of the images; centred about the principal point if unknown."""
    if view.size is not None:
        return float(view.size[0]), float(view.size[1])
    return 2.0 * float(view.intrinsic[0, 2]) + 1.0, 2.0 * float(view.intrinsic[1, 2]) + 1.0


def _is_bent(view: CameraView) -> bool:
    """Return whether a lens is distorted, skewed or off centre."""
    width, height = _size(view)
    apart = view.intrinsic[:2, 2] - (0.5 * (width - 1.0), 0.5 * (height - 1.0))
    is_off = bool((np.abs(apart) > _CENTRED).any()) or view.intrinsic[0, 1] != 0.0
    return is_off or bool(view.distortion.any())
