"""Options of exports; each exporter uses the options of its format."""

from __future__ import annotations

from dataclasses import field
from typing import Literal, TypeAlias

from viewer.data_classes import dataclass, setting
from viewer.rigs.geometry.vectors import SignedUp, Up
from viewer.rigs.skinning import Skinning
from viewer.rigs.units import METRES

RotationOrder: TypeAlias = Literal["zyx", "zxy", "xyz", "xzy", "yxz", "yzx"]
ROTATION_ORDERS: tuple[RotationOrder, ...] = ("zyx", "zxy", "xyz", "xzy", "yxz", "yzx")
"""Orders of rotation channels as BVH lists them: the product R = Rz Ry Rx is ``zyx``."""

QuaternionOrder: TypeAlias = Literal["xyzw", "wxyz"]
QUATERNIONS: tuple[QuaternionOrder, ...] = ("xyzw", "wxyz")
"""Orders of quaternion components in arrays."""

GapHandling: TypeAlias = Literal["hold", "interpolate", "split"]
GAPS: dict[GapHandling, str] = {
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

_CLOSED: GapHandling = "hold"  # default of formats that do not support missing frames


@dataclass(frozen=True, slots=True)
class VrmMeta:
    """Meta data of a VRM character; empty values keep those of its file."""

    name: str = setting("", "name of the character", flag="--vrm-name", metavar="NAME")
    """That of the figure if it is empty and there is no VRM file."""
    authors: tuple[str, ...] = setting(
        (),
        "an author; may be repeated; required for figures from other formats",
        flag="--vrm-author",
        action="append",
        given=[],
        read=tuple,
        metavar="NAME",
    )
    licence: str = setting(
        "",
        "address of the licence; required for figures from other formats",
        flag="--vrm-licence",
        metavar="URL",
    )


@dataclass(frozen=True, slots=True)
class PageOptions:
    """What an HTML page shows besides its figures."""

    caption: str = setting("", "text above the picture", metavar="TEXT")
    wipes: bool = setting(
        False,
        "begin with a divider: the first figure on its left, the others on its right, in the same "
        "place",
        flag="--wipe",
    )


@dataclass(slots=True)
class ExportOptions:
    """Options for writing poses and motions."""

    kind: str = setting(
        "",
        "the format, if the suffix is ambiguous; motions: {usual}",
        flag="--as",
        dest="kind",
    )
    """A key of ``EXPORTERS``; empty for the one that suits the suffix and the figures."""
    unit: str = setting(
        "", "unit of the file (default: cm in BVH)", flag="--to-unit", choices=METRES
    )
    up: Literal[""] | Up = setting(
        "",
        "up axis of the file (default: y in BVH, z in SMPL-X)",
        flag="--to-up",
        choices=("y", "z"),
    )
    rotation_order: RotationOrder = setting(
        "zyx", "BVH (default: {default})", choices=ROTATION_ORDERS
    )
    quaternions: QuaternionOrder = setting(
        "xyzw",
        "arrays (.npz): order of the components (default: {default})",
        choices=QUATERNIONS,
    )
    gaps: Literal[""] | GapHandling = ""
    """Empty for the format's default: missing frames are omitted if the format
    allows it, and held otherwise."""
    rest_frame: bool = setting(False, "BVH: begin with a rest pose frame")
    digits: int = setting(
        6, "BVH: decimals, 1 to 15 (default: {default})", limits=(1, 15), read=int, metavar="N"
    )
    safe_names: bool = setting(False, f"BVH: {SAFE_NAMES}")
    world_up: SignedUp = "y"
    """Up axis of the animation's world; negative only for exporters that keep that world."""
    skinning: Skinning = field(default_factory=Skinning)
    """Skinning method and options, if vertices are written."""
    optimizes: bool = setting(
        False,
        "glTF: quantise positions, normals, texture coordinates and weights to 16 bits "
        "(KHR_mesh_quantization); the errors are printed",
        flag="--optimize",
    )
    meta: VrmMeta = field(default_factory=VrmMeta)
    """Name, authors and licence of a VRM character."""
    page: PageOptions = field(default_factory=PageOptions)
    """Caption and divider of an HTML page."""

    @property
    def closing(self) -> GapHandling:
        """Handling of gaps in formats that do not support missing frames."""
        return self.gaps or _CLOSED
