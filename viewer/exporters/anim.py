"""Exporter for ``.anim`` files: motions of .skel-style rigs, as original keys or one per frame."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase, note
from viewer.errors import RigError
from viewer.exporters._exporter import Selection
from viewer.exporters._gaps import check_gaps, file_spans, filled, gaps_note
from viewer.exporters._left_out import joint_scales_note
from viewer.exporters._losses.motion_errors import between_losses, frames_losses
from viewer.exporters._motion_paths import split_paths
from viewer.exporters._options import ExportOptions
from viewer.exporters.bvh.angles import euler_angles, unrolled
from viewer.formats import Source, all_or_none, keeping_written, read, write
from viewer.phrases import counted, optional
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.motion.clip import Clip, Tangent, evaluate_all, is_course_rig
from viewer.rigs.motion.clip_edit import clip_from_frames
from viewer.rigs.motion.evaluation import Frames, frames_between, frames_of, world_frames
from viewer.rigs.motion.sampled_animation import SampledAnimation, frames_at
from viewer.rigs.scalars import length_text
from viewer.rigs.skeleton import Skeleton

_RULES: tuple[Tangent, ...] = ("linear", "smooth")
_BLOCK = 4096  # frames measured per block
_SAME = 1e-9  # tolerance, in frames or length units


def export(selection: Selection, path: Path, options: ExportOptions) -> list[Diagnostic]:
    """Write a motion of a figure with the DOFs of a ``.skel`` as a clip; only gaps are an option.

    A keyframed clip that is requested as a whole is written exactly, with its own keys. Any other
    motion gets a key per frame, with linear or smooth tangents, whichever give the smaller joint
    error.
    """
    animation = selection.part.animation
    figure, frames = animation.figure, animation.frames
    require(figure)
    skeleton = figure.require_skeleton()
    check_gaps(options.closing)
    if animation.motion.kind == "curves" and _is_whole(animation, animation.motion):
        with keeping_written() as saved:
            write(animation.motion, path)
        has_keys = animation.motion.end > animation.motion.start
        notes = [_summary(path, animation.motion, Phrase("the clip's own") if has_keys else "")]
        notes += _losses(animation, Source(path, saved[path]), (0, frames.n_frames), options)
        if frames.figure_translations.any():
            notes.append(
                note(
                    "X003.clip-placement: the placement of the whole figure is not part of its "
                    "clip and is omitted"
                )
            )
        return notes + _left_out(figure, frames)
    return _export_frames(animation, skeleton, path, options)


def require(figure: Figure) -> None:
    """Raise RigError for a figure whose DOFs are not those of ``.skel`` files."""
    if not is_course_rig(figure.require_skeleton()):
        raise RigError(
            f".anim needs a root translation and three angles per joint, as in .skel files; "
            f"{figure.name} has other DOFs"
        )


def _export_frames(
    animation: SampledAnimation, skeleton: Skeleton, path: Path, options: ExportOptions
) -> list[Diagnostic]:
    """Write a key per frame, in one file or one for each run of frames."""
    figure, frames = animation.figure, animation.frames
    whole = filled(frames, options.closing == "interpolate")
    base = quaternion_to_matrix(skeleton.rest_rotations)
    within = np.swapaxes(base, -1, -2) @ quaternion_to_matrix(whole.rotations)
    angles = euler_angles(within, "zyx")
    # Unwrapped angles could exceed the limits.
    is_free = np.isinf(skeleton.dof_limits[3:]).all(axis=1).reshape(-1, 3).all(axis=1)
    angles[:, is_free] = unrolled(angles, "zyx")[:, is_free]
    dofs = np.zeros((whole.n_frames, skeleton.n_dofs))
    dofs[:, 3:] = angles[..., ::-1].reshape(whole.n_frames, -1)
    dofs[:, :3] = whole.translations[:, 0]
    if animation.motion.kind == "curves":
        # Use the clip's own angles instead of equivalent ones.
        targets, values = evaluate_all(animation.motion, whole.times)
        dofs[:, targets] = values
    dofs = np.clip(dofs, *skeleton.dof_limits.T)
    dofs[:, :3] += whole.figure_translations / whole.figure_scales[:, None]
    clips, rules = [], []
    spans = file_spans(frames.present, options.closing)
    for start, stop in spans:
        part = slice(start, stop)
        trials = [
            clip_from_frames(animation.motion.name, dofs[part], frames.times[part], rule)
            for rule in _RULES
        ]
        middles = _middles(frames.times[part])
        best = int(np.argmin([_distance(animation, trial, middles) for trial in trials]))
        clips.append(trials[best])
        rules.append(_RULES[best])
    paths = split_paths(path, len(clips))
    with keeping_written() as saved, all_or_none(paths):
        for file, clip in zip(paths, clips, strict=True):
            write(clip, file)
    notes = [
        _summary(file, clip, Phrase("{rule} tangents", rule=rule))
        for file, clip, rule in zip(paths, clips, rules, strict=True)
    ]
    for file, span in zip(paths, spans, strict=True):
        notes += _losses(animation, Source(file, saved[file]), span, options)
    first = animation.first_frame
    notes += gaps_note(frames.present, first, options.closing, interpolate="interpolated")
    return notes + _left_out(figure, frames)


def _losses(
    animation: SampledAnimation, source: Source, span: tuple[int, int], options: ExportOptions
) -> list[Diagnostic]:
    """Read a file back and return notes about its errors on the frames and between them."""
    clip, path = read(source), source.path
    assert isinstance(clip, Clip)  # the file was written from a clip
    figure, how, part = animation.figure, options.skinning, slice(*span)
    times = animation.frames.times[part]
    on_frames = frames_of(figure, clip, times)
    notes = frames_losses(path, animation, on_frames, how, span)
    there = animation.frames.present[part]
    middles = _middles(times)[there[1:] & there[:-1]]
    spanned = replace(animation, frames=frames_between(animation.frames, part))
    notes += between_losses(path, spanned, lambda t: frames_of(figure, clip, t), how, middles)
    return notes


def _middles(times: Floats) -> Floats:
    return 0.5 * (times[1:] + times[:-1])


def _is_whole(animation: SampledAnimation, clip: Clip) -> bool:
    """Return whether the frames span a whole clip that has a channel for every DOF."""
    skeleton, times = animation.figure.require_skeleton(), animation.frames.times
    targets = [channel.target for channel in clip.channels]
    step = 1.0 / animation.frame_rate
    starts = abs(float(times[0]) - clip.start) <= _SAME * step
    # The last frame may precede the end by up to a frame.
    ends = clip.end - float(times[-1]) < step * (1.0 - _SAME)
    return targets == list(range(skeleton.n_dofs)) and starts and ends


def _distance(animation: SampledAnimation, clip: Clip, times: Floats) -> float:
    """Return the largest joint error, without the figure's scale."""
    figure, worst = animation.figure, 0.0
    for start in range(0, len(times), _BLOCK):
        block = times[start : start + _BLOCK]
        wanted = frames_at(animation, block)
        found = frames_of(figure, clip, block)
        place = wanted.figure_translations / wanted.figure_scales[:, None]
        one = np.ones(len(block))
        wanted = replace(wanted, figure_scales=one, figure_translations=place)
        found = replace(found, shape_weights=wanted.shape_weights)
        apart = world_frames(figure, wanted)[..., :3, 3] - world_frames(figure, found)[..., :3, 3]
        off = np.linalg.norm(apart, axis=-1).max(axis=1)
        worst = max(worst, float(off[wanted.present].max(initial=0.0)))
    return worst


def _summary(path: Path, clip: Clip, how: Phrase | str) -> Diagnostic:
    return note(
        "X001.anim: {channels} with {keys}, {start:zg} to {end:zg} s{how}",
        path,
        channels=counted(len(clip.channels), "channel"),
        keys=counted(clip.n_keys, "key"),
        start=float(clip.start),
        end=float(clip.end),
        how=optional(", {}", how),
    )


def _left_out(figure: Figure, frames: Frames) -> list[Diagnostic]:
    """Return notes about everything that a clip cannot store."""
    notes, there = [], frames.present
    scales = frames.figure_scales[there]
    if np.abs(scales - 1.0).max() > _SAME:
        notes.append(
            note(
                "X003.clip-scale: .anim cannot store the figure's scale of {scale:g}, which is "
                "omitted",
                scale=float(scales.max()),
            )
        )
    notes += joint_scales_note(
        frames,
        figure.require_skeleton(),
        "X003.clip-joint-scales: .anim cannot animate scales of joints ({low} to {high}), "
        "which are omitted",
    )
    moved = np.linalg.norm(frames.translations[there][:, 1:], axis=-1).max(initial=0.0)
    if moved > _SAME:
        length = length_text(figure, float(moved))
        notes.append(
            note(
                "X003.clip-translations: .anim translates only the root: translations of other "
                "joints, up to {length}, are omitted",
                length=length,
                distance=float(moved),
                unit=figure.unit,
            )
        )
    if frames.shape_weights.any():
        notes.append(
            note("X003.clip-shape: .anim cannot store a shape: blend shape weights are omitted")
        )
    return notes
