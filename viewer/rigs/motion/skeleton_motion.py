"""A skeleton together with its motion, the contents of one file of motion capture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.motion.sampled_clip import SampledClip


@dataclass(frozen=True, slots=True, eq=False)
class SkeletonMotion:
    """Contents of a motion capture file with its own hierarchy."""

    figure: Figure
    """A skeleton without a mesh."""
    clip: SampledClip
    """Motion of the figure."""
    unit_note: Phrase | None = None
    """Explains how the figure's unit was estimated; None if it was not estimated."""
    up_notes: tuple[Phrase, ...] = ()
    """Explain how the up axis was estimated, and state any contrary evidence."""
    hangs: bool = False
    """Whether the up axis of the figure points down, as in the space of many cameras."""
    expressions: Mapping[str, Floats] = field(default_factory=dict)
    """mapping of str to (N,). Weights of facial expressions at each row of the clip, by their names
    in VRM 1.0."""
