"""Figures in one glTF file: each in its pose, or at rest with its animations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.export._gltf.body import Body, Built, add_body, body_of
from viewer.export._gltf.clip_losses import clip_losses, shape_rows, shown_weights
from viewer.export._gltf.document import Document, text_of
from viewer.export._gltf.keyed import Clips, first_time
from viewer.export._gltf.losses import Written, gltf_losses, not_held
from viewer.export._gltf.nodes import locals_of, to_metres
from viewer.export._gltf.reading import GltfFile
from viewer.export._gltf.shape import shape_of
from viewer.rig.arrays import Floats
from viewer.rig.blendshapes import BlendShapes
from viewer.rig.figure import Figure
from viewer.rig.motion.own_animations import still_pose
from viewer.rig.motion.single_frame import pose_frames
from viewer.rig.motion.transform_clip import TransformClip
from viewer.rig.pose import Pose
from viewer.rig.scene import Actor
from viewer.rig.skinning import Skinning

__all__ = ["Added", "add_figure", "figure_losses", "place_figures"]


@dataclass(frozen=True, slots=True, eq=False)
class Added:
    """A figure in a file.

    Attributes
    ----------
    figure, pose : Figure, Pose or None
        The original, in the pose that was written.
    body, built : Body, Built
        The written form, and its indices in the file.
    clips : sequence of TransformClip or None
        The animations to write; None if only the pose was written.
    kept : dict of TransformClip
        Animations with an effect, by index in the file.
    """

    figure: Figure
    pose: Pose | None
    body: Body
    built: Built
    clips: Sequence[TransformClip] | None
    kept: Mapping[int, TransformClip]


def add_figure(
    document: Document,
    actor: Actor,
    skinning: Skinning,
    clips: Sequence[TransformClip] | None,
    together: Clips,
    optimizes: bool,
) -> Added:
    """Add a figure to a file.

    ``document``: modified in place.
    ``clips``: its motions, which are written at rest; None to write its current pose.
    ``together``: the animations of the file.
    ``optimizes``: whether to quantise vertex attributes.
    Raises RigError if a number exceeds single precision.
    """
    figure = actor.figure
    pose = actor.pose if clips is None else still_pose(actor)
    weights = np.zeros((1, 0)) if pose is None else pose.shape_weights[None]
    if clips is not None:
        weights = shape_rows(clips, shown_weights(figure, weights[0]))
    shape = shape_of(figure, weights)
    body = body_of(figure, replace(shape, weights=shape.weights[:1]), skinning)
    skeleton, still = body.figure.skeleton, None
    if skeleton is not None and pose is not None:
        still = locals_of(skeleton, pose)
    built = add_body(document, body, figure.up, pose, still, actor.color, optimizes=optimizes)
    kept = together.add(clips or (), built.tree, built.meshes, shape.targets, weights[0])
    return Added(figure, pose, body, built, clips, kept)


def place_figures(
    document: Document, actors: Sequence[Actor], built: Sequence[Built], to_file: Floats
) -> list[int]:
    """Place several figures as in their scene; return the nodes that move them.

    ``actors``: the figures, each upright in its own space.
    ``built``: their contents in the file.
    ``to_file`` (4, 4): scene space to the space of the file.
    """
    roots, placing = document.root["scenes"][0]["nodes"], list[int]()
    for actor, each in zip(actors, built, strict=True):
        own = to_metres(actor.figure.up, actor.figure.unit)
        matrix = to_file @ actor.placement @ np.linalg.inv(own)
        stays = np.allclose(matrix, np.eye(4), rtol=0.0, atol=1e-12)
        if each.tree.place >= 0:
            document.root["nodes"][each.tree.place]["name"] = text_of(actor.name)
        # A root that only converts units or axes does not have the name of the figure.
        if stays and each.tree.root in (each.tree.place, *each.tree.joints):
            continue
        # Nodes of skinned meshes stay roots, because their transforms have no effect.
        moved = [root for root in each.roots if "skin" not in document.root["nodes"][root]]
        item: dict[str, Any] = {"name": text_of(actor.name), "children": moved}
        node = document.add("nodes", item)
        roots[:] = [root for root in roots if root not in moved] + [node]
        if not stays:
            item["matrix"] = matrix.T.ravel().tolist()
            placing.append(node)
    return placing


def figure_losses(
    added: Added, path: Path, file: GltfFile, skinning: Skinning, is_vrm: bool = False
) -> list[Diagnostic]:
    """Return notes with the largest errors of a figure, and about data that is not written.

    ``is_vrm``: whether its extensions contain the data that only VRM supports.
    """
    kept, body, figure, notes = added.kept, added.body, added.figure, list[Diagnostic]()
    place = path, file, added.built.tree, added.built.meshes
    if added.clips is None:
        figure, frames = pose_frames(added.figure, added.pose)
        rows = np.zeros(1, dtype=np.intp)
        shape, influences = body.shape, body.influences
        notes += gltf_losses(
            Written(*place), figure, frames, rows, skinning, shape, influences, None
        )
    elif added.pose is not None:
        written = Written(*place, animations=[*kept])
        clips = [*kept.values()]
        notes += clip_losses(written, figure, added.pose, clips, skinning, body)
        early = [clip.name for clip in clips if first_time(clip) < 0.0]
        if early:
            values = {"names": early, "n": len(early)}
            notes.append(Diagnostic("X005.negative-times", values=values))
        notes += _without_effect(added, added.clips)
    return notes + not_held(figure, body.shape, is_vrm)


def _without_effect(added: Added, clips: Sequence[TransformClip]) -> list[Diagnostic]:
    """Return notes about animations and blend shapes whose keys move nothing that is written."""
    notes, written = list[Diagnostic](), added.body.shape.targets
    kept = {id(clip) for clip in added.kept.values()}
    idle = [
        clip.name or f"animation {number}"
        for number, clip in enumerate(clips, 1)
        if id(clip) not in kept
    ]
    if idle:
        notes.append(Diagnostic("X003.idle-animations", values={"names": idle, "n": len(idle)}))
    moved = [placed.part.targets for placed in added.built.meshes]
    drawn = set(written[np.concatenate(moved)].tolist()) if moved else set[int]()
    keyed = [
        each.shapes.tolist() for clip in clips for each in clip.channels if each.shapes is not None
    ]
    shapes = added.figure.blend_shapes
    lost = sorted({shape for each in keyed for shape in each} - drawn)
    if lost and shapes is not None:
        values = {"names": _names(shapes, lost), "n": len(lost)}
        notes.append(Diagnostic("X003.idle-shapes", values=values))
    return notes


def _names(shapes: BlendShapes, rows: list[int]) -> list[str]:
    return [shapes.names[row] or f"#{row}" for row in rows]
