"""Textures: images with their placement and sampling."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rig.arrays import Bytes, Floats, frozen

__all__ = ["MINIFICATIONS", "WRAPS", "Texture", "check_choice"]

WRAPS = ("clamp", "repeat", "mirror")
"""Texture coordinates outside 0 to 1: clamped, repeated, or mirrored on every other repeat."""

MINIFICATIONS = (
    *("nearest", "linear", "nearest_mipmap_nearest"),
    *("linear_mipmap_nearest", "nearest_mipmap_linear", "linear_mipmap_linear"),
)
"""Filters of minified images, with their names in OpenGL and glTF."""


@dataclass(frozen=True, slots=True, eq=False)
class Texture:
    """An image, and its placement and sampling.

    Attributes
    ----------
    name : str
        File name of the image, relative to the figure's folder.
    image : (H, W, 4) uint8 or None
        Pixels with alpha, first row at v = 1; sRGB in colour textures, linear in others;
        None if it could not be read.
    channel : int
        Channel of ``image`` from which single-channel textures are read.
    uv_set : int
        0 for ``Mesh.uvs``, n for ``Mesh.other_uvs[n - 1]``.
    transform : (2, 3)
        Maps texture coordinates to image coordinates, whose v is 0 at the bottom row.
    wrap : (str, str)
        Entries of ``WRAPS`` along u and v.
    is_smooth : bool
        Whether pixels are interpolated.
    minification : str
        Entry of ``MINIFICATIONS``; empty for mipmaps, interpolated if ``is_smooth``.
    encoded : bytes or None
        The PNG or JPEG file that ``image`` was decoded from, if it was part of another file.
    """

    name: str
    image: Bytes | None = None
    channel: int = 0
    uv_set: int = 0
    transform: Floats | None = None
    wrap: tuple[str, str] = ("clamp", "clamp")
    is_smooth: bool = True
    minification: str = ""
    encoded: bytes | None = None

    def __post_init__(self) -> None:
        def put(name: str, values: object) -> None:
            object.__setattr__(self, name, values)

        if self.image is not None:
            put("image", frozen("image", self.image, (None, None, 4), np.uint8))
        placed = np.eye(2, 3) if self.transform is None else self.transform
        put("transform", frozen("transform", placed, (2, 3)))
        check_choice("channel", self.channel, range(4))
        check_choice("minification", self.minification, ("", *MINIFICATIONS))
        if self.uv_set < 0:
            raise RigError(f"uv_set: expected at least 0, found {self.uv_set}")
        for side in self.wrap:
            check_choice("wrap", side, WRAPS)

    @property
    def matrix(self) -> Floats:
        """``transform``, never None: (2, 3)."""
        assert self.transform is not None  # set by __post_init__
        return self.transform

    @property
    def is_placed_plainly(self) -> bool:
        """Whether the image covers texture coordinates from 0 to 1."""
        return np.array_equal(self.matrix, np.eye(2, 3))


def check_choice(name: str, value: object, choices: range | tuple[str, ...]) -> None:
    """Raise RigError unless a value is one of the choices."""
    if value not in choices:
        raise RigError(f"{name}: expected one of {', '.join(map(str, choices))}, found {value}")
