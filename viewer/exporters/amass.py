"""Exporter for AMASS files: motions of SMPL-family bodies.

::

    poses (N, 3 J)   trans (N, 3)   betas (S,) or (N, S)   expressions (N, E)   gender
    surface_model_type   num_betas   mocap_framerate   mocap_frame_rate   up   present (N,)

``trans`` is transl of V = R (X - J0) + J0 + transl; ``poses`` are rotation vectors in the model's
own order. ``up``, and ``present`` if frames are missing, are extensions.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, note
from viewer.exporters._exporter import Selection
from viewer.exporters._family import (
    FamilyFrames,
    check_unit,
    family_frames,
    member_of_figure,
    padded,
    read_frames,
    up_axis,
)
from viewer.exporters._gaps import check_gaps, file_spans, filled, gaps_note
from viewer.exporters._losses.motion_errors import frames_losses, resampling_losses
from viewer.exporters._motion_paths import split_paths
from viewer.exporters._options import ExportOptions
from viewer.formats import Source, all_or_none, keeping_written, save_arrays
from viewer.formats.amass import read
from viewer.phrases import counted
from viewer.rigs.arrays import Arrays
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.vectors import SignedUp
from viewer.rigs.motion.sampled_animation import SampledAnimation

Layout = Callable[[FamilyFrames, slice, float, SignedUp], Arrays]
"""Returns the arrays of a range of rows, given the frame rate and the up axis."""
FEWEST = 16
"""Minimum number of shape coefficients, as readers of AMASS require."""
_CLOSED = {
    "hold": "{poses}, and the frames are marked in present",
    "interpolate": "interpolated along the shorter arc, and marked in present",
    "split": "omitted between the files",
}
_TYPES = {"SMPL": "smpl", "SMPL+H": "smplh", "SMPL-X": "smplx"}


def export(selection: Selection, path: Path, options: ExportOptions) -> list[Diagnostic]:
    """Write a motion in its own world unless another up axis is requested."""
    animation = selection.part.animation
    notes = write_layout(animation, path, options, "AMASS", _arrays)
    if len(animation.frames.shape_weights) > 1:
        notes.append(
            Diagnostic(
                "X005.shape-rows: the shape changes: betas has one row per frame, which few "
                "programs support"
            )
        )
    return notes


def require(figure: Figure) -> None:
    """Raise RigError for a figure without the joints of an SMPL-family body."""
    member_of_figure(figure, "an AMASS motion", ("pelvis",))


def write_layout(
    animation: SampledAnimation, path: Path, options: ExportOptions, title: str, layout: Layout
) -> list[Diagnostic]:
    """Write a motion as the arrays that ``layout`` returns for ranges of rows."""
    check_unit(options, title)
    member = member_of_figure(animation.figure, f"an {title} motion", ("pelvis",))
    present = animation.frames.present
    check_gaps(options.closing)
    frames = filled(animation.frames, options.closing == "interpolate")
    model = title if title == "SMPL-X" else member.title
    body, notes = family_frames(animation, frames, member, options, model)
    is_split = options.closing == "split" and not present.all()
    spans = file_spans(present, options.closing)
    paths = split_paths(path, len(spans))
    up = up_axis(options)
    written = []
    with keeping_written() as saved, all_or_none(paths):
        for file, (start, stop) in zip(paths, spans, strict=True):
            arrays = layout(body, slice(start, stop), animation.frame_rate, up)
            if not is_split and not present.all():
                arrays["present"] = present
            save_arrays(file, arrays)
            written.append(
                note(
                    "X001.amass: {n} of {model} at {rate:g} fps, {up} up",
                    file,
                    n=counted(stop - start, "frame"),
                    model=member.title if title == "AMASS" else title,
                    rate=animation.frame_rate,
                    up=up,
                )
            )
    lost = []
    for file, span in zip(paths, spans, strict=True):
        again = read_frames(read(Source(file, saved[file])), animation, options)
        lost += frames_losses(file, animation, again, options.skinning, span)
    lost += resampling_losses(path, animation, options.skinning)
    return [
        *written,
        *lost,
        *gaps_note(present, animation.first_frame, options.closing, **_CLOSED),
        *notes,
    ]


def _arrays(body: FamilyFrames, part: slice, rate: float, up: SignedUp) -> Arrays:
    shape = padded(body.shape, FEWEST)
    vectors = body.vectors[part]
    arrays: Arrays = {
        "poses": vectors.reshape(len(vectors), -1),
        "trans": body.translations[part],
        "betas": shape[0] if len(shape) == 1 else shape[part],
        "num_betas": np.array(shape.shape[1]),
        "gender": np.array(body.gender),
        "surface_model_type": np.array(_TYPES[body.member.title]),
        "mocap_framerate": np.array(float(rate)),
        "mocap_frame_rate": np.array(float(rate)),
        "up": np.array(up),
    }
    if body.has_expression:
        rows = np.broadcast_to(body.expression, (len(body.vectors), body.expression.shape[1]))
        arrays["expressions"] = rows[part].copy()
    return arrays
