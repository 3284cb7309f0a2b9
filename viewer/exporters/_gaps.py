"""Missing frames of a motion, for formats without gaps: interpolated, held, or split."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Diagnostic, Phrase, note
from viewer.errors import RigError
from viewer.exporters._options import GAPS, GapHandling
from viewer.phrases import agree, listed
from viewer.rigs.arrays import Bools, Floats, runs_of
from viewer.rigs.geometry.quaternion import slerp
from viewer.rigs.motion.evaluation import Frames

Indices = NDArray[np.intp]

_CLOSED: dict[str, str] = {
    "hold": "{poses}",
    "interpolate": "interpolated, held at both ends",
    "split": "one file for each run of frames",
}


def gaps_note(
    present: Bools, first_frame: int, closing: GapHandling, **how: str
) -> list[Diagnostic]:
    """Return a note about missing frames and how they were closed; ``how`` may rephrase it."""
    if present.all():
        return []
    is_early, is_late = not present[0], not present[int(present.argmax()) :].all()
    held = (
        "the last pose is held, or the first one at the start"
        if is_early and is_late
        else "the first pose is held"
        if is_early
        else "the last pose is held"
    )
    done = Phrase({**_CLOSED, **how}[closing], poses=Phrase(held))
    return [
        note("X004.closed: missing {noun} {gaps}: {how}", **_gaps(present, first_frame), how=done)
    ]


def frames_phrase(first: int, count: int) -> Phrase:
    """Return the numbers of consecutive frames."""
    if count == 1:
        return Phrase("1 frame ({first})", first=first)
    return Phrase("{n} frames ({first} to {last})", n=count, first=first, last=first + count - 1)


def kept_note(present: Bools, first_frame: int) -> list[Diagnostic]:
    """Return a note about frames that are also missing in the file, if there are any."""
    if present.all():
        return []
    return [
        note(
            "X004.kept: {noun} {gaps} missing, as in the original motion",
            **_gaps(present, first_frame),
        )
    ]


def _gaps(present: Bools, first_frame: int) -> dict[str, object]:
    found = [
        Phrase("{frame}", frame=start)
        if stop == start + 1
        else Phrase("{first} to {last}", first=start, last=stop - 1)
        for start, stop in (np.array(runs_of(~present)) + first_frame).tolist()
    ]
    n = int((~present).sum())
    return {"n": n, "gaps": listed(found), "noun": agree(n, "frame", "frames")}


def check_gaps(gaps: str) -> None:
    """Raise RigError unless a handling of gaps is a key of ``GAPS``."""
    if gaps not in GAPS:
        raise RigError(f'handling of gaps: expected one of {", ".join(GAPS)}, found "{gaps}"')


def filled(frames: Frames, interpolate: bool) -> Frames:
    """Return frames whose gaps are interpolated, or hold the frame before; ends are held."""
    if frames.present.all():
        return frames
    there = np.flatnonzero(frames.present)
    every = np.arange(frames.n_frames)
    place = np.searchsorted(there, every, side="right")
    before = there[np.clip(place - 1, 0, len(there) - 1)]
    after = there[np.clip(place, 0, len(there) - 1)] if interpolate else before
    span = after - before
    fraction = np.divide(every - before, span, out=np.zeros(len(every)), where=span > 0).clip(
        0.0, 1.0
    )
    moves = np.flatnonzero(fraction > 0.0)
    rotations = frames.rotations[before]
    rotations[moves] = slerp(
        rotations[moves], frames.rotations[after[moves]], fraction[moves, None]
    )
    weights, scales = frames.shape_weights, frames.scales
    return replace(
        frames,
        present=np.ones(len(every), dtype=np.bool_),
        rotations=rotations,
        translations=_line(frames.translations, before, after, fraction),
        scales=scales if len(scales) == 1 else _line(scales, before, after, fraction),
        shape_weights=weights if len(weights) == 1 else _line(weights, before, after, fraction),
        figure_translations=_line(frames.figure_translations, before, after, fraction),
        figure_scales=_line(frames.figure_scales, before, after, fraction),
    )


def kept_gaps(
    frames: Frames, gaps: Literal[""] | GapHandling, first_frame: int
) -> tuple[Frames, list[Diagnostic]]:
    """Return frames with gaps unless ``gaps`` asks to close them, and a note about closed ones."""
    check_gaps(gaps or "split")
    present = frames.present
    if not gaps or gaps == "split" or present.all() or not present.any():
        return frames, []
    return filled(frames, gaps == "interpolate"), gaps_note(present, first_frame, gaps)


def _line(rows: Floats, before: Indices, after: Indices, fraction: Floats) -> Floats:
    weight = fraction.reshape(-1, *[1] * (rows.ndim - 1))
    return rows[before] + weight * (rows[after] - rows[before])
