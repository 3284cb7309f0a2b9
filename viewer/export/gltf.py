"""Exporter of glTF 2.0, ``.glb`` or ``.gltf`` with a ``.bin``: mesh, skin, pose and motion.

It follows the Khronos specification: ``registry.khronos.org/glTF/specs/2.0``. Lengths are in
metres, y is up. Data is not converted: a node above the figure rotates it if z is up, and scales
it if it is in another unit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase
from viewer.errors import RigError
from viewer.export._gaps import filled, frames_phrase, gaps_note, runs
from viewer.export._gltf.document import Document, text_of
from viewer.export._gltf.losses import Written, gltf_losses, not_held
from viewer.export._gltf.materials import Color, Materials, material_losses
from viewer.export._gltf.mesh import add_mesh
from viewer.export._gltf.motion import add_animation, moving, still_locals
from viewer.export._gltf.nodes import Locals, Tree, add_nodes, locals_of
from viewer.export._gltf.parts import parts_of
from viewer.export._gltf.reading import Placed, parsed
from viewer.export._gltf.records import add_record
from viewer.export._gltf.shape import Shape, shape_of
from viewer.export._gltf.skin import Influences, influences_of, inverse_bind_matrices
from viewer.export._losses.between import resampling_losses
from viewer.export._motion_paths import split_paths
from viewer.export._options import GAPS, MotionOptions
from viewer.formats import all_or_none, save_bytes
from viewer.rig.figure import Figure
from viewer.rig.motion.evaluation import Frames, frames_between
from viewer.rig.motion.sampled_animation import SampledAnimation
from viewer.rig.motion.single_frame import pose_frames
from viewer.rig.pose import Pose
from viewer.rig.scene import Actor, figure_pose
from viewer.rig.skeleton import joint_label
from viewer.rig.skinning import Skinning, skin_used
from viewer.rig.units import METRES, UNIT_NAMES

__all__ = ["export", "export_animation"]


def export(actor: Actor, path: Path, skinning: Skinning) -> list[Diagnostic]:
    """Write a figure in its current pose; see ``viewer.export.export``."""
    figure, pose = actor.figure, actor.pose
    weights = np.zeros((1, 0)) if pose is None else pose.shape_weights[None]
    body = _body_of(figure, shape_of(figure, weights), skinning)
    skeleton, still = body.shape.figure.skeleton, None
    if skeleton is not None and pose is not None:
        still = locals_of(skeleton, pose)
    document = Document(figure.name)
    built = _add_body(document, body, figure.up, pose, still, actor.color)
    (data,) = _files([(path, document)])
    written = {"counts": built.counts, "size": len(data[path])}
    notes = [Diagnostic("X001.gltf", path, values=written)]
    notes += _beside(data, path) + _remarks(body, figure.up)
    file = Written(path, parsed([*data.values()]), built.tree, built.meshes)
    figure, frames = pose_frames(figure, pose)
    rows = np.zeros(1, dtype=np.intp)
    notes += gltf_losses(file, figure, frames, rows, skinning, body.shape, body.influences, None)
    return notes + not_held(figure, body.shape)


def export_animation(
    animation: SampledAnimation, path: Path, options: MotionOptions
) -> list[Diagnostic]:
    """Write a figure at rest and its motion; see ``viewer.export.export_animation``.

    A changing shape that must be baked into the mesh is taken from the first present frame.

    Parameters
    ----------
    animation : SampledAnimation
        A figure in many poses.
    path : Path
        The file; ``gaps="split"`` writes ``name-1.glb``, ``name-2.glb`` … if there are gaps.
    options : MotionOptions
        Handling of gaps, skinning, and up axis of the world.

    Returns
    -------
    list of Diagnostic
        Notes: the written files, then the data that the format cannot store, with errors.

    Raises
    ------
    RigError
        If no frame is present, numbers are not finite, or an option is unknown.
    OutputError
        If a file cannot be written.
    """
    _check(animation, options)
    present = animation.frames.present
    frames = filled(animation.frames, options.closing == "interpolate")
    reference = int(present.argmax())
    shape = shape_of(animation.figure, frames.shape_weights, reference)
    body = _body_of(animation.figure, shape, options.skinning)
    spans = [(0, frames.n_frames)]
    if options.closing == "split" and not present.all():
        spans = runs(present)
    paths = split_paths(path, len(spans))
    documents, built = [], []
    for start, stop in spans:
        document = Document(animation.name)
        built.append(
            _add_animation(document, animation, body, frames, (start, stop), options.world_up)
        )
        documents.append(document)
    notes, lost = list[Diagnostic](), list[Diagnostic]()
    saved = _files(list(zip(paths, documents, strict=True)))
    for file, (start, stop), data, made in zip(paths, spans, saved, built, strict=True):
        values = {
            "counts": made.counts,
            "frames": frames_phrase(animation.first_frame + start, stop - start),
            "rate": animation.frame_rate,
            "size": len(data[file]),
        }
        notes += [Diagnostic("X001.gltf-motion", file, values=values), *_beside(data, file)]
        written = Written(file, parsed([*data.values()]), made.tree, made.meshes, start)
        rows = start + np.flatnonzero(present[start:stop])
        lost += gltf_losses(
            written,
            animation.figure,
            frames,
            rows,
            options.skinning,
            shape,
            body.influences,
            animation.first_frame,
        )
    notes += _remarks(body, options.world_up) + _motion_remarks(animation, body, frames, options)
    lost += resampling_losses(path, animation, options.skinning)
    return notes + lost + not_held(animation.figure, shape)


def _check(animation: SampledAnimation, options: MotionOptions) -> None:
    for what, value, known in (
        ("unit", options.unit, ("", "m")),
        ("up axis", options.up, ("", "y")),
        ("up axis of the scene", options.world_up, ("y", "z")),
        ("handling of gaps", options.closing, tuple(GAPS)),
    ):
        if value not in known:
            listed = ", ".join(filter(None, known))
            one = "one of " * (len(list(filter(None, known))) > 1)
            raise RigError(f'{what} of glTF: expected {one}{listed}, found "{value}"')
    if not animation.frames.present.any():
        raise RigError(f"{animation.name}: every frame is missing: there is nothing to write")


@dataclass(frozen=True, slots=True, eq=False)
class _Body:
    """Data shared by all files of an export."""

    shape: Shape
    influences: Influences | None  # None if the mesh is not skinned

    @property
    def figure(self) -> Figure:
        """The figure as written."""
        return self.shape.figure


@dataclass(frozen=True, slots=True)
class _Built:
    """Indices and summary of one file's contents."""

    tree: Tree
    meshes: list[Placed]
    counts: list[Phrase]


def _body_of(figure: Figure, shape: Shape, skinning: Skinning) -> _Body:
    if figure.mesh is None and figure.skeleton is None:
        raise RigError(f"figure {figure.name} has neither mesh nor skeleton to write as glTF")
    if not figure.is_attached or figure.skin is None:
        return _Body(shape, None)
    return _Body(shape, influences_of(skin_used(figure.skin, skinning)))


def _add_body(
    document: Document,
    body: _Body,
    up: str,
    pose: Pose | None,
    still: Locals | None,
    color: Color | None = None,
    is_still: bool = True,
) -> _Built:
    """Add nodes, meshes and skin of a figure; return their indices and counts.

    ``is_still``: whether the figure as a whole does not move.
    """
    figure, influences = body.figure, body.influences
    fixes, record = influences is not None and influences.n_fixed > 0, figure.record
    bare = record is not None and is_still
    tree = add_nodes(
        document, figure.name, up, figure.unit, figure.skeleton, pose, still, fixes, bare
    )
    if record is not None:
        add_record(document, record, tree.joints)
    scene, counts, meshes = [tree.root], list[Phrase](), list[Placed]()
    if figure.mesh is not None and figure.mesh.n_vertices:
        meshes = _add_meshes(document, body, tree, color)
        scene += _place_meshes(document, body, tree, meshes)
        written, before = sum(len(each.part.sources) for each in meshes), figure.mesh.n_vertices
        key = "written-vertices" if written == before else "split-vertices"
        counts = [Phrase(key, n=written, before=before)]
        counts.append(Phrase("written-triangles", n=figure.mesh.n_triangles))
    if figure.skeleton is not None:
        counts.append(Phrase("written-joints", n=figure.skeleton.n_joints))
    document.root["scene"] = document.add("scenes", {"nodes": scene})
    return _Built(tree, meshes, counts)


def _add_meshes(document: Document, body: _Body, tree: Tree, color: Color | None) -> list[Placed]:
    """Add the parts of a figure, each with its node."""
    figure, meshes = body.figure, list[Placed]()
    materials = Materials(document, figure.require_mesh(), color)
    record = figure.record
    for part in parts_of(f"{figure.name} mesh", body.shape, body.influences):
        mesh = add_mesh(document, materials, part, body.shape, body.influences)
        if part.joint >= 0:
            node = tree.joints[part.joint]
            document.root["nodes"][node]["mesh"] = mesh
        else:
            item: dict[str, Any] = {"name": text_of(part.name)} if part.name else {}
            if record is not None and part.index in record.part_extras:
                item["extras"] = record.part_extras[part.index]
            node = document.add("nodes", {**item, "mesh": mesh})
        meshes.append(Placed(node, part))
    return meshes


def _place_meshes(document: Document, body: _Body, tree: Tree, meshes: list[Placed]) -> list[int]:
    """Bind the meshes that have nodes of their own; return those that are roots of the scene."""
    nodes = document.root["nodes"]
    own = [placed.node for placed in meshes if placed.part.joint < 0]
    influences, skin = body.influences, body.figure.skin
    if not own:
        return []
    if influences is None or skin is None:
        nodes[tree.place].setdefault("children", []).extend(own)
        return []
    bound = document.array(inverse_bind_matrices(influences, skin.inverse_bind), "MAT4")
    item = {"name": text_of(body.figure.name), "joints": tree.joints + tree.fixed}
    index = document.add("skins", {**item, "inverseBindMatrices": bound})
    for node in own:
        nodes[node]["skin"] = index
    return own  # glTF ignores the transform of a skinned mesh's own node


def _add_animation(
    document: Document,
    animation: SampledAnimation,
    body: _Body,
    frames: Frames,
    span: tuple[int, int],
    up: str,
) -> _Built:
    """Add a figure at rest, and a range of frames as an animation."""
    skeleton = body.figure.require_skeleton()
    part = frames_between(frames, slice(*span))
    pose = figure_pose(animation.figure)
    rest = locals_of(skeleton, pose)
    pose.figure_translation = part.figure_translations[0]
    pose.figure_scale = float(part.figure_scales[0])
    weights = body.shape.weights
    if len(weights) > 1:
        weights = weights[slice(*span)]
        body = replace(body, shape=replace(body.shape, weights=weights))
    is_still = not np.ptp(part.figure_translations, axis=0).any() and not np.ptp(part.figure_scales)
    locals_ = still_locals(skeleton, rest, part)
    built = _add_body(document, body, up, pose, locals_, is_still=is_still)
    morphs = [
        (placed.node, own)
        for placed in built.meshes
        if np.ptp(own := weights[:, placed.part.targets], axis=0).any()
    ]
    name = animation.motion.name or animation.name
    add_animation(document, name, animation.frame_rate, skeleton, part, built.tree, morphs)
    return built


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


def _beside(data: dict[Path, bytes], path: Path) -> list[Diagnostic]:
    others = {file: len(content) for file, content in data.items() if file != path}
    return [
        Diagnostic("X001.gltf-arrays", file, values={"size": size}) for file, size in others.items()
    ]


def _remarks(body: _Body, up: str) -> list[Diagnostic]:
    """Return notes about coordinate space and shape for users of the file."""
    figure, notes = body.figure, list[Diagnostic]()
    if up == "z":
        notes.append(Diagnostic("X005.z-up"))
    if METRES.get(figure.unit, 1.0) != 1.0:
        values = {"unit": UNIT_NAMES[figure.unit], "factor": METRES[figure.unit]}
        notes.append(Diagnostic("X005.unit-scaled", values=values))
    elif figure.unit not in METRES:
        notes.append(Diagnostic("X005.unit-unknown-metres", values={"figure": figure.name}))
    if figure.mesh is not None:
        notes += material_losses(figure.mesh)
    if figure.mesh is not None and figure.mesh.n_vertices == 0:
        notes.append(Diagnostic("X003.empty-mesh"))
    if body.shape.baked is not None:
        notes.append(Diagnostic("X005.shape-baked"))
    if len(body.shape.targets):
        count = len(body.shape.targets)
        notes.append(Diagnostic("X005.morph-targets", values={"n": count}))
        shapes = figure.blend_shapes
        if shapes is not None and shapes.normal_offsets is None:
            notes.append(Diagnostic("X005.morph-normals"))
    if body.influences is not None and body.influences.n_fixed:
        unbound = int(body.influences.n_fixed)
        notes.append(Diagnostic("X005.no-influence", values={"n": unbound}))
    return notes


def _motion_remarks(
    animation: SampledAnimation, body: _Body, frames: Frames, options: MotionOptions
) -> list[Diagnostic]:
    """Return notes about gaps, and about joints with translations."""
    skeleton = animation.figure.require_skeleton()
    notes = gaps_note(animation.frames.present, animation.first_frame, options.closing)
    own = body.figure.require_skeleton()
    moves = np.flatnonzero(moving(own, frames) & (skeleton.parents >= 0))
    if len(moves):
        names = [joint_label(skeleton, int(joint)) for joint in moves]
        values = {"n": len(names), "names": names}
        notes.append(Diagnostic("X005.joints-translate", values=values))
    return notes
