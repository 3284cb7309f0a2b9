"""Missing frames of a motion, for formats without gaps: interpolated, held, or split."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from viewer.errors import RigError
from viewer.export._options import GAPS
from viewer.rig.arrays import Bools, Floats
from viewer.rig.geometry.quaternion import slerp
from viewer.rig.motion.evaluation import Frames

Indices = NDArray[np.intp]

_LISTED = 6  # maximum number of gaps listed in a message
_FILLING = {
    "hold": "the last pose is held",
    "interpolate": "interpolated, held at both ends",
}


def runs(flags: Bools) -> list[tuple[int, int]]:
    """Return the runs of True as half-open ranges of indices."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def gaps_text(present: Bools, first_frame: int) -> str:
    """Return the missing frames as text: ``"frames 3 to 5, 9"``."""
    found = [
        f"{a + first_frame}" if b == a + 1 else f"{a + first_frame} to {b - 1 + first_frame}"
        for a, b in runs(~present)
    ]
    more = f" and {len(found) - _LISTED} more gaps" * (len(found) > _LISTED)
    plural = "s" if int((~present).sum()) > 1 else ""
    return f"frame{plural} {', '.join(found[:_LISTED])}{more}"


def filled(frames: Frames, interpolate: bool) -> Frames:
    """Return frames without gaps.

    ``frames``: at least one of them present.
    ``interpolate``: if true, interpolate between the frames around a gap, rotations along the
      shorter arc and everything else linearly; if false, hold the frame before it. Gaps at the ends
      hold the first or last frame.
    """
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
    weights = frames.shape_weights
    return replace(
        frames,
        present=np.ones(len(every), dtype=np.bool_),
        rotations=rotations,
        translations=_line(frames.translations, before, after, fraction),
        shape_weights=weights if len(weights) == 1 else _line(weights, before, after, fraction),
        figure_translations=_line(frames.figure_translations, before, after, fraction),
        figure_scales=_line(frames.figure_scales, before, after, fraction),
    )


def kept_gaps(frames: Frames, gaps: str, first_frame: int) -> tuple[Frames, str]:
    """Return the frames for formats that allow gaps: interpolated or held only on request.

    ``frames``: frames with or without gaps.
    ``gaps``: a key of ``GAPS``, or empty. If every frame has its own file, ``split`` keeps the
      gaps.
    ``first_frame``: number of the first frame.
    Returns ``frames``: unchanged if the gaps are kept.
    Returns ``note``: a message such as ``"missing frames 3 to 5: the last pose is held"``, or an
      empty string.
    Raises RigError if ``gaps`` is not a key of ``GAPS``.
    """
    if gaps not in ("", *GAPS):
        raise RigError(f'handling of gaps: expected one of {", ".join(GAPS)}, found "{gaps}"')
    present = frames.present
    if gaps not in _FILLING or present.all() or not present.any():
        return frames, ""
    note = f"missing {gaps_text(present, first_frame)}: {_FILLING[gaps]}"
    return filled(frames, gaps == "interpolate"), note


def _line(rows: Floats, before: Indices, after: Indices, fraction: Floats) -> Floats:
    weight = fraction.reshape(-1, *[1] * (rows.ndim - 1))
    return rows[before] + weight * (rows[after] - rows[before])
