"""Options of exports; each exporter uses the options of its format."""

from __future__ import annotations

from dataclasses import field

from viewer.data_classes import dataclass
from viewer.rig.skinning import Skinning

ROTATION_ORDERS = ("zyx", "zxy", "xyz", "xzy", "yxz", "yzx")
"""Orders of rotation channels as BVH lists them: the product R = Rz Ry Rx is ``zyx``."""

QUATERNIONS = ("xyzw", "wxyz")
"""Orders of quaternion components in arrays."""

GAPS = {
    "hold": "hold the pose before the gap; at the start, the first pose",
    "interpolate": "interpolate between the frames around the gap, rotations along the shorter arc",
    "split": "one file for each run of frames",
}
"""Handling of missing frames."""

SAFE_NAMES = (
    "write joint names with letters, digits and underscores only, each name once, for programs "
    "that cannot read others; changed names are listed"
)
"""What ``ExportOptions.safe_names`` does, for the help of the option and of the check box."""

_CLOSED = "hold"  # default of formats that do not support missing frames


@dataclass(frozen=True, slots=True)
class VrmMeta:
    """Meta data of a VRM character; empty values keep those of its file."""

    name: str = ""
    """Name of the character; that of the figure if it has no VRM file."""
    authors: tuple[str, ...] = ()
    """At least one for figures from other files."""
    licence: str = ""
    """Address of the licence."""
    upgrades: bool = False
    """Write characters from VRM 0.x files as VRM 1.0."""


@dataclass(slots=True)
class ExportOptions:
    """Options for writing poses and motions."""

    kind: str = ""
    """A key of ``EXPORTERS``; empty for the one that suits the suffix and the figures."""
    unit: str = ""
    """A key of ``viewer.rig.units.METRES``; empty for the format's default."""
    up: str = ""
    """One of "y", "z" or "": up axis of the file; empty for the format's default."""
    rotation_order: str = "zyx"
    """One of ``ROTATION_ORDERS``."""
    quaternions: str = "xyzw"
    """One of ``QUATERNIONS``."""
    gaps: str = ""
    """A key of ``GAPS``; empty for the format's default: missing frames are omitted if the format
    allows it, and held otherwise."""
    rest_frame: bool = False
    """Put the rest pose before the first frame."""
    digits: int = 6
    """Decimals of text formats."""
    safe_names: bool = False
    """Write the names of joints with letters, digits and underscores only, each name once."""
    world_up: str = "y"
    """One of "y", "z", "-y" or "-z": the up axis of the animation's world; negative axes are only
    for exporters that keep that world."""
    skinning: Skinning = field(default_factory=Skinning)
    """Skinning method and options, if vertices are written."""
    optimizes: bool = False
    """Quantise the vertices of glTF files."""
    meta: VrmMeta = field(default_factory=VrmMeta)
    """Name, authors and licence of a VRM character."""

    @property
    def closing(self) -> str:
        """Handling of gaps in formats that do not support missing frames, a key of ``GAPS``."""
        return self.gaps or _CLOSED
