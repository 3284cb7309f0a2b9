"""Exporter for glTF 2.0, ``.glb`` or ``.gltf`` with a ``.bin``: mesh, skin, pose and motion.

It follows the Khronos specification: ``registry.khronos.org/glTF/specs/2.0``. Lengths are in
metres, y is up. Data is not converted: a node above the figure rotates it if z is up, and scales
it if it is in another unit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase
from viewer.export._gaps import frames_phrase, runs
from viewer.export._gltf.body import Body, Built
from viewer.export._gltf.cameras import add_cameras
from viewer.export._gltf.document import Document
from viewer.export._gltf.figures import Added, add_figure, figure_losses, place_figures
from viewer.export._gltf.keyed import Clips
from viewer.export._gltf.losses import Written, not_held
from viewer.export._gltf.materials import material_losses
from viewer.export._gltf.nodes import to_metres
from viewer.export._gltf.reading import GltfFile, parsed
from viewer.export._gltf.sampled import (
    PlacedMotion,
    add_sampled,
    common_name,
    motion_remarks,
    placed_actor,
    sampled_losses,
    sampled_of,
    written_part,
)
from viewer.export._left_out import other_animations_note
from viewer.export._losses.between import rate_note, resampling_losses
from viewer.export._motion_paths import split_paths
from viewer.export._options import MotionOptions
from viewer.formats import all_or_none, save_bytes
from viewer.rig.captures.carried_view import moving_alone, view_in
from viewer.rig.figure import Figure
from viewer.rig.motion.sampled_animation import SampledAnimation
from viewer.rig.motion.transform_clip import TransformClip
from viewer.rig.scalars import length_text
from viewer.rig.scene import Actor, Scene, scene_unit
from viewer.rig.skinning import Skinning
from viewer.rig.units import METRES, UNIT_NAMES

__all__ = ["export", "export_animation", "export_animations", "export_clips", "export_figures"]

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
    lenses = add_cameras(document, views, to_file, pairs, together, clips, alone)
    extensions = [] if extend is None else extend(document, added[0].body, added[0].built)
    (data,) = _files([(path, document)])
    notes = [_written(path, actors, added, len(views), len(data[path])), *extensions]
    notes += _beside(data, path, document)
    file = _unplaced(data, placing)
    for actor, each in zip(actors, added, strict=True):
        own_notes = _figure_notes(path, actor, each, file, skinning, extend is not None)
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
    sampled = sampled_of(animation, options)
    present, spans = animation.frames.present, [(0, animation.frames.n_frames)]
    if options.closing == "split" and not present.all():
        spans = runs(present)
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
            "counts": made.counts,
            "frames": frames_phrase(animation.first_frame + span[0], span[1] - span[0]),
            "rate": animation.frame_rate,
            "size": len(data[file]),
        }
        notes += [
            Diagnostic("X001.gltf-motion", file, values=values),
            *_beside(data, file, document),
        ]
        notes += _quantization(file, made, animation.figure)
        written = Written(file, parsed([*data.values()]), made.tree, made.meshes, span[0])
        lost += sampled_losses(written, sampled, options, span)
    notes += _remarks(sampled.body, sampled.up) + motion_remarks(sampled, options)
    lost += resampling_losses(path, animation, options.skinning)
    return notes + lost + not_held(animation.figure, sampled.body.shape)


def export_animations(
    motions: Sequence[tuple[Actor, SampledAnimation, str]],
    path: Path,
    options: MotionOptions,
    scene: Scene,
    still: Sequence[Actor] = (),
) -> list[Diagnostic]:
    """Write figures to one file, placed as in their scene, with one animation that moves them all.

    Frames of different figures keep their relative times; the earliest frame is at 0.

    Parameters
    ----------
    motions : sequence of (Actor, SampledAnimation, str)
        The moving figures, and what ``animation_for`` returns for each: frames, at least one of
        which is present, and their up axis.
    path : Path
        The file.
    options : MotionOptions
        Skinning, and handling of gaps except ``split``.
    scene : Scene
        Provides the up axis of the placements, and cameras.
    still : sequence of Actor
        Further figures, written in their current pose.

    Returns
    -------
    list of Diagnostic
        As for ``export_animation``, each with its figure.

    Raises
    ------
    RigError, OutputError
        As for ``export_animation``.
    """
    parts = [PlacedMotion(placed_actor(scene, who), each, up) for who, each, up in motions]
    others = [placed_actor(scene, actor) for actor in still]
    document, actors = Document(path.stem), [*(part.actor for part in parts), *others]
    found = [
        sampled_of(each.animation, replace(options, world_up=each.up), each.actor.color)
        for each in parts
    ]
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
    lenses = add_cameras(document, scene.views, to_file, [*zip(actors, built, strict=True)])
    (data,) = _files([(path, document)])
    seconds = max(each.start + each.seconds for each in parts) - begin
    notes = [_motions_written(path, actors, seconds, len(scene.views), len(data[path]))]
    notes += _beside(data, path, document)
    file = _unplaced(data, placing)
    for part, sampled, made in zip(parts, found, built, strict=False):
        own = _quantization(path, made, sampled.animation.figure) + _remarks(sampled.body, part.up)
        own += motion_remarks(sampled, options)
        own += sampled_losses(written_part(path, file, made), sampled, options)
        own += resampling_losses(path, sampled.animation, how) + rate_note(sampled.animation)
        own += not_held(sampled.animation.figure, sampled.body.shape)
        own += other_animations_note(part.animation.figure, part.animation.motion)
        notes += [_of_figure(part.actor, note) for note in own]
    for actor, each in zip(others, added, strict=True):
        notes += [_of_figure(actor, note) for note in _figure_notes(path, actor, each, file, how)]
    return notes + lenses


def _motions_written(
    path: Path, actors: Sequence[Actor], seconds: float, n_views: int, size: int
) -> Diagnostic:
    """Return the note about a file of several moving figures."""
    values = {
        "n_figures": len(actors),
        "figures": [actor.name for actor in actors],
        "seconds": seconds,
        "others": [Phrase("written-cameras", n=n_views)] if n_views else [],
        "size": size,
    }
    return Diagnostic("X001.gltf-motions", path, values=values)


def _unplaced(data: Mapping[Path, bytes], placing: Sequence[int]) -> GltfFile:
    """Return a written file without placements, because errors are measured in figure space."""
    file = parsed([*data.values()])
    for node in placing:
        del file.root["nodes"][node]["matrix"]
    return file


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
        Diagnostic("X001.gltf-arrays", file, values={"size": size}) for file, size in others.items()
    ]
    if document.n_omitted:
        notes.append(Diagnostic("X003.json-numbers", path, values={"n": document.n_omitted}))
    return notes


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
