"""Notes about a motion that was read back: largest errors of joints and vertices."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic
from viewer.export._losses.largest_distances import (
    Apart,
    Farthest,
    apart,
    apart_notes,
    negligible,
    reach_of,
    sampling,
    tolerance,
)
from viewer.export._losses.posed_bodies import Side, changing, figure_side, linear_as_opened
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.motion.evaluation import Frames, frames_between
from viewer.rig.motion.sampled_animation import SampledAnimation
from viewer.rig.skinning import Skinning


def shape_changes(frames: Frames) -> bool:
    """Return whether the shape of a figure changes over its present frames."""
    weights = frames.shape_weights
    weights = weights if len(weights) == 1 else weights[frames.present]
    return bool(np.ptp(weights, axis=0).any())


class PartLosses:
    """Largest errors of a file without a mesh, found part by part; ``n_frames`` are compared."""

    def __init__(self, how: Skinning, n_frames: int) -> None:
        self._how, self._n_frames = linear_as_opened(how), n_frames
        self._n_seen, self._n_compared, self._reach = 0, 0, 0.0
        self._joints: Farthest | None = None
        self._vertices: Farthest | None = None

    def look(self, part: SampledAnimation, written: Side, shape: Floats) -> None:
        """Compare the next part with the file's poses of its frames, for shape weights (S,)."""
        figure, frames = part.figure, part.frames
        rows = np.flatnonzero(frames.present)
        found = apart(figure_side(figure, frames, self._how, shape), written, rows, 0.0)
        self._joints = self._farther(self._joints, found.joints)
        self._vertices = self._farther(self._vertices, found.vertices)
        places = np.arange(len(rows)) + self._n_compared
        sized = rows[places % sampling(self._n_frames) == 0]
        if len(sized):
            self._reach = max(self._reach, reach_of(figure, frames_between(frames, sized)))
        self._n_seen += frames.n_frames
        self._n_compared += len(rows)

    def _farther(self, known: Farthest | None, found: Farthest | None) -> Farthest | None:
        if found is None or (known is not None and known.distance >= found.distance):
            return known
        return replace(found, frame=found.frame + self._n_seen)

    def notes(self, path: Path, figure: Figure, first_frame: int) -> list[Diagnostic]:
        """Return a note with the largest errors, if there are any."""
        least = tolerance(figure, self._reach)
        joints, vertices = (
            None if each is None or each.distance <= least else each
            for each in (self._joints, self._vertices)
        )
        found = Apart(joints, vertices, self._n_compared, self._n_compared)
        return apart_notes(
            path, figure, found, first_frame, vertices="vertices of a skin driven by it"
        )


def frames_losses(
    path: Path,
    animation: SampledAnimation,
    written: Frames,
    how: Skinning,
    span: tuple[int, int] | None = None,
    is_between: bool = False,
) -> list[Diagnostic]:
    """Return a note with the largest errors of poses that were read back, if there are any.

    ``path``: the written file.
    ``animation``: the original; missing frames are not compared.
    ``written``: contents of the file: poses of the animation's figure, one per frame of the span.
    ``how``: skinning of the mesh; for both motions LBS replaces its method.
    ``span``: half-open range of frames in the file; all if
      omitted.
    ``is_between``: whether the times of these poses are between the frames.
    """
    figure, frames = animation.figure, animation.frames
    first, stop = (0, frames.n_frames) if span is None else span
    rows = first + np.flatnonzero(frames.present[first:stop])
    still = written.shape_weights[0]
    columns = np.union1d(changing(frames, still), changing(written, still))
    linear = linear_as_opened(how)
    expected = figure_side(figure, frames, linear, still, columns)
    found_side = figure_side(figure, written, linear, still, columns)
    least = negligible(figure, frames, rows)
    found = apart(expected, found_side, rows, least, rows - first)
    if is_between:
        return apart_notes(path, figure, found, None, original="the motion between frames")
    return apart_notes(path, figure, found, animation.first_frame)
