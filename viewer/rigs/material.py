"""Materials: the surface appearance of triangles, in the metallic-roughness model of glTF 2.0.

In addition, there is toon shading with rim light and outline, as in ``VRMC_materials_mtoon`` 1.0.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import NoneType
from typing import Any, Literal, TypeAlias

import numpy as np

from viewer.arguments import check_type
from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Bytes, Floats, freeze_fields

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
_WRAPS: tuple[Wrap, ...] = ("clamp", "repeat", "mirror")
"""Texture coordinates outside 0 to 1: clamped, repeated, or mirrored on every other repeat."""
MINIFICATIONS = (
    *("nearest", "linear", "nearest_mipmap_nearest"),
    *("linear_mipmap_nearest", "nearest_mipmap_linear", "linear_mipmap_linear"),
)
"""Filters of minified images, with their names in OpenGL and glTF."""

OutlineMode: TypeAlias = Literal["world", "screen"]
_OUTLINE_MODES: tuple[OutlineMode, ...] = ("world", "screen")
"""Units of outline widths: lengths, or fractions of the image height."""
Color = tuple[float, float, float]


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
        check_type("name", self.name, str)
        for name in TEXTURES:
            check_type(name, getattr(self, name), Texture, NoneType)
        check_type("rim", self.rim, Rim, NoneType)
        check_type("outline", self.outline, Outline, NoneType)
        check_type("normal_scale", self.normal_scale, float)
        check_type("shade_range", self.shade_range, Sequence)
        _check_choice("alpha_mode", self.alpha_mode, ALPHA_MODES)
        for name in ("metallic", "roughness", "occlusion_strength"):
            _check_numbers(name, (getattr(self, name),), 1.0)
        _check_numbers("alpha_cutoff", (self.alpha_cutoff,))
        _check_numbers("emissive", self.emissive, count=3)
        if self.base_color is not None:
            _check_numbers("base_color", self.base_color, 1.0, count=4)
        if self.shade_color is not None:
            _check_numbers("shade_color", self.shade_color, 1.0, count=3)
        if not np.isfinite(self.shade_range).all():
            raise RigError(f"shade_range: expected finite numbers, found {self.shade_range}")
        if not np.isfinite(self.normal_scale):
            raise RigError(f"normal_scale: expected a finite number, found {self.normal_scale}")

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
        check_type("name", self.name, str)
        check_type("uv_set", self.uv_set, int)
        check_type("wrap", self.wrap, Sequence)
        if self.image is not None:
            freeze_fields(self, np.uint8, image=(None, None, 4))
        if self.transform is None:
            object.__setattr__(self, "transform", np.eye(2, 3))
        freeze_fields(self, transform=(2, 3))
        _check_choice("channel", self.channel, range(4))
        _check_choice("minification", self.minification, ("", *MINIFICATIONS))
        if self.uv_set < 0:
            raise RigError(f"uv_set: expected at least 0, found {self.uv_set}")
        for side in self.wrap:
            _check_choice("wrap", side, _WRAPS)

    @property
    def matrix(self) -> Floats:
        """``transform``, never None: (2, 3)."""
        assert self.transform is not None  # set by __post_init__
        return self.transform

    @property
    def is_placed_plainly(self) -> bool:
        """Whether the image covers texture coordinates from 0 to 1."""
        return np.array_equal(self.matrix, np.eye(2, 3))


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
        numbers = (*self.color, *self.matcap_factor, self.power, self.lift, self.mix)
        if not np.isfinite(numbers).all() or self.power < 0.0:
            raise RigError(f"rim: expected finite numbers and an exponent of at least 0: {numbers}")

    @property
    def has_effect(self) -> bool:
        """Whether anything is added to the colour of the surface."""
        return any(self.color) or (self.matcap is not None and any(self.matcap_factor))


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
        if self.mode not in _OUTLINE_MODES:
            raise RigError(f"outline: expected {' or '.join(_OUTLINE_MODES)}, found {self.mode}")
        numbers = (self.width, *self.color, self.mix)
        if not np.isfinite(numbers).all() or self.width < 0.0:
            raise RigError(f"outline: expected finite numbers and a width of at least 0: {numbers}")


def _check_numbers(
    name: str, values: tuple[float, ...], most: float = float("inf"), count: int = 1
) -> None:
    """Raise RigError unless ``count`` numbers are finite, at least 0, and at most ``most``."""
    check_type(name, values, Sequence)
    if len(values) != count:
        raise RigError(f"{name}: expected {count} numbers, found {len(values)}")
    for value in values:
        check_type(name, value, float)
        if not (0.0 <= value <= most and np.isfinite(value)):
            limits = "at least 0" if most == float("inf") else f"0 to {most:g}"
            raise RigError(f"{name}: expected {limits}, found {value}")


def _check_choice(name: str, value: object, choices: range | tuple[str, ...]) -> None:
    """Raise RigError unless a value is one of the choices."""
    if value not in choices:
        raise RigError(f"{name}: expected one of {', '.join(map(str, choices))}, found {value}")
