"""Settings for opening motions, and for cleaning up captured ones."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from viewer.data_classes import dataclass

if TYPE_CHECKING:
    from viewer.rig.cleanup.smoothing import OneEuro, SavitzkyGolay
    from viewer.rig.retargeting.joint_map import JointMap


@dataclass(frozen=True, slots=True)
class MotionSettings:
    """Settings for reading and assigning motions; by default as stated in the files."""

    model: str | Path | None = None
    """The figure for captured bodies, which BVH motions also drive: a file, or a name as for
    ``viewer.models.named_files``; None for a figure among the files, or for captured bodies the
    model of the model folder that they were recorded with, or the bundled body."""
    gender: str = ""
    """One of "female", "male", "neutral" or "": gender of the models that are chosen for captured
    bodies; empty for that of the files."""
    rig: str = ""
    """Rig of a body model to read, for Anny; empty for its default."""
    lod: str = ""
    """Level of detail, for MHR; empty for its default."""
    frame_rate: float | None = None
    """Frames per second; None for the file's own, or 30 if it has none."""
    up: str = ""
    """One of "y", "z", "-y", "-z" or "": the up axis of captures and BVH; empty to detect it from
    the bodies."""
    unit: str = ""
    """Unit of BVH lengths, which are converted to metres: a key of ``viewer.rig.units.METRES``;
    empty to estimate it from the skeleton's size."""
    flat_hands: bool | None = None
    """Whether hand components are relative to the flat hand; None for the model's convention."""
    layout: str = ""
    """Layout of captured keypoints, a title of ``viewer.rig.captures.keypoint_layouts``; if empty,
    determined by their number."""
    legacy_expression: bool = False
    """Whether expressions drive SMPL-X columns 10 to 19, as in EasyMocap."""
    drives: bool = True
    """Whether a BVH drives a figure opened with it, instead of being shown next to it."""
    images: Path | None = None
    """Folder with an image folder for each camera of a capture; None for ``images`` next to the
    capture."""
    video: Path | None = None
    """Video of a capture's camera; also sets the frame rate of captures that have none."""
    animation: str = ""
    """The animation that figures play, by name or by number from 1; ``"none"`` for their rest pose,
    empty for the first."""
    motions: tuple[Path, ...] = ()
    """Further files whose motion drives a figure: the animation called ``animation``, or the first
    one."""
    springs: bool = False
    """Whether spring joints, such as those of hair, are simulated while a motion plays."""
    space: str = ""
    """One of "world", "camera" or "": the space of results of video motion capture; empty for the
    world, if they have it."""
    is_overlay: bool = False
    """Whether results of video motion capture are in camera space, if ``space`` is empty."""
    average_shape: bool = False
    """Whether people of video motion capture keep one shape, the average over time."""
    source_rest: int | str = "auto"
    """Int, "zero" or "auto": rest pose of skeletons whose motion drives a figure: the number of a
    frame, ``"zero"`` for the zero pose of the file, ``"auto"`` for the zero pose if it is a
    standing pose, otherwise a frame in a T- or A-pose, otherwise an estimate from the anatomy."""
    feet: bool = True
    """Whether the feet of driven figures are planted while the feet of the motion are on the
    ground."""
    joint_map: JointMap | None = None
    """Joints of driven figures and the joints that drive them; None to match them by name."""


@dataclass(frozen=True, slots=True)
class CleanUp:
    """Requested changes to captured motions, in the order in which they are applied."""

    merged: tuple[tuple[int, ...], ...] = ()
    """Numbers of people whose tracks belong to one person, who keeps the first number."""
    interpolates: bool = False
    """Whether gaps are interpolated."""
    longest_gap: int | float = 1.0
    """Longest gap to interpolate: frames as an integer, seconds as a float."""
    smoothing: OneEuro | SavitzkyGolay | None = None
    """The filter."""
    locks_feet: bool = False
    """Whether feet are held in place during ground contact."""
    grounds: bool = False
    """Whether people are moved up or down until their feet rest at height 0."""
    frames: tuple[int | None, int | None] | None = None
    """First frame to keep and the frame after the last one, numbered as in the file; None for the
    motion's own ends."""
    rate: float | None = None
    """New frame rate, frames per second."""

    @property
    def is_empty(self) -> bool:
        """Whether nothing is requested."""
        return self == CleanUp()
