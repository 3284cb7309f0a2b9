"""Motions that drive figures, stored so that they can be retargeted with another match."""

from __future__ import annotations

from collections.abc import Callable

from viewer.data_classes import dataclass
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.retargeting.joint_map import JointMap


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """A motion that drives a figure with different joints, and the retargeting options."""

    motion: SkeletonMotion
    """The motion of the source."""
    source_rest: int | str = "zero"
    """Rest pose of the motion, see ``viewer.rigs.retargeting.source_rest``."""
    joint_map: JointMap | None = None
    """The requested match of joints; None for the automatic one."""
    keeps_up: bool = False
    """Whether the result has the up axis of the motion's world instead of the figure's up axis."""
    plants_feet: bool = True
    """Whether feet stay planted while the source's feet are on the ground."""
    keeps_hands: bool = True
    """Whether hands stay at the body while the source's hands are at its own."""
    finish: Callable[[SampledClip], SampledClip] | None = None
    """Post-processes the resulting clip, as clean-up does."""
