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
    """Settings for reading and assigning motions; by default as stated in the files.

    Attributes
    ----------
    model : str, Path or None
        The figure for captured bodies, which BVH motions also drive: a file, or a name as for
        ``viewer.models.named_files``; None for a figure among the files, or for captured bodies
        the model of the model folder that they were recorded with, or the bundled body.
    gender : "female", "male", "neutral" or ""
        Gender of the models that are chosen for captured bodies; empty for that of the files.
    rig : str
        Rig of a body model to read, for Anny; empty for its default.
    lod : str
        Level of detail, for MHR; empty for its default.
    frame_rate : float or None
        Frames per second; None for the file's own, or 30 if it has none.
    up : "y", "z", "-y", "-z" or ""
        The up axis of captures and BVH; empty to detect it from the bodies.
    unit : str
        Unit of BVH lengths, which are converted to metres: a key of ``viewer.rig.units.METRES``;
        empty to estimate it from the skeleton's size.
    flat_hands : bool or None
        Whether hand components are relative to the flat hand; None for the model's convention.
    layout : str
        Layout of captured keypoints, a title of ``viewer.rig.captures.keypoint_layouts``; if empty,
        determined by their number.
    legacy_expression : bool
        Whether expressions drive SMPL-X columns 10 to 19, as in EasyMocap.
    drives : bool
        Whether a BVH drives a figure opened with it, instead of being shown next to it.
    images : Path or None
        Folder with an image folder for each camera of a capture; None for ``images`` next to the
        capture.
    video : Path or None
        Video of a capture's camera; also sets the frame rate of captures that have none.
    animation : str
        The animation that figures play, by name or by number from 1; ``"none"`` for their rest
        pose, empty for the first.
    motions : tuple of Path
        Further files whose motion drives a figure: the animation called ``animation``, or the first
        one.
    springs : bool
        Whether spring joints, such as those of hair, are simulated while a motion plays.
    space : "world", "camera" or ""
        The space of results of video motion capture; empty for the world, if they have it.
    is_overlay : bool
        Whether results of video motion capture are in camera space, if ``space`` is empty.
    average_shape : bool
        Whether people of video motion capture keep one shape, the average over time.
    source_rest : int, "zero" or "auto"
        Rest pose of skeletons whose motion drives a figure: the number of a frame, ``"zero"`` for
        the zero pose of the file, ``"auto"`` for the zero pose if it is a standing pose, otherwise
        a frame in a T- or A-pose, otherwise an estimate from the anatomy.
    feet : bool
        Whether the feet of driven figures are planted while the feet of the motion are on the
        ground.
    joint_map : JointMap or None
        Joints of driven figures and the joints that drive them; None to match them by name.
    """

    model: str | Path | None = None
    gender: str = ""
    rig: str = ""
    lod: str = ""
    frame_rate: float | None = None
    up: str = ""
    unit: str = ""
    flat_hands: bool | None = None
    layout: str = ""
    legacy_expression: bool = False
    drives: bool = True
    images: Path | None = None
    video: Path | None = None
    animation: str = ""
    motions: tuple[Path, ...] = ()
    springs: bool = False
    space: str = ""
    is_overlay: bool = False
    average_shape: bool = False
    source_rest: int | str = "auto"
    feet: bool = True
    joint_map: JointMap | None = None


@dataclass(frozen=True, slots=True)
class CleanUp:
    """Requested changes to captured motions, in the order in which they are applied.

    Attributes
    ----------
    merged : tuple of tuple of int
        Numbers of people whose tracks belong to one person, who keeps the first number.
    interpolates : bool
        Whether gaps are interpolated.
    longest_gap : int or float
        Longest gap to interpolate: frames as an integer, seconds as a float.
    smoothing : OneEuro, SavitzkyGolay or None
        The filter.
    locks_feet : bool
        Whether feet are held in place during ground contact.
    grounds : bool
        Whether people are moved up or down until their feet rest at height 0.
    frames : (int or None, int or None) or None
        First frame to keep and the frame after the last one, numbered as in the file; None for the
        motion's own ends.
    rate : float or None
        New frame rate, frames per second.
    """

    merged: tuple[tuple[int, ...], ...] = ()
    interpolates: bool = False
    longest_gap: int | float = 1.0
    smoothing: OneEuro | SavitzkyGolay | None = None
    locks_feet: bool = False
    grounds: bool = False
    frames: tuple[int | None, int | None] | None = None
    rate: float | None = None

    @property
    def is_empty(self) -> bool:
        """Whether nothing is requested."""
        return self == CleanUp()
