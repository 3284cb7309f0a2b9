"""What a rig transfer makes: a figure of the target, and what is known about every vertex."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from viewer.autorig.alignment.surface_alignment import Alignment
from viewer.autorig.transfer.clip_transfer import carry_clip
from viewer.autorig.weights.result import WeightTransfer
from viewer.rig.annotations import VertexField
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.figure import Figure
from viewer.rig.motion.clip import Clip
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.pose import Pose

__all__ = ["CONFIDENCE", "Rigged", "clip_for", "with_fields"]

CONFIDENCE = ("matched", "filled", "rigid")
"""How a vertex came to its weights: from the template's surface under it, from its neighbours,
or as part of an island that hangs rigidly on the template."""


@dataclass(frozen=True, slots=True, eq=False)
class Rigged:
    """A target mesh that became a figure.

    Attributes
    ----------
    figure : Figure
        The target at rest, with its texture coordinates and materials.
    pose : Pose
        Poses the figure as the target was found.
    placement : (4, 4)
        From the posed figure to the target's frame; the identity unless the method altered the
        target.
    alignment : Alignment or None
        Where the template lay; None for a method that only lays boxes onto each other.
    weights : WeightTransfer
        Matches, distances and parts that hang rigidly.
    guarded : (V,) bool
        Vertices whose blended matrix was nearly singular.
    residual : float
        Largest distance between the posed figure and the target, over the target's size.
    outside : tuple of int
        Joints that lie outside the target, and inside the template.
    length_scale, figure_scale, path_scale : float
        What ``clip_for`` scales lengths by.
    lines : tuple of str
        What a person should know, one sentence each.
    """

    figure: Figure
    pose: Pose
    placement: Floats
    alignment: Alignment | None
    weights: WeightTransfer
    guarded: Bools
    residual: float
    outside: tuple[int, ...]
    length_scale: float
    figure_scale: float
    path_scale: float
    lines: tuple[str, ...]

    @property
    def confidence(self) -> Ints:
        """Index into ``CONFIDENCE`` of every vertex: (V,) int32."""
        weights = self.weights
        return np.where(weights.matched, 0, np.where(weights.filled, 1, 2)).astype(np.int32)


def with_fields(rigged: Rigged) -> Rigged:
    """Return the same with a figure whose fields say how sure each vertex is.

    ``"confidence"`` is the way a vertex came to its weights, ``"distance"`` how far it was from
    the template's surface as it was laid onto it, ``"guarded"`` where its rest position is a
    guess.
    """
    confidence = rigged.confidence.astype(np.float64)
    guarded = rigged.guarded.astype(np.float64)
    fields = (
        VertexField("confidence", "How weights were found", confidence, names=CONFIDENCE),
        VertexField("distance", "Distance to the template", rigged.weights.distances, "length"),
        VertexField("guarded", "Rest position", guarded, names=("exact", "guarded")),
    )
    return replace(rigged, figure=replace(rigged.figure, fields=fields))


def clip_for(rigged: Rigged, clip: Clip | SampledClip) -> Clip | SampledClip:
    """Return a clip of the template for the rigged figure; see ``carry_clip``.

    Raises
    ------
    RigError
        If it is a clip of another skeleton.
    """
    skeleton = rigged.figure.skeleton
    assert skeleton is not None  # a rigged figure has one
    return carry_clip(clip, skeleton, rigged.length_scale, rigged.figure_scale, rigged.path_scale)
