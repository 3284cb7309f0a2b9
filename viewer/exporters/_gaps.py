"""Missing frames of a motion, for formats without gaps: interpolated, held, or split."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase, note
from viewer.errors import RigError
from viewer.exporters._options import GAPS, GapHandling
from viewer.phrases import agree, listed
from viewer.rigs.arrays import Bools, runs_of
from viewer.rigs.motion.evaluation import Frames
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing

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


def file_spans(present: Bools, closing: GapHandling) -> list[tuple[int, int]]:
    """Return the frames of each file as half-open ranges: several if gaps split the motion."""
    if closing != "split" or present.all():
        return [(0, len(present))]
    return runs_of(present)


def filled(frames: Frames, interpolate: bool) -> Frames:
    """Return frames whose gaps are interpolated, or hold the frame before; ends are held."""
    if frames.present.all():
        return frames
    every = np.arange(frames.n_frames)
    rows = np.where(frames.present, every, -1)
    if not interpolate:
        rows = np.maximum.accumulate(np.where(rows < 0, np.argmax(frames.present), rows))
    clip = SampledClip("", Timing(1.0, rows.astype(np.int32)), *frames.arrays)
    found = clip.sample(None, every.astype(np.float64), interpolate=True)
    # The clip has both.
    assert found.figure_translations is not None and found.figure_scales is not None
    return replace(
        frames,
        present=found.present,
        rotations=found.rotations,
        translations=found.translations,
        scales=frames.scales if len(frames.scales) == 1 else found.scales,
        shape_weights=frames.shape_weights
        if len(frames.shape_weights) == 1
        else found.shape_weights,
        figure_translations=found.figure_translations,
        figure_scales=found.figure_scales,
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
