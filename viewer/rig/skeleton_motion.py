"""A skeleton and its motion, as one file holds both (BVH)."""

from __future__ import annotations

from dataclasses import dataclass

from viewer.rig.figure import Figure
from viewer.rig.sampled_clip import SampledClip

__all__ = ["SkeletonMotion"]


@dataclass(frozen=True, slots=True, eq=False)
class SkeletonMotion:
    """What a motion capture file with its own hierarchy holds.

    Attributes
    ----------
    figure : Figure
        A skeleton without a mesh.
    clip : SampledClip
        Its motion.
    """

    figure: Figure
    clip: SampledClip
