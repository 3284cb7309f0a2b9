"""Lines about a motion that was read back: largest differences of joints and vertices."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.export._losses.apart import apart, apart_lines, negligible
from viewer.export._losses.skinned import Side, changing, figure_side
from viewer.rig.arrays import Floats
from viewer.rig.motion.evaluation import Frames
from viewer.rig.motion.sampled_animation import SampledAnimation
from viewer.rig.skinning import Skinning

__all__ = ["driven_losses", "frames_losses", "shape_changes"]


def shape_changes(frames: Frames) -> bool:
    """Return whether the shape of a figure changes over the frames that are present."""
    weights = frames.shape_weights
    weights = weights if len(weights) == 1 else weights[frames.present]
    return bool(np.ptp(weights, axis=0).any())


def driven_losses(
    path: Path,
    animation: SampledAnimation,
    written: Side,
    how: Skinning,
    span: tuple[int, int],
    shape: Floats,
) -> list[str]:
    """Return a line with the largest differences of a file without a mesh, or none.

    Parameters
    ----------
    path : Path
        What was written.
    animation : SampledAnimation
        What was to be written; frames that are missing are not compared.
    written : Side
        What the file says, by the animation's frames.
    how : Skinning
        What moves the mesh here; blended linearly.
    span : (int, int)
        The frames that are in the file: the first, and the one behind the last.
    shape : (S,)
        Weights of the shape that the file's skeleton has.
    """
    rows = span[0] + np.flatnonzero(animation.frames.present[slice(*span)])
    meant = figure_side(animation.figure, animation.frames, replace(how, method="lbs"), shape)
    found = apart(meant, written, rows, negligible(animation.figure, animation.frames, rows))
    meshes = "vertices of a skin driven by it"
    return apart_lines(path, animation.figure, found, animation.first_frame, meshes=meshes)


def frames_losses(
    path: Path,
    animation: SampledAnimation,
    written: Frames,
    how: Skinning,
    span: tuple[int, int] | None = None,
    places: str = "",
) -> list[str]:
    """Return a line with the largest differences of poses that were read back, or none.

    Parameters
    ----------
    path : Path
        What was written.
    animation : SampledAnimation
        What was to be written; frames that are missing are not compared.
    written : Frames
        What the file says: poses of the animation's figure, as many as the span has.
    how : Skinning
        What moves the mesh; blended linearly, by the motion here and the one that was read alike.
    span : (int, int), optional
        The frames that are in the file: the first, and the one behind the last; all if omitted.
    places : str
        Where these poses are, in words, if not on the frames.
    """
    figure, frames = animation.figure, animation.frames
    first, stop = (0, frames.n_frames) if span is None else span
    rows = first + np.flatnonzero(frames.present[first:stop])
    still = written.shape_weights[0]
    columns = np.union1d(changing(frames, still), changing(written, still))
    linear = replace(how, method="lbs")
    meant = figure_side(figure, frames, linear, still, columns)
    found_side = figure_side(figure, written, linear, still, columns)
    least = negligible(figure, frames, rows)
    found = apart(meant, found_side, rows, least, rows - first)
    versus = f"the motion {places}" if places else ""
    return apart_lines(
        path, figure, found, None if places else animation.first_frame, versus=versus
    )
