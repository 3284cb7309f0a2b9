"""Result of a rig transfer: the rigged figure, and the origin of every vertex's weights."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.autorig.alignment.surface_alignment import Alignment
from viewer.autorig.transfer.clip_transfer import transfer_clip
from viewer.autorig.weights.result import WeightTransfer
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.rig.annotations import VertexField
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.figure import Figure
from viewer.rig.motion.clip import Clip
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.pose import Pose

CONFIDENCE = ("matched", "inpainted", "rigid")
"""Origin of a vertex's weights: the closest surface of the template, the vertex's neighbours,
or the rigid attachment of its island."""


@dataclass(frozen=True, slots=True, eq=False)
class Rigged:
    """A target mesh that was rigged."""

    figure: Figure
    """The target at rest, with its texture coordinates and materials."""
    pose: Pose
    """The pose that reproduces the target."""
    placement: Floats
    """(4, 4). Maps the posed figure to the target's frame; the identity unless the method changed
    the target."""
    alignment: Alignment | None
    """Placement of the template; None for a method that only aligns boxes."""
    weights: WeightTransfer
    """Matches, distances and rigidly attached parts."""
    guarded: Bools
    """(V,) bool. Vertices whose blended matrix was nearly singular."""
    residual: float
    """Largest distance between the posed figure and the target, over the target's size."""
    outside: tuple[int, ...]
    """Joints that lie outside the target but inside the template."""
    length_scale: float
    figure_scale: float
    path_scale: float
    """Factors by which ``clip_for`` scales lengths."""
    lines: tuple[Diagnostic, ...]
    """Messages for the user."""

    @property
    def confidence(self) -> Ints:
        """Index into ``CONFIDENCE`` of every vertex: (V,) int32."""
        weights = self.weights
        return np.where(weights.matched, 0, np.where(weights.inpainted, 1, 2)).astype(np.int32)


def with_fields(rigged: Rigged) -> Rigged:
    """Return a copy with scalar fields that show the certainty of each vertex.

    ``"confidence"`` is the origin of a vertex's weights, ``"distance"`` its distance from
    the aligned template's surface, ``"guarded"`` whether its rest position is an
    estimate.
    """
    confidence = rigged.confidence.astype(np.float64)
    guarded = rigged.guarded.astype(np.float64)
    fields = (
        VertexField("confidence", "Origin of weights", confidence, names=CONFIDENCE),
        VertexField("distance", "Distance to the template", rigged.weights.distances, "length"),
        VertexField("guarded", "Rest position", guarded, names=("exact", "estimated")),
    )
    return replace(rigged, figure=replace(rigged.figure, fields=fields))


def clip_for(rigged: Rigged, clip: Clip | SampledClip) -> Clip | SampledClip:
    """Return a clip of the template for the rigged figure; see ``transfer_clip``."""
    skeleton = rigged.figure.require_skeleton()
    return transfer_clip(
        clip, skeleton, rigged.length_scale, rigged.figure_scale, rigged.path_scale
    )
