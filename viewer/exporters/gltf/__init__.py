"""Exporter for glTF 2.0, ``.glb`` or ``.gltf`` with a ``.bin``: mesh, skin, pose and motion.

It follows the Khronos specification: ``registry.khronos.org/glTF/specs/2.0``. Lengths are in
metres, y is up. Data is not converted: a node above the figure rotates it if z is up, and scales
it if it is in another unit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase, wording
from viewer.exporters._exporter import Part, Selection
from viewer.exporters._gaps import file_spans, frames_phrase
from viewer.exporters._left_out import motion_notes, of_figure, other_animations_note, rate_note
from viewer.exporters._losses.motion_errors import resampling_losses
from viewer.exporters._motion_paths import split_paths
from viewer.exporters._options import ExportOptions
from viewer.exporters.gltf.body import Body, Built
from viewer.exporters.gltf.document import Document, named
from viewer.exporters.gltf.figures import Added, add_figure, figure_losses, place_figures
from viewer.exporters.gltf.keyed import Clips
from viewer.exporters.gltf.losses import GltfFile, Written, not_held
from viewer.exporters.gltf.materials import material_losses
from viewer.exporters.gltf.nodes import Tree, to_metres
from viewer.exporters.gltf.sampled import (
    add_sampled,
    common_name,
    motion_remarks,
    sampled_losses,
    sampled_of,
    seconds_of,
    written_part,
)
from viewer.formats import all_or_none, save_bytes
from viewer.phrases import agree, all_of, counted, file_size, listed, optional, rounded
from viewer.rigs.arrays import Floats
from viewer.rigs.captures.cameras import CameraPath, CameraView
from viewer.rigs.captures.carried_view import carrier_of, moving_alone, played_with, view_in
from viewer.rigs.figure import Figure
from viewer.rigs.file_record import Json
from viewer.rigs.geometry.rotation import matrix_to_quaternion, nearest_rotations
from viewer.rigs.geometry.transform import mean_scale
from viewer.rigs.geometry.vectors import SignedUp
from viewer.rigs.motion.transform_clip import TransformClip
from viewer.rigs.scalars import length_text
from viewer.rigs.scene import Actor, Scene, scene_unit
from viewer.rigs.skinning import Skinning
from viewer.rigs.units import METRES, UNIT_NAMES

_Extend = Callable[[Document, Body, Built], list[Diagnostic]]
# Cameras
# OpenCV's cameras look along z with y down, those of glTF along -z with y up.
_FLIP = np.diag([1.0, -1.0, -1.0])
_NEAR = 0.01  # distance of the near plane, which glTF requires, in metres: closer than any figure
# Largest distance of the principal point from the centre that is not reported, pixels: calibrations
# of a centred lens state W / 2 or, in OpenCV's coordinates, (W - 1) / 2.
_CENTRED = 0.5 + 1e-6
_EXACT = 1e-9  # tolerance for a matrix that is a rotation


def export(selection: Selection, path: Path, options: ExportOptions) -> list[Diagnostic]:
    """Write figures in their poses, with their animations, or with frames, and cameras."""
    if all(part.frames is None for part in selection.parts):
        return write_poses(selection, path, options)
    # The cameras of a scene are written together with the joints that carry them.
    if len(selection.parts) == 1 and not (selection.scene and selection.scene.views):
        return _write_motion(selection.part, path, options)
    return _write_motions(selection, path, options)


def write_poses(
    selection: Selection, path: Path, options: ExportOptions, extend: _Extend | None = None
) -> list[Diagnostic]:
    """Write figures posed, or at rest with animations; ``extend`` adds a VRM character's data."""
    scene, actors, skinning = selection.scene, selection.actors, options.skinning
    clips = [part.clips for part in selection.parts]
    document = Document(actors[0].figure.name)
    together = Clips(document)
    added = [
        add_figure(document, actor, skinning, own, together, options.optimizes)
        for actor, own in zip(actors, clips, strict=True)
    ]
    first, views = actors[0], [] if scene is None else [*scene.views]
    if scene is None or len(actors) == 1:
        own = to_metres(first.figure.up, first.figure.unit)
        to_file = own @ np.linalg.inv(first.placement)
    else:
        to_file = to_metres(scene.up, scene_unit(scene))
    built = [each.built for each in added]
    placing = place_figures(document, actors, built, to_file) if len(actors) > 1 else []
    alone = [] if scene is None else moving_alone(scene)
    if scene is not None and not any(clips):
        views = [view_in(view, scene) if view.mount and view.mount.path else view for view in views]
    pairs = [*zip(actors, built, strict=True)]
    lenses = _add_cameras(document, views, to_file, pairs, together, clips, alone)
    extensions = [] if extend is None else extend(document, added[0].body, added[0].built)
    (data,) = _files([(path, document)])
    notes = [_written(path, actors, added, len(views), len(data[path])), *extensions]
    notes += _beside(data, path, document)
    file = GltfFile(path, [*data.values()], placing)
    for actor, each in zip(actors, added, strict=True):
        own_notes = _figure_notes(path, actor, each, file, skinning, extend is not None)
        several = len(actors) > 1
        notes += [of_figure(actor, note) for note in own_notes] if several else own_notes
    return notes + lenses


def _written(
    path: Path, actors: Sequence[Actor], added: Sequence[Added], n_views: int, size: int
) -> Diagnostic:
    """Return the note about a written file."""
    animations = {index for each in added for index in each.kept}
    values: Json = {"size": file_size(size), "n": counted(len(animations), "animation")}
    cameras = [Phrase("{n}", n=counted(n_views, "camera"))] if n_views else []
    if len(actors) > 1:
        values |= {
            "figures": listed([actor.name for actor in actors]),
            "n_figures": counted(len(actors), "figure"),
        }
        if animations:
            cameras.append(Phrase("{n}", n=counted(len(animations), "animation")))
        return Diagnostic(
            "X001.gltf-figures: {n_figures}: {figures}{others}, {size}",
            path,
            values={**values, "others": optional("; {}", cameras)},
        )
    key = (
        "X001.gltf: {counts}, {size}"
        if added[0].clips is None
        else "X001.gltf-animations: {counts}, {n} with {their} own keys, {size}"
    )
    return Diagnostic(
        key,
        path,
        values={
            **values,
            "counts": all_of(added[0].built.counts + cameras),
            "their": agree(len(animations), "its", "their"),
        },
    )


def _write_motion(part: Part, path: Path, options: ExportOptions) -> list[Diagnostic]:
    """Write a figure at rest and its frames; gaps may be filled, or split into several files."""
    animation = part.animation
    sampled = sampled_of(animation, options)
    spans = file_spans(animation.frames.present, options.closing)
    paths = split_paths(path, len(spans))
    documents, built = [], []
    for span in spans:
        document = Document(animation.name)
        built.append(add_sampled(document, sampled, options, span)[0])
        documents.append(document)
    notes, lost = list[Diagnostic](), list[Diagnostic]()
    saved = _files(list(zip(paths, documents, strict=True)))
    rows = zip(paths, spans, saved, built, documents, strict=True)
    for file, span, data, made, document in rows:
        values = {
            "counts": all_of(made.counts),
            "frames": frames_phrase(animation.first_frame + span[0], span[1] - span[0]),
            "rate": animation.frame_rate,
            "size": file_size(len(data[file])),
        }
        notes += [
            Diagnostic(
                "X001.gltf-motion: {counts}, {frames} at {rate:g} fps, {size}", file, values=values
            ),
            *_beside(data, file, document),
        ]
        notes += _quantization(file, made, animation.figure)
        written = Written(file, GltfFile(file, [*data.values()]), made.tree, made.meshes, span[0])
        lost += sampled_losses(written, sampled, options, span)
    notes += _remarks(sampled.body, sampled.up) + motion_remarks(sampled, options)
    lost += resampling_losses(path, animation, options.skinning)
    lost += not_held(animation.figure, sampled.body.shape)
    return notes + lost + motion_notes(animation)


def _write_motions(selection: Selection, path: Path, options: ExportOptions) -> list[Diagnostic]:
    """Write figures placed as in their scene, with one animation that moves them all."""
    parts = [part for part in selection.parts if part.frames is not None]
    others = [part.actor for part in selection.parts if part.frames is None]
    scene = Scene(list(selection.actors)) if selection.scene is None else selection.scene
    document, actors = Document(path.stem), [*(part.actor for part in parts), *others]
    found = [
        sampled_of(each.animation, replace(options, world_up=each.up), each.actor.color)
        for each in parts
    ]
    # Figures keep their relative times; the earliest frame of all is at 0.
    begin, name, index = min(each.start for each in parts), common_name(parts, path.stem), -1
    built = []
    for part, sampled in zip(parts, found, strict=True):
        delay = part.start - begin
        made, index = add_sampled(document, sampled, options, None, delay, name, index)
        built.append(made)
    together, how = Clips(document), options.skinning
    added = [
        add_figure(document, actor, how, None, together, options.optimizes) for actor in others
    ]
    to_file = to_metres(scene.up, scene_unit(scene))
    built += [each.built for each in added]
    placing = place_figures(document, actors, built, to_file)
    lenses = _add_cameras(document, scene.views, to_file, [*zip(actors, built, strict=True)])
    (data,) = _files([(path, document)])
    seconds = max(each.start + seconds_of(each.animation) for each in parts) - begin
    cameras = [Phrase("{n}", n=counted(len(scene.views), "camera"))] if scene.views else []
    values = {
        "n_figures": counted(len(actors), "figure"),
        "figures": listed([actor.name for actor in actors]),
        "seconds": rounded(seconds, 4),
        "others": optional("; {}", cameras),
        "size": file_size(len(data[path])),
    }
    notes = [
        Diagnostic(
            "X001.gltf-motions: {n_figures}: {figures}; one animation of {seconds} s{others}, "
            "{size}",
            path,
            values=values,
        ),
        *_beside(data, path, document),
    ]
    file = GltfFile(path, [*data.values()], placing)
    for part, sampled, made in zip(parts, found, built, strict=False):
        own = _quantization(path, made, sampled.animation.figure) + _remarks(sampled.body, part.up)
        own += motion_remarks(sampled, options)
        own += sampled_losses(written_part(path, file, made), sampled, options)
        own += resampling_losses(path, sampled.animation, how) + rate_note(sampled.animation)
        own += not_held(sampled.animation.figure, sampled.body.shape)
        own += other_animations_note(part.animation.figure, part.animation.motion)
        notes += [of_figure(part.actor, note) for note in own]
    for actor, each in zip(others, added, strict=True):
        notes += [of_figure(actor, note) for note in _figure_notes(path, actor, each, file, how)]
    return notes + lenses


def _figure_notes(
    path: Path, actor: Actor, added: Added, file: GltfFile, how: Skinning, is_vrm: bool = False
) -> list[Diagnostic]:
    """Return the notes about a figure in its pose or with its own animations."""
    notes = _quantization(path, added.built, actor.figure) + _remarks(added.body, actor.figure.up)
    return notes + figure_losses(added, path, file, how, is_vrm=is_vrm)


def _files(documents: list[tuple[Path, Document]]) -> list[dict[Path, bytes]]:
    """Write all files or none; return their contents."""
    saved: list[dict[Path, bytes]] = []
    for path, document in documents:
        if path.suffix.lower() == ".gltf":
            beside = path.with_suffix(".bin")
            text, arrays = document.pair(beside.name)
            saved.append({path: text, **({beside: arrays} if arrays else {})})
        else:
            saved.append({path: document.glb()})
    with all_or_none([file for files in saved for file in files]):
        for files in saved:
            for file, data in files.items():
                save_bytes(file, data)
    return saved


def _beside(data: dict[Path, bytes], path: Path, document: Document) -> list[Diagnostic]:
    """Return notes about the file of arrays, and about numbers that JSON cannot store."""
    others = {file: len(content) for file, content in data.items() if file != path}
    notes = [
        Diagnostic("X001.gltf-arrays: array data, {size}", file, values={"size": file_size(size)})
        for file, size in others.items()
    ]
    if document.n_omitted:
        notes.append(
            Diagnostic(
                "X003.json-numbers: {n} of the original file {are} omitted, or 0 in lists: JSON "
                "cannot store {them}",
                path,
                values={
                    "n": counted(document.n_omitted, "infinite or undefined number"),
                    "are": agree(document.n_omitted, "is", "are"),
                    "them": agree(document.n_omitted, "it", "them"),
                },
            )
        )
    return notes


def _quantization(path: Path, built: Built, figure: Figure) -> list[Diagnostic]:
    """Return a note with the largest rounding errors of quantised attributes, if there are any."""
    errors = built.errors
    if not errors:
        return []
    parts = []
    if "positions" in errors:
        length = length_text(figure, errors["positions"])
        parts.append(Phrase("{length} in positions", length=length))
    for kind, factor, text in (
        ("normals", 180.0 / np.pi, "{error} degrees in normals"),
        ("uvs", 1.0, "{error} in texture coordinates"),
        ("weights", 1.0, "{error} in weights"),
    ):
        if kind in errors:
            parts.append(Phrase(text, error=f"{factor * errors[kind]:.2g}"))
    return [
        Diagnostic(
            "X002.quantized: quantised with rounding errors of up to {parts}",
            path,
            values={"parts": all_of(parts)},
        )
    ]


def _remarks(body: Body, up: SignedUp) -> list[Diagnostic]:
    """Return notes about coordinate space and shape for users of the file."""
    figure, notes = body.figure, list[Diagnostic]()
    if up == "z":
        notes.append(
            Diagnostic(
                "X005.z-up: z is up: a node above the figure rotates it by -90 degrees about x"
            )
        )
    if METRES.get(figure.unit, 1.0) != 1.0:
        values = {"unit": UNIT_NAMES[figure.unit], "factor": METRES[figure.unit]}
        notes.append(
            Diagnostic(
                "X005.unit-scaled: lengths are in {unit}: a node above the figure scales them to "
                "metres by {factor:g}",
                values=values,
            )
        )
    elif figure.unit not in METRES:
        notes.append(Diagnostic(wording.UNIT_UNKNOWN_METRES, values={"figure": figure.name}))
    if figure.mesh is not None:
        notes += material_losses(figure.mesh)
    if figure.mesh is not None and figure.mesh.n_vertices == 0:
        notes.append(Diagnostic("X003.empty-mesh: the mesh has no vertices and is omitted"))
    if body.shape.baked is not None:
        notes.append(Diagnostic("X005.shape-baked: the shape is baked into mesh and joints"))
    if len(body.shape.targets):
        count = len(body.shape.targets)
        notes.append(
            Diagnostic(
                "X005.morph-targets: {n}",
                values={
                    "n": counted(count, "blend shape", "is a morph target", "are morph targets")
                },
            )
        )
        shapes = figure.blend_shapes
        if shapes is not None and shapes.normal_offsets is None:
            notes.append(
                Diagnostic(
                    "X005.morph-normals: morph targets change positions only: glTF does not "
                    "recompute "
                    "normals"
                )
            )
    if body.influences is not None and body.influences.n_fixed:
        unbound = int(body.influences.n_fixed)
        notes.append(
            Diagnostic(
                'X005.no-influence: {n} without influence: bound to the node "fixed", which never '
                "moves",
                values={"n": counted(unbound, "vertex")},
            )
        )
    return notes


def _add_cameras(
    document: Document,
    views: Sequence[CameraView],
    to_file: Floats,
    written: Sequence[tuple[Actor, Built]],
    together: Clips | None = None,
    clips: Sequence[Sequence[TransformClip] | None] = (),
    alone: Sequence[str] = (),
) -> list[Diagnostic]:
    """Add a scene's cameras, by ``to_file`` (4, 4); return notes about what glTF cannot store."""
    nodes, moving = document.root["nodes"], dict.fromkeys(alone)
    keyed = dict(zip([actor for actor, _ in written], clips, strict=False))
    built, actors = dict(written), [actor for actor, _ in written]
    for view in views:
        camera = named(view.name)
        focal_x, focal_y = float(view.intrinsic[0, 0]), float(view.intrinsic[1, 1])
        width, height = view.picture_size
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
    notes = []
    if bent:
        values = {"n": len(bent), "names": listed(bent), "are": agree(len(bent), "is", "are")}
        notes.append(
            Diagnostic(
                "X003.camera-lenses: glTF cannot store lens distortion, skew or principal points, "
                "which {are} omitted: {names}",
                values=values,
            )
        )
    if moving:
        n = len(moving)
        notes.append(
            Diagnostic(
                "X003.camera-motions: {n} written at the first frame only, without {their} motion: "
                "{names}",
                values={
                    "n": counted(n, "camera", "is", "are"),
                    "names": listed([*moving]),
                    "their": agree(n, "its", "their"),
                },
            )
        )
    return notes


def _is_kept(path: CameraPath, clips: Sequence[TransformClip]) -> bool:
    """Return whether all animations of a camera belong to some clips of a figure."""
    numbers = {clip.number for clip in clips}
    return all(animation.number in numbers for animation in path.animations)


def _add_path(
    document: Document,
    path: CameraPath,
    item: Json,
    together: Clips,
    clips: Sequence[TransformClip],
) -> int:
    """Add the nodes above a camera and their keys in some clips; return the topmost node."""
    rest, made = path.nodes, list[int]()
    for joint, parent in enumerate(rest.parents.tolist()):
        node = named(rest.names[joint])
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
    scale = mean_scale(to_file)
    near = _NEAR if view.near is None else scale * view.near
    return {"znear": near} | ({} if view.far is None else {"zfar": scale * view.far})


def _is_bent(view: CameraView) -> bool:
    """Return whether a lens is distorted, skewed or off centre."""
    width, height = view.picture_size
    apart = view.intrinsic[:2, 2] - (0.5 * (width - 1.0), 0.5 * (height - 1.0))
    is_off = bool((np.abs(apart) > _CENTRED).any()) or view.intrinsic[0, 1] != 0.0
    return is_off or bool(view.distortion.any())
