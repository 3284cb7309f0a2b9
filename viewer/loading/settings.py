"""Settings for opening motions, and for cleaning up captured ones."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from viewer.data_classes import dataclass, setting
from viewer.rigs.bodies.smpl_family import GENDERS
from viewer.rigs.geometry.vectors import SIGNED_UPS, StatedUp
from viewer.rigs.units import METRES

if TYPE_CHECKING:
    from viewer.rigs.cleanup.smoothing import OneEuro, SavitzkyGolay
    from viewer.rigs.motion.skeleton_motion import SkeletonMotion
    from viewer.rigs.retargeting.drive import Drive
    from viewer.rigs.retargeting.joint_map import JointMap


@dataclass(frozen=True, slots=True)
class MotionSettings:
    """Settings for reading and assigning motions; by default as stated in the files."""

    model: str | Path | None = setting(
        None,
        "body model for captured bodies, or figure that a BVH file drives: a file, or a name such "
        "as smplx, smplx:female, body or fox (default: one of FILES; for captured bodies, "
        "otherwise their model in the model folder, or the bundled body)",
        metavar="FIGURE",
    )
    gender: str = setting(
        "",
        "gender of the body model for captured bodies (default: as stated by their files)",
        choices=GENDERS,
    )
    rig: str = setting("", "rig of Anny: default, mixamo, game_engine, cmu_mb", metavar="NAME")
    """Rig of a body model to read; empty for its default."""
    lod: str = setting("", "level of detail of MHR, 0 (fine) to 6 (coarse)", metavar="N")
    frame_rate: float | None = None
    """Frames per second; None for the file's own, or 30 if it has none."""
    up: StatedUp = setting("", "up axis of captures, BVH, OBJ and PLY files", choices=SIGNED_UPS)
    """Empty to detect it from the bodies."""
    unit: str = setting(
        "",
        "length unit of BVH, OBJ and PLY files (default: estimated in BVH, else unknown)",
        choices=METRES,
    )
    """Lengths of BVH files are converted from it to metres; those of meshes stay in it."""
    flat_hands: bool | None = None
    """Whether hand components are relative to the flat hand; None for the model's convention."""
    layout: str = setting(
        "",
        "layout of captured keypoints, if their number is ambiguous",
        # Layouts with the same number of points as another one.
        choices=("body19", "panoptic", "coco", "h36m"),
    )
    legacy_expression: bool = setting(
        False, "apply expressions to SMPL-X columns 10 to 19, as EasyMocap does"
    )
    drives: bool = setting(
        True, "show a BVH next to the figures instead of driving one", flag="--beside"
    )
    """Whether a BVH drives a figure opened with it, instead of being shown next to it."""
    images: Path | None = setting(
        None,
        "folder of the cameras' images, as in FOLDER/01/000000.jpg (default: images, next to the "
        "capture); for a single camera also a folder of its numbered images",
        read=Path,
        metavar="FOLDER",
    )
    video: Path | None = setting(
        None,
        "video of a capture's camera, drawn behind the scene when it is seen through that camera, "
        "as it is by default; also sets the frame rate of captures that have none (needs PyAV)",
        read=Path,
        metavar="FILE",
    )
    animation: str = setting(
        "",
        "animation of a file to play: a name, a number from 1, or none; viewer info lists them "
        "(default: the first)",
        metavar="NAME",
    )
    """``"none"`` is the rest pose."""
    motions: tuple[Path, ...] = ()
    """Further files whose motion drives a figure: the animation called ``animation``, or the first
    one."""
    springs: bool = setting(
        False,
        "simulate spring joints, such as hair in VRM files, while a motion plays (default: on)",
        choices=("on", "off"),
        given="on",
        read="on".__eq__,
    )
    space: str = setting(
        "",
        "space of video motion capture (default: the world, if the file has it)",
        choices=("world", "camera"),
    )
    is_overlay: bool = False
    """Whether results of video motion capture are in camera space, if ``space`` is empty."""
    average_shape: bool = setting(
        False, "average each person's shape over time if the files have one per frame"
    )
    source_rest: int | str = setting(
        "auto",
        "rest pose of a skeleton that drives a figure: frame N, the file's zero pose, or auto: the "
        "zero pose if it is a standing pose, otherwise a T-pose if the joint axes are parallel to "
        "the body's in it, otherwise a frame in a T- or A-pose, otherwise estimated from the "
        "motion (default: {default})",
        metavar="N|zero|auto",
    )
    feet: bool = setting(
        True,
        "plant the feet of driven figures while the feet of the motion are on the ground "
        "(default: on)",
        flag="--feet",
        choices=("on", "off"),
        given="on",
        read="on".__eq__,
    )
    hand_contact: bool = setting(
        True,
        "keep the hands of driven figures at the body while the hands of the motion are at theirs "
        "(default: on)",
        flag="--hand-contact",
        choices=("on", "off"),
        given="on",
        read="on".__eq__,
    )
    joint_map: JointMap | None = None
    """Joints of driven figures and the joints that drive them; None to match them by name."""

    def drive_of(self, motion: SkeletonMotion) -> Drive:
        """Return a motion that drives figures."""
        from viewer.rigs.retargeting.drive import Drive
        from viewer.rigs.retargeting.retarget import with_tips

        return Drive(
            with_tips(motion),
            self.source_rest,
            self.joint_map,
            plants_feet=self.feet,
            keeps_hands=self.hand_contact,
        )


@dataclass(frozen=True, slots=True)
class CleanUp:
    """Requested changes to captured motions, in the order in which they are applied."""

    merged: tuple[tuple[int, ...], ...] = setting(
        (),
        "IDs of tracks that belong to one person, who keeps ID A; may be repeated",
        flag="--merge-ids",
        action="append",
        given=[],
        read=tuple,
        metavar="A,B,…",
    )
    interpolates: bool = False
    """Whether gaps are interpolated."""
    longest_gap: int | float = 1.0
    """Longest gap to interpolate: frames as an integer, seconds as a float."""
    smoothing: OneEuro | SavitzkyGolay | None = setting(
        None,
        "smooth rotations and translations: savgol (default), savgol:window=7,order=2 (an odd "
        "number of frames, the degree), one-euro or one-euro:cutoff=3,beta=2 (Hz; Hz per rad/s and "
        "per m/s)",
        flag="--smooth",
        metavar="FILTER",
    )
    locks_feet: bool = setting(
        False,
        "hold feet in place while they touch the ground; legs follow, and so does the body if they "
        "are too short",
        flag="--lock-feet",
    )
    grounds: bool = setting(
        False,
        "move people up or down until their feet rest at height 0, z = 0 or y = 0",
        flag="--ground",
    )
    frames: tuple[int | None, int | None] | None = setting(
        None, "keep frames A to B - 1; A or B may be omitted", flag="--trim", metavar="A:B"
    )
    """First frame and the frame after the last one, numbered as in the file; None for the motion's
    own ends."""
    rate: float | None = setting(
        None,
        "interpolate at R frames per second (--fps instead changes the speed)",
        flag="--resample",
        metavar="R",
    )

    @property
    def is_empty(self) -> bool:
        """Whether nothing is requested."""
        return self == CleanUp()
