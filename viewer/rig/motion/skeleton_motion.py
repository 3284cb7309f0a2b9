"""A skeleton together with its motion, the contents of one BVH file."""

from __future__ import annotations

from dataclasses import dataclass

from viewer.diagnostics import Phrase
from viewer.rig.figure import Figure
from viewer.rig.motion.sampled_clip import SampledClip

__all__ = ["SkeletonMotion"]


@dataclass(frozen=True, slots=True, eq=False)
class SkeletonMotion:
    """Contents of a motion capture file with its own hierarchy.

    Attributes
    ----------
    figure : Figure
        A skeleton without a mesh.
    clip : SampledClip
        Motion of the figure.
    unit_note : Phrase or None
        Explains how the figure's unit was estimated; None if it was not.
    up_notes : tuple of Phrase
        Explain how the up axis was estimated, and give any contrary evidence.
    """

    figure: Figure
    clip: SampledClip
    unit_note: Phrase | None = None
    up_notes: tuple[Phrase, ...] = ()
