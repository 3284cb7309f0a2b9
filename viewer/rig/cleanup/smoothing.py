"""Smoothing of clips: filters of rotations in their tangent space, and of positions."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from typing import Protocol

import numpy as np

from viewer.rig.arrays import Bools, Floats
from viewer.rig.captures.points import PointClip
from viewer.rig.cleanup.frame_rows import Captured, in_frame_order, runs_of

__all__ = ["Filter", "run_lengths", "smoothed"]


class Filter(Protocol):
    """A filter of consecutive frames."""

    def rotations(self, quaternions: Floats, rate: float) -> Floats:
        """Return filtered unit quaternions (N, J, 4) of N frames at ``rate`` frames per second."""

    def positions(self, positions: Floats, rate: float, metres: float) -> Floats:
        """Return filtered positions (N, J, 3); ``metres`` is the length of their unit."""


def smoothed(clip: Captured, chosen: Filter, metres: float = 1.0) -> Captured:
    """Return a clip whose rotations and translations are filtered; gaps separate runs of frames.

    Shapes and scales are unchanged.

    Parameters
    ----------
    clip : SampledClip or PointClip
        Any clip.
    chosen : Filter
        The filter.
    metres : float
        Length of the clip's unit.
    """
    ordered = in_frame_order(clip)
    rate = ordered.timing.frame_rate
    runs = _rows_of_runs(ordered.timing.present)
    if isinstance(ordered, PointClip):
        return replace(ordered, points=_points(ordered.points, runs, chosen, rate, metres))
    rotations = ordered.rotations.copy()
    for rows in runs:
        rotations[rows] = chosen.rotations(rotations[rows], rate)

    def filtered(positions: Floats | None) -> Floats | None:
        if positions is None or not len(positions) or not np.ptp(positions, axis=0).any():
            return positions
        found = positions.copy()
        for rows in runs:
            found[rows] = chosen.positions(found[rows], rate, metres)
        return found

    place = ordered.figure_translations
    place = filtered(None if place is None else place[:, None])
    return replace(
        ordered,
        rotations=rotations,
        translations=filtered(ordered.translations),
        figure_translations=None if place is None else place[:, 0],
    )


def run_lengths(clip: Captured) -> list[int]:
    """Return the lengths of the runs of frames that are filtered separately.

    Parameters
    ----------
    clip : SampledClip or PointClip
        Any clip; each of its points has separate runs.
    """
    if not isinstance(clip, PointClip):
        return [stop - start for start, stop in runs_of(clip.timing.present)]
    rows = clip.timing.rows
    seen = (clip.points[rows, :, 3] > 0.0) & (rows >= 0)[:, None]
    return [stop - start for each in seen.T for start, stop in runs_of(each)]


def _rows_of_runs(present: Bools) -> list[slice]:
    """Return the rows of each run of present frames, for rows in frame order."""
    before = np.concatenate([[0], np.cumsum(present)])
    return [slice(int(before[a]), int(before[b])) for a, b in runs_of(present)]


def _points(
    points: Floats, runs: list[slice], chosen: Filter, rate: float, metres: float
) -> Floats:
    """Return filtered points (N, K, 4); a point is filtered while it is visible."""
    result = points.copy()
    for rows in runs:
        part = result[rows]
        # Points that are visible in the same frames are filtered together.
        together = defaultdict[tuple[int, int], list[int]](list)
        for point in range(points.shape[1]):
            for span in runs_of(part[:, point, 3] > 0.0):
                together[span].append(point)
        for (start, stop), numbers in together.items():
            seen = part[start:stop, numbers, :3]
            part[start:stop, numbers, :3] = chosen.positions(seen, rate, metres)
    return result
