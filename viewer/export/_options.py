"""What exporters of motions can be asked for; each takes what concerns its format."""

from __future__ import annotations

from dataclasses import dataclass, field

from viewer.rig.skinning import Skinning

__all__ = ["GAPS", "ROTATION_ORDERS", "MotionOptions"]

ROTATION_ORDERS = ("zyx", "zxy", "xyz", "xzy", "yxz", "yzx")
"""Orders of rotation channels as BVH lists them: the product R = Rz Ry Rx is ``zyx``."""

GAPS = {
    "hold": "hold the last pose",
    "interpolate": "rotations on the shorter arc between the frames around",
    "split": "one file for each run of frames",
}
"""What is written for missing frames."""

_CLOSED = "hold"  # the way of formats that know no missing frames


@dataclass(slots=True)
class MotionOptions:
    """How a motion is written.

    Attributes
    ----------
    unit : str
        A key of ``viewer.rig.units.METRES``; empty for the format's default.
    up : "y", "z" or ""
        The axis that points up in the file; empty for the format's default.
    rotation_order : str
        One of ``ROTATION_ORDERS``.
    gaps : str
        A key of ``GAPS``; empty for the format's default: missing frames are left out where the
        format can do so, and held where it cannot.
    rest_frame : bool
        Put the rest pose before the first frame.
    digits : int
        Decimals of text formats.
    world_up : "y", "z", "-y" or "-z"
        The axis that points up in the world of the animation; the last two only for exporters that
        keep that world.
    skinning : Skinning
        How joints move the mesh, where vertices are written.
    """

    unit: str = ""
    up: str = ""
    rotation_order: str = "zyx"
    gaps: str = ""
    rest_frame: bool = False
    digits: int = 6
    world_up: str = "y"
    skinning: Skinning = field(default_factory=Skinning)

    @property
    def closing(self) -> str:
        """How gaps are closed in formats that know no missing frames: a key of ``GAPS``."""
        return self.gaps or _CLOSED
