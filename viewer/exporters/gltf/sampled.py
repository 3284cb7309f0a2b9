"""Figures with sampled motions in glTF files: at rest, with a key per frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note
from viewer.errors import RigError
from viewer.exporters._exporter import Part
from viewer.exporters._gaps import filled, gaps_note
from viewer.exporters._options import GAPS, ExportOptions
from viewer.exporters.gltf.body import Body, Built, add_body, body_of
from viewer.exporters.gltf.document import Document
from viewer.exporters.gltf.keyed import add_animation, moving, still_locals
from viewer.exporters.gltf.losses import GltfFile, Written, frame_keys, gltf_losses
from viewer.exporters.gltf.materials import Color
from viewer.exporters.gltf.nodes import locals_of
from viewer.exporters.gltf.skin import shape_of
from viewer.phrases import agree, counted, listed
from viewer.rigs.figure import figure_pose
from viewer.rigs.geometry.vectors import SignedUp
from viewer.rigs.motion.evaluation import Frames, frames_between, root_translations
from viewer.rigs.motion.sampled_animation import SampledAnimation
from viewer.rigs.skeleton import Skeleton, joint_label


@dataclass(frozen=True, slots=True, eq=False)
class Sampled:
    """A motion in the form that glTF can store."""

    animation: SampledAnimation
    """The original."""
    frames: Frames
    """Its frames, with gaps filled."""
    body: Body
    """The written form of its figure."""
    up: SignedUp
    """Up axis of the frames."""
    color: Color | None = None
    """Linear colour of surfaces without a colour; None for the default."""


def seconds_of(animation: SampledAnimation) -> float:
    """Return the time from the first to the last frame."""
    return (animation.frames.n_frames - 1) / animation.frame_rate


def common_name(parts: Sequence[Part], stem: str) -> str:
    """Return the name that all motions share, or else the file's name."""
    names = {part.animation.motion.name for part in parts}
    return names.pop() if len(names) == 1 and "" not in names else stem


def sampled_of(
    animation: SampledAnimation, options: ExportOptions, color: Color | None = None
) -> Sampled:
    """Return a motion in the form that glTF can store."""
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
    frames = filled(animation.frames, options.closing == "interpolate")
    reference = int(animation.frames.present.argmax())
    shape = shape_of(animation.figure, frames.shape_weights, reference)
    body = body_of(animation.figure, shape, options.skinning)
    return Sampled(animation, frames, body, options.world_up, color)


def add_sampled(
    document: Document,
    sampled: Sampled,
    options: ExportOptions,
    span: tuple[int, int] | None = None,
    delay: float = 0.0,
    name: str = "",
    into: int = -1,
) -> tuple[Built, int]:
    """Add a figure at rest, and the frames in ``span`` as an animation after a delay."""
    animation, body = sampled.animation, sampled.body
    skeleton = body.figure.require_skeleton()
    rows = slice(*(span or (0, sampled.frames.n_frames)))
    part = frames_between(sampled.frames, rows)
    if body.figure.mesh is None or (body.influences is not None and not body.influences.n_fixed):
        part = _moved_by_root(skeleton, part)
    pose = figure_pose(animation.figure)
    rest = locals_of(skeleton, pose)
    pose.figure_translation = part.figure_translations[0]
    pose.figure_scale = float(part.figure_scales[0])
    weights = body.shape.weights
    if len(weights) > 1:
        weights = weights[rows]
        body = replace(body, shape=replace(body.shape, weights=weights))
    is_still = not np.ptp(part.figure_translations, axis=0).any() and not np.ptp(part.figure_scales)
    locals_ = still_locals(skeleton, rest, part)
    built = add_body(
        *(document, body, sampled.up, pose, locals_, sampled.color),
        is_still=is_still,
        optimizes=options.optimizes,
    )
    morphs = [
        (placed.node, own)
        for placed in built.meshes
        if np.ptp(own := weights[:, placed.part.targets], axis=0).any()
    ]
    title = name or animation.motion.name or animation.name
    times = delay + np.arange(part.n_frames) / animation.frame_rate
    index = add_animation(document, title, times, skeleton, part, built.tree, morphs, into)
    return built, index


def _moved_by_root(skeleton: Skeleton, frames: Frames) -> Frames:
    """Return frames in which the only root moves instead of the figure, which is not scaled.

    The node around the figure then has no effect, so that readers do not take it for a joint.
    """
    if np.sum(skeleton.parents < 0) != 1 or (frames.figure_scales != 1.0).any():
        return frames
    moved = frames.translations.copy()
    moved[:, skeleton.parents < 0] = root_translations(skeleton, frames)[:, None]
    still = np.zeros_like(frames.figure_translations)
    return replace(frames, translations=moved, figure_translations=still)


def written_part(path: Path, file: GltfFile, built: Built) -> Written:
    """Return the contents of one figure in a file of several figures."""
    tree, meshes = built.tree, built.meshes
    own = {tree.place, *tree.joints, *(placed.node for placed in meshes)}
    keys = {place: values for place, values in frame_keys(file).items() if place[0] in own}
    return Written(path, file, tree, meshes, keys=keys)


def sampled_losses(
    written: Written,
    sampled: Sampled,
    options: ExportOptions,
    span: tuple[int, int] | None = None,
) -> list[Diagnostic]:
    """Return notes with the largest errors of the present frames of a range."""
    animation, body = sampled.animation, sampled.body
    start, stop = span or (0, sampled.frames.n_frames)
    return gltf_losses(
        written,
        animation.figure,
        sampled.frames,
        start + np.flatnonzero(animation.frames.present[start:stop]),
        options.skinning,
        body.shape,
        body.influences,
        animation.first_frame,
    )


def motion_remarks(sampled: Sampled, options: ExportOptions) -> list[Diagnostic]:
    """Return notes about gaps, and about joints with translations."""
    animation, frames = sampled.animation, sampled.frames
    skeleton = animation.figure.require_skeleton()
    notes = gaps_note(animation.frames.present, animation.first_frame, options.closing)
    own = sampled.body.figure.require_skeleton()
    moves = np.flatnonzero(moving(own, frames) & (skeleton.parents >= 0))
    if len(moves):
        names = [joint_label(skeleton, int(joint)) for joint in moves]
        values = {
            "n": counted(len(names), "joint"),
            "names": listed(names, 8),
            "translate": agree(len(names), "translates", "translate"),
        }
        notes.append(
            note("X005.joints-translate: {n} below the root {translate}: {names}", **values)
        )
    return notes
