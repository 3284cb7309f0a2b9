"""Materials: the surface appearance of triangles, in the metallic-roughness model of glTF 2.0.

In addition, there is toon shading with rim light and outline, as in ``VRMC_materials_mtoon`` 1.0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, Literal, TypeAlias

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Bytes, Floats, freeze_fields
from viewer.rigs.checked_fields import checked

AlphaMode: TypeAlias = Literal["opaque", "mask", "blend"]
ALPHA_MODES: tuple[AlphaMode, ...] = ("opaque", "mask", "blend")
"""Alpha is ignored; surfaces are cut out below the cutoff; or they are blended with the
background."""

TEXTURES = (
    *("base_texture", "metallic_texture", "roughness_texture"),
    *("normal_texture", "occlusion_texture", "emissive_texture", "shade_texture"),
)
"""Fields of a material that contain textures."""

Wrap: TypeAlias = Literal["clamp", "repeat", "mirror"]
"""Texture coordinates outside 0 to 1: clamped, repeated, or mirrored on every other repeat."""
MINIFICATIONS = (
    *("nearest", "linear", "nearest_mipmap_nearest"),
    *("linear_mipmap_nearest", "nearest_mipmap_linear", "linear_mipmap_linear"),
)
"""Filters of minified images, with their names in OpenGL and glTF."""

OutlineMode: TypeAlias = Literal["world", "screen"]
"""Units of outline widths: lengths, or fractions of the image height."""
Color = tuple[float, float, float]


@checked
@dataclass(frozen=True, slots=True, eq=False)
class Material:
    """The surface appearance of some triangles.

    Factors multiply their textures, as in glTF 2.0, section 3.9.
    """

    name: str = ""
    """Name in the file; triangles refer to materials by index."""
    base_texture: Texture | None = None
    """Colour and opacity, sRGB."""
    base_color: tuple[float, float, float, float] | None = None
    """(r, g, b, a) or None. Linear, 0 to 1; None for a material without a colour, which is white
    under a texture and otherwise has the figure's colour."""
    metallic: float = 0.0
    roughness: float = 0.6
    """0 to 1; roughness is perceptual, the square root of the GGX width."""
    metallic_texture: Texture | None = None
    roughness_texture: Texture | None = None
    """One channel each, often of the same image."""
    normal_texture: Texture | None = None
    """Tangent space normals: red along u, green along v, blue outwards, 0 to 255 for -1 to 1."""
    normal_scale: float = 1.0
    """Multiplier for the red and green components of the normals."""
    occlusion_texture: Texture | None = None
    """Fraction of the ambient light that arrives; one channel."""
    occlusion_strength: float = 1.0
    emissive: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """(r, g, b). Emitted light, linear; may exceed 1."""
    emissive_texture: Texture | None = None
    """Colour of the emitted light, sRGB."""
    alpha_mode: AlphaMode = "opaque"
    alpha_cutoff: float = 0.5
    """Minimum opacity that is drawn in the mode ``"mask"``."""
    double_sided: bool = True
    """Whether back faces are drawn: the counter-clockwise side is the front."""
    unlit: bool = False
    """Whether the base colour is shown without lighting."""
    shade_color: tuple[float, float, float] | None = None
    """(r, g, b) or None. Linear colour of the side away from the key light in toon shading; None in
    other shading."""
    shade_texture: Texture | None = None
    """Colour that multiplies ``shade_color``, sRGB."""
    shade_range: tuple[float, float] = (-0.1, 0.1)
    """Cosines of the angle of incidence at which the fraction of the base colour is 0 and 1."""
    rim: Rim | None = None
    """Rim light of toon shading."""
    outline: Outline | None = None
    """Outline of toon shading."""
    is_physical: bool = False
    """Whether the file describes the surface by metalness and roughness, or as unlit."""
    extras: Any = None
    """Application data of a glTF file, as parsed from JSON; None if there is none."""

    def __post_init__(self) -> None:
        for name in ("metallic", "roughness", "occlusion_strength"):
            _check_range(name, (getattr(self, name),), 1.0)
        _check_range("alpha_cutoff", (self.alpha_cutoff,))
        _check_range("emissive", self.emissive)
        _check_range("base_color", self.base_color or (), 1.0)
        _check_range("shade_color", self.shade_color or (), 1.0)
        if self.extras is not None:
            import json

            try:
                json.dumps(self.extras)
            except (TypeError, ValueError, RecursionError) as problem:
                raise RigError(f"extras: expected data of JSON, found {problem}") from None

    @property
    def textures(self) -> dict[str, Texture]:
        """Textures of the material, by the name of their field."""
        named = {name: getattr(self, name) for name in TEXTURES}
        return {name: texture for name, texture in named.items() if texture is not None}

    @property
    def is_plain(self) -> bool:
        """Whether the name and one opaque image fully describe the material."""
        base = self.base_texture
        return (
            not set(self.textures) - {"base_texture"}
            and (base is None or (base.is_placed_plainly and base.uv_set == 0))
            and self.base_color is None
            and self.alpha_mode == "opaque"
            and self.double_sided
            and not (self.is_physical or self.unlit or any(self.emissive))
        )

    @property
    def texture(self) -> str | None:
        """File name of the base colour's image, if there is one."""
        return None if self.base_texture is None else self.base_texture.name

    @property
    def image(self) -> Bytes | None:
        """Pixels of the base colour, if there are any."""
        return None if self.base_texture is None else self.base_texture.image


@checked
@dataclass(frozen=True, slots=True, eq=False)
class Texture:
    """An image, and its placement and sampling."""

    name: str
    """File name of the image, relative to the figure's folder."""
    image: Bytes | None = None
    """(H, W, 4) uint8 or None. Pixels with alpha, first row at v = 1; sRGB in colour textures,
    linear in others; None if it could not be read."""
    channel: int = 0
    """Channel of ``image`` from which single-channel textures are read."""
    uv_set: int = 0
    """0 for ``Mesh.uvs``, n for ``Mesh.other_uvs[n - 1]``."""
    transform: Floats | None = None
    """(2, 3). Maps texture coordinates to image coordinates, whose v is 0 at the bottom row."""
    wrap: tuple[Wrap, Wrap] = ("clamp", "clamp")
    """Along u and v."""
    is_smooth: bool = True
    """Whether pixels are interpolated."""
    minification: str = ""
    """Entry of ``MINIFICATIONS``; empty for mipmaps, interpolated if ``is_smooth``."""
    encoded: bytes | None = None
    """The PNG or JPEG file that ``image`` was decoded from, if it was part of another file."""

    def __post_init__(self) -> None:
        freeze_fields(self, np.uint8, image=(None, None, 4))
        if self.transform is None:
            object.__setattr__(self, "transform", np.eye(2, 3))
        freeze_fields(self, transform=(2, 3))
        _check_choice("channel", self.channel, range(4))
        _check_choice("minification", self.minification, ("", *MINIFICATIONS))
        if self.uv_set < 0:
            raise RigError(f"uv_set: expected at least 0, found {self.uv_set}")

    @property
    def matrix(self) -> Floats:
        """``transform``, never None: (2, 3)."""
        assert self.transform is not None  # set by __post_init__
        return self.transform

    @property
    def is_placed_plainly(self) -> bool:
        """Whether the image covers texture coordinates from 0 to 1."""
        return np.array_equal(self.matrix, np.eye(2, 3))


@checked
@dataclass(frozen=True, slots=True, eq=False)
class Rim:
    """Light at the edges of a surface, added to its colour.

    With the normal n and the direction v to the eye, the added light is (f m + c s) t, where m is
    the matcap, s = clamp(1 - n . v + lift)^power, and t the texture.
    """

    color: Color = (0.0, 0.0, 0.0)
    """(r, g, b). c, linear."""
    power: float = 5.0
    lift: float = 0.0
    """Exponent, at least 0, and summand."""
    mix: float = 1.0
    """0 to 1: degree to which the rim is multiplied by the light on the surface."""
    texture: Texture | None = None
    """t, sRGB."""
    matcap: Texture | None = None
    """m, an image of a lit sphere, sRGB."""
    matcap_factor: Color = (1.0, 1.0, 1.0)
    """(r, g, b). f, linear."""

    def __post_init__(self) -> None:
        _check_range("power", (self.power,))

    @property
    def has_effect(self) -> bool:
        """Whether anything is added to the colour of the surface."""
        return any(self.color) or (self.matcap is not None and any(self.matcap_factor))


@checked
@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """A line around a surface."""

    width: float
    """At least 0, in the unit of the mode."""
    mode: OutlineMode = "world"
    color: Color = (0.0, 0.0, 0.0)
    """(r, g, b). Linear."""
    mix: float = 1.0
    """0 to 1: how much the colour of the surface multiplies that of the line."""
    texture: Texture | None = None
    """Factor of the width, in the green channel."""

    def __post_init__(self) -> None:
        _check_range("width", (self.width,))


def _check_range(name: str, values: Iterable[float], most: float = math.inf) -> None:
    """Raise RigError unless numbers are at least 0, and at most ``most``."""
    for value in values:
        if not 0.0 <= value <= most:
            limits = "at least 0" if most == math.inf else f"0 to {most:g}"
            raise RigError(f"{name}: expected {limits}, found {value}")


def _check_choice(name: str, value: object, choices: range | tuple[str, ...]) -> None:
    """Raise RigError unless a value is one of the choices."""
    if value not in choices:
        raise RigError(f"{name}: expected one of {', '.join(map(str, choices))}, found {value}")
