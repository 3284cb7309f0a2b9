"""A skeleton and its motion, as one file holds both (BVH)."""

from __future__ import annotations

from dataclasses import dataclass

from viewer.rig.figure import Figure
from viewer.rig.motion.sampled_clip import SampledClip

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
    unit_note : str
        How the figure's unit was guessed, in words; empty if there is nothing to say.
    up_notes : tuple of str
        How its up axis was guessed, and what speaks against it.
    """

    figure: Figure
    clip: SampledClip
    unit_note: str = ""
    up_notes: tuple[str, ...] = ()
