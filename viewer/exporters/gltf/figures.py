"""Figures in one glTF file: each in its pose, or at rest with its animations.

Written animations are evaluated from the file, and compared with the figure at their keys and
between them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase, note
from viewer.exporters._losses.largest_distances import evenly, largest, negligible
from viewer.exporters.gltf.body import Body, Built, add_body, body_of
from viewer.exporters.gltf.document import Document, text_of
from viewer.exporters.gltf.keyed import Clips, first_time
from viewer.exporters.gltf.losses import (
    GltfFile,
    Keys,
    Written,
    causes_of,
    first_set_note,
    gltf_losses,
    not_held,
    sides,
)
from viewer.exporters.gltf.nodes import locals_of, to_metres
from viewer.exporters.gltf.skin import shape_of
from viewer.formats._scene_graph.content import NodeChannel
from viewer.phrases import agree, counted, listed, optional
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.file_record import Json
from viewer.rigs.motion.evaluation import Frames, frames_of, still_frames
from viewer.rigs.motion.transform_clip import TransformChannel, TransformClip, sample_transforms
from viewer.rigs.pose import Pose
from viewer.rigs.scalars import length_text
from viewer.rigs.scene import Actor, still_pose
from viewer.rigs.skinning import Skinning

# Comparison of the written animations
# Maximum number of compared vertices over all times: takes about two seconds.
_MOST_VERTICES = 4_000_000
_FEWEST, _MOST = 3, 128  # minimum and maximum number of times per animation


@dataclass(frozen=True, slots=True, eq=False)
class Added:
    """A figure in a file."""

    figure: Figure
    pose: Pose | None
    """The original, in the pose that was written."""
    body: Body
    built: Built
    """The written form, and its indices in the file."""
    clips: Sequence[TransformClip] | None
    """The animations to write; None if only the pose was written."""
    kept: Mapping[int, TransformClip]
    """Animations with an effect, by index in the file."""


def add_figure(
    document: Document,
    actor: Actor,
    skinning: Skinning,
    clips: Sequence[TransformClip] | None,
    together: Clips,
    optimizes: bool,
) -> Added:
    """Add a figure at rest with its clips, or in its current pose where ``clips`` is None."""
    figure = actor.figure
    pose = actor.own_pose if clips is None else still_pose(actor)
    weights = np.zeros((1, 0)) if pose is None else pose.shape_weights[None]
    if clips is not None:
        # The weights at rest, by the rules of expressions and 0 where missing, and a row that is
        # not 0 where an animation sets a weight.
        rest = np.zeros(figure.n_shapes)
        rest[: weights.shape[1]] = weights[0]
        shapes = figure.blend_shapes
        if shapes is not None and shapes.rules is not None:
            rest = shapes.rules.shown(rest)
        weights = np.stack([rest, rest])
        keyed = (each.shapes for clip in clips for each in clip.channels)
        for moved in keyed:
            if moved is not None:
                weights[1, moved] = 1.0
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
    """Place upright figures as in their scene, by ``to_file`` (4, 4); return those nodes."""
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
        item: Json = {"name": text_of(actor.name), "children": moved}
        node = document.add("nodes", item)
        roots[:] = [root for root in roots if root not in moved] + [node]
        if not stays:
            item["matrix"] = matrix.T.ravel().tolist()
            placing.append(node)
    return placing


def figure_losses(
    added: Added, path: Path, file: GltfFile, skinning: Skinning, is_vrm: bool = False
) -> list[Diagnostic]:
    """Return notes with the largest errors of a figure, and about data that is not written."""
    kept, body, figure, notes = added.kept, added.body, added.figure, list[Diagnostic]()
    place = path, file, added.built.tree, added.built.meshes
    if added.clips is None:
        figure, frames = added.figure, still_frames(added.figure, added.pose)
        rows = np.zeros(1, dtype=np.intp)
        shape, influences = body.shape, body.influences
        notes += gltf_losses(
            Written(*place), figure, frames, rows, skinning, shape, influences, None
        )
    elif added.pose is not None:
        written = Written(*place, animations=[*kept])
        clips = [*kept.values()]
        notes += _clip_losses(written, figure, added.pose, clips, skinning, body)
        early = [clip.name for clip in clips if first_time(clip) < 0.0]
        if early:
            values = {
                "names": listed(early, 8),
                "n": counted(len(early), "animation", "begins", "begin"),
                "are": agree(len(early), "is", "are"),
            }
            notes.append(
                note(
                    "X005.negative-times: {n} before 0, which glTF does not allow, and {are} "
                    "shifted "
                    "to begin at 0: {names}",
                    **values,
                )
            )
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
        notes.append(
            note(
                "X003.idle-animations: {n} no effect on what is written and {are} omitted: {names}",
                names=listed(idle),
                n=counted(len(idle), "animation", "has", "have"),
                are=agree(len(idle), "is", "are"),
            )
        )
    moved = [placed.part.targets for placed in added.built.meshes]
    drawn = set(written[np.concatenate(moved)].tolist()) if moved else set[int]()
    keyed = [
        each.shapes.tolist() for clip in clips for each in clip.channels if each.shapes is not None
    ]
    shapes = added.figure.blend_shapes
    lost = sorted({shape for each in keyed for shape in each} - drawn)
    if lost and shapes is not None:
        values = {
            "names": listed([shapes.names[row] or f"#{row}" for row in lost]),
            "n": counted(len(lost), "blend shape"),
            "change": agree(len(lost), "changes", "change"),
        }
        notes.append(
            note(
                "X003.idle-shapes: keys of {n} that {change} no vertex are omitted: {names}",
                **values,
            )
        )
    return notes


@dataclass(frozen=True, slots=True, eq=False)
class _Samples:
    """The rest pose and all animations at some times, of the figure and of the file."""

    frames: Frames
    keys: Keys
    clips: Floats
    times: Floats
    """Animation of each row, -1 for the rest pose, and its time in seconds: (F,)."""


def _clip_losses(
    written: Written,
    figure: Figure,
    pose: Pose,
    clips: Sequence[TransformClip],
    how: Skinning,
    body: Body,
) -> list[Diagnostic]:
    """Return notes with the largest distance of a vertex, or of a joint if there is no mesh."""
    count = sum(len(placed.part.sources) for placed in written.meshes)
    each = _MOST_VERTICES // max(1, count * len(clips))
    found = _sampled(written, figure, pose, clips, min(_MOST, max(_FEWEST, each)))
    written = replace(written, keys=found.keys)
    expected, read = sides(written, figure, found.frames, how, body.shape)
    rows = np.arange(len(found.times))
    distances = largest(expected, read(None), rows)
    row = int(distances.argmax())
    least = negligible(figure, found.frames, rows)
    causes: list[Phrase] = []
    if distances[row] > least and written.meshes:
        causes = causes_of(figure, found.frames, rows, how, body.shape, body.influences, least)
    place: Phrase | str = ""
    if found.clips[row] >= 0:
        name = clips[int(found.clips[row])].name or f"animation {int(found.clips[row]) + 1}"
        place = Phrase("{name} at {time:zg} s", name=name, time=round(float(found.times[row]), 4))
    values = {
        "vertices": Phrase("vertices" if written.meshes else "joints"),
        "n": counted(len(clips), "animation"),
        "length": length_text(figure, float(distances[row])),
        "distance": float(distances[row]),
        "unit": figure.unit,
        "place": optional(" ({})", place),
        "times": counted(len(found.times), "time"),
        "causes": optional(": {}", causes),
    }
    notes = [
        note(
            "X002.animations: {vertices} differ by up to {length}{place}, compared at {times} "
            "in {n}{causes}",
            written.path,
            **values,
        )
    ]
    return notes + first_set_note(expected, read, figure, rows, least, body.influences)


def _sampled(
    written: Written, figure: Figure, pose: Pose, clips: Sequence[TransformClip], most: int
) -> _Samples:
    """Return the rest pose, and each animation at its keys and at times between them."""
    frames, owners, seconds = [still_frames(figure, pose)], [-1], [0.0]
    moved: list[tuple[int, Keys]] = []
    file = written.file
    animations = [file.animations[index].read() for index in written.animations]
    for index, (clip, keyed) in enumerate(zip(clips, animations, strict=True)):
        times = np.unique(np.concatenate([channel.times for channel in keyed]))
        times = np.union1d(times, 0.5 * (times[1:] + times[:-1]))
        times = times[evenly(len(times), most)]
        own = times + first_time(clip)
        frames.append(frames_of(figure, clip, own, pose))
        moved.append((len(seconds), _keys_at(keyed, times)))
        owners += [index] * len(times)
        seconds += own.tolist()
    keys: Keys = {}
    for start, values in moved:
        for place, rows in values.items():
            if place not in keys:
                keys[place] = np.tile(_still(file, *place), (len(seconds), 1))
            keys[place][start : start + len(rows)] = rows
    return _Samples(_one(frames), keys, np.array(owners), np.array(seconds))


def _still(file: GltfFile, node: int, path: str) -> Floats:
    """Return the value of a property that is not animated."""
    tree = file.tree
    if path == "weights":
        return file.meshes[int(tree.meshes[node])].shape_weights
    still = {"translation": tree.translations, "rotation": tree.rotations, "scale": tree.scales}
    return still[path][node]


def _one(parts: list[Frames]) -> Frames:
    """Return the concatenation of several frames."""

    def joined(name: str) -> Floats:
        arrays = []
        for part in parts:
            values = getattr(part, name)
            arrays.append(np.broadcast_to(values, (part.n_frames, *values.shape[1:])))
        return np.concatenate(arrays)

    return Frames(
        joined("times"),
        joined("present").astype(np.bool_),
        joined("rotations"),
        joined("translations"),
        joined("scales"),
        joined("shape_weights"),
        joined("figure_translations"),
        joined("figure_scales"),
    )


def _keys_at(keyed: Sequence[NodeChannel], times: Floats) -> Keys:
    """Return the animated values at times (T,), by node and path: (T, C) each."""
    channels, shapes = list[TransformChannel](), dict[int, Ints]()
    for each in keyed:
        own, joint = None, each.node
        if each.path == "weights":
            first = sum(map(len, shapes.values()))
            joint, own = -1, np.arange(first, first + each.values.shape[1], dtype=np.int32)
            shapes[each.node] = own
        rows = each.times, each.values, each.interpolation, each.tangents
        channels.append(TransformChannel(joint, each.path, *rows, own))
    found = sample_transforms(TransformClip("", tuple(channels), 0.0, 0.0), times)
    keys: Keys = {}
    for path, nodes, sampled in (
        ("rotation", found.rotated, found.rotations),
        ("translation", found.translated, found.translations),
        ("scale", found.scaled, found.scales),
    ):
        keys |= {(node, path): sampled[:, row] for row, node in enumerate(nodes.tolist())}
    columns = np.argsort(found.weighted)  # each weight is animated once
    for node, own_shapes in shapes.items():
        keys[node, "weights"] = found.shape_weights[:, columns[own_shapes]]
    return keys
