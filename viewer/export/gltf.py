"""Exporter of glTF 2.0, ``.glb`` or ``.gltf`` with a ``.bin``: mesh, skin, pose and motion.

It follows the Khronos specification: ``registry.khronos.org/glTF/specs/2.0``. Lengths are in
metres, y is up. Data is not converted: a node above the figure rotates it if z is up, and scales
it if it is in another unit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase
from viewer.errors import RigError
from viewer.export._gaps import filled, frames_phrase, gaps_note, runs
from viewer.export._gltf.body import Body, Built, add_body, body_of
from viewer.export._gltf.cameras import add_cameras
from viewer.export._gltf.document import Document
from viewer.export._gltf.figures import Added, add_figure, figure_losses, place_figures
from viewer.export._gltf.keyed import Clips
from viewer.export._gltf.losses import Written, gltf_losses, not_held
from viewer.export._gltf.materials import material_losses
from viewer.export._gltf.motion import add_animation, moving, still_locals
from viewer.export._gltf.nodes import locals_of, to_metres
from viewer.export._gltf.reading import parsed
from viewer.export._gltf.shape import shape_of
from viewer.export._losses.between import resampling_losses
from viewer.export._motion_paths import split_paths
from viewer.export._options import GAPS, MotionOptions
from viewer.formats import all_or_none, save_bytes
from viewer.rig.figure import Figure
from viewer.rig.motion.evaluation import Frames, frames_between
from viewer.rig.motion.sampled_animation import SampledAnimation
from viewer.rig.motion.transform_clip import TransformClip
from viewer.rig.scalars import length_text
from viewer.rig.scene import Actor, Scene, figure_pose
from viewer.rig.skeleton import joint_label
from viewer.rig.skinning import Skinning
from viewer.rig.units import METRES, UNIT_NAMES

__all__ = ["export", "export_animation", "export_clips", "export_figures"]

Extend = Callable[[Document, Body, Built], list[Diagnostic]]


def export(
    actor: Actor,
    path: Path,
    skinning: Skinning,
    optimizes: bool = False,
    extend: Extend | None = None,
) -> list[Diagnostic]:
    """Write a figure in its current pose; see ``viewer.export.export``.

    ``extend`` adds the extensions of a VRM character, and returns notes about them.
    """
    return export_figures([actor], path, skinning, [None], optimizes=optimizes, extend=extend)


def export_clips(
    actor: Actor,
    path: Path,
    skinning: Skinning,
    clips: Sequence[TransformClip],
    optimizes: bool = False,
) -> list[Diagnostic]:
    """Write a figure at rest with its animations; see ``viewer.export.export_clips``."""
    return export_figures([actor], path, skinning, [clips], optimizes=optimizes)


def export_figures(
    actors: Sequence[Actor],
    path: Path,
    skinning: Skinning,
    clips: Sequence[Sequence[TransformClip] | None],
    scene: Scene | None = None,
    optimizes: bool = False,
    extend: Extend | None = None,
) -> list[Diagnostic]:
    """Write figures and cameras to one file; see ``viewer.export.export_figures``.

    Several figures are placed as in their scene; the placement of a single figure is omitted.
    ``extend``: as for ``export``.
    """
    document = Document(actors[0].figure.name)
    together = Clips(document)
    added = [
        add_figure(document, actor, skinning, own, together, optimizes)
        for actor, own in zip(actors, clips, strict=True)
    ]
    first, views = actors[0], () if scene is None else scene.views
    up = first.figure.up if scene is None or len(actors) == 1 else scene.up
    to_file = to_metres(up, first.figure.unit)
    if len(actors) == 1:
        to_file = to_file @ np.linalg.inv(first.placement)
    placing = place_figures(document, actors, added, to_file) if len(actors) > 1 else []
    lenses = add_cameras(document, views, to_file)
    extensions = [] if extend is None else extend(document, added[0].body, added[0].built)
    (data,) = _files([(path, document)])
    notes = [_written(path, actors, added, len(views), len(data[path])), *extensions]
    notes += _beside(data, path)
    file = parsed([*data.values()])
    for node in placing:
        # Errors are measured in the space of each figure.
        del file.root["nodes"][node]["matrix"]
    for actor, each in zip(actors, added, strict=True):
        own_notes = _quantization(path, each.built, actor.figure)
        own_notes += _remarks(each.body, actor.figure.up)
        own_notes += figure_losses(each, path, file, skinning, is_vrm=extend is not None)
        several = len(actors) > 1
        notes += [_of_figure(actor, note) for note in own_notes] if several else own_notes
    return notes + lenses


def _written(
    path: Path, actors: Sequence[Actor], added: Sequence[Added], n_views: int, size: int
) -> Diagnostic:
    """Return the note about a written file."""
    animations = {index for each in added for index in each.kept}
    values: dict[str, Any] = {"size": size, "n": len(animations)}
    cameras = [Phrase("written-cameras", n=n_views)] if n_views else []
    if len(actors) > 1:
        values |= {"figures": [actor.name for actor in actors], "n_figures": len(actors)}
        if animations:
            cameras.append(Phrase("written-animations", n=len(animations)))
        return Diagnostic("X001.gltf-figures", path, values={**values, "others": cameras})
    key = "X001.gltf" if added[0].clips is None else "X001.gltf-animations"
    return Diagnostic(key, path, values={**values, "counts": added[0].built.counts + cameras})


def _of_figure(actor: Actor, note: Diagnostic) -> Diagnostic:
    values = {"figure": actor.name, "remark": replace(note, path=None)}
    return Diagnostic(f"{note.code}.of-figure", note.path, values=values)


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
    body = body_of(animation.figure, shape, options.skinning)
    spans = [(0, frames.n_frames)]
    if options.closing == "split" and not present.all():
        spans = runs(present)
    paths = split_paths(path, len(spans))
    documents, built = [], []
    for start, stop in spans:
        document = Document(animation.name)
        built.append(_add_animation(document, animation, body, frames, (start, stop), options))
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
        notes += _quantization(file, made, animation.figure)
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


def _add_animation(
    document: Document,
    animation: SampledAnimation,
    body: Body,
    frames: Frames,
    span: tuple[int, int],
    options: MotionOptions,
) -> Built:
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
    built = add_body(
        *(document, body, options.world_up, pose, locals_),
        is_still=is_still,
        optimizes=options.optimizes,
    )
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


def _quantization(path: Path, built: Built, figure: Figure) -> list[Diagnostic]:
    """Return a note with the largest rounding errors of quantised attributes, if there are any."""
    errors = built.errors
    if not errors:
        return []
    parts = []
    if "positions" in errors:
        length = length_text(figure, errors["positions"])
        parts.append(Phrase("quantized-positions", length=length))
    for kind, factor in (("normals", 180.0 / np.pi), ("uvs", 1.0), ("weights", 1.0)):
        if kind in errors:
            parts.append(Phrase(f"quantized-{kind}", error=f"{factor * errors[kind]:.2g}"))
    return [Diagnostic("X002.quantized", path, values={"parts": parts})]


def _remarks(body: Body, up: str) -> list[Diagnostic]:
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
    animation: SampledAnimation, body: Body, frames: Frames, options: MotionOptions
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
