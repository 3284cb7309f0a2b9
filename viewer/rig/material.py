"""Materials: the surface appearance of triangles, in the metallic-roughness model of glTF 2.0."""

from __future__ import annotations

from typing import Any

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rig.arrays import Bytes
from viewer.rig.materials.texture import MINIFICATIONS, WRAPS, Texture, check_choice
from viewer.rig.materials.toon import Outline, Rim

__all__ = ["ALPHA_MODES", "MINIFICATIONS", "TEXTURES", "WRAPS", "Material", "Texture"]

ALPHA_MODES = ("opaque", "mask", "blend")
"""Alpha is ignored; surfaces are cut out below the cutoff; or they are blended with the
background."""


@dataclass(frozen=True, slots=True, eq=False)
class Material:
    """The surface appearance of some triangles.

    Factors multiply their textures, as in glTF 2.0, section 3.9.

    Attributes
    ----------
    name : str
        Name in the file; triangles refer to materials by index.
    base_texture : Texture or None
        Colour and opacity, sRGB.
    base_color : (r, g, b, a) or None
        Linear, 0 to 1; None for a material without a colour, which is white under a texture and
        otherwise has the figure's colour.
    metallic, roughness : float
        0 to 1; roughness is perceptual, the square root of the GGX width.
    metallic_texture, roughness_texture : Texture or None
        One channel each, often of the same image.
    normal_texture : Texture or None
        Tangent space normals: red along u, green along v, blue outwards, 0 to 255 for -1 to 1.
    normal_scale : float
        Multiplier for the red and green components of the normals.
    occlusion_texture : Texture or None
        Fraction of the ambient light that arrives; one channel.
    occlusion_strength : float
        0 to 1.
    emissive : (r, g, b)
        Emitted light, linear; may exceed 1.
    emissive_texture : Texture or None
        Colour of the emitted light, sRGB.
    alpha_mode : str
        Entry of ``ALPHA_MODES``.
    alpha_cutoff : float
        Minimum opacity that is drawn in the mode ``"mask"``.
    double_sided : bool
        Whether back faces are drawn: the counter-clockwise side is the front.
    unlit : bool
        Whether the base colour is shown without lighting.
    shade_color : (r, g, b) or None
        Linear colour of the side away from the key light in toon shading; None in other shading.
    shade_texture : Texture or None
        Colour that multiplies ``shade_color``, sRGB.
    shade_range : (float, float)
        Cosines of the angle of incidence at which the fraction of the base colour is 0 and 1.
    rim : Rim or None
        Rim light of toon shading.
    outline : Outline or None
        Outline of toon shading.
    is_physical : bool
        Whether the file describes the surface by metalness and roughness, or as unlit.
    extras : Any
        Application data of a glTF file, as parsed from JSON; None if there is none.
    """

    name: str = ""
    base_texture: Texture | None = None
    base_color: tuple[float, float, float, float] | None = None
    metallic: float = 0.0
    roughness: float = 0.6
    metallic_texture: Texture | None = None
    roughness_texture: Texture | None = None
    normal_texture: Texture | None = None
    normal_scale: float = 1.0
    occlusion_texture: Texture | None = None
    occlusion_strength: float = 1.0
    emissive: tuple[float, float, float] = (0.0, 0.0, 0.0)
    emissive_texture: Texture | None = None
    alpha_mode: str = "opaque"
    alpha_cutoff: float = 0.5
    double_sided: bool = True
    unlit: bool = False
    shade_color: tuple[float, float, float] | None = None
    shade_texture: Texture | None = None
    shade_range: tuple[float, float] = (-0.1, 0.1)
    rim: Rim | None = None
    outline: Outline | None = None
    is_physical: bool = False
    extras: Any = None

    def __post_init__(self) -> None:
        check_choice("alpha_mode", self.alpha_mode, ALPHA_MODES)
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


TEXTURES = (
    *("base_texture", "metallic_texture", "roughness_texture"),
    *("normal_texture", "occlusion_texture", "emissive_texture", "shade_texture"),
)
"""Fields of a material that contain textures."""


def _check_numbers(
    name: str, values: tuple[float, ...], most: float = float("inf"), count: int = 1
) -> None:
    """Raise RigError unless ``count`` numbers are finite, at least 0, and at most ``most``."""
    if len(values) != count:
        raise RigError(f"{name}: expected {count} numbers, found {len(values)}")
    for value in values:
        if not (0.0 <= value <= most and np.isfinite(value)):
            limits = "at least 0" if most == float("inf") else f"0 to {most:g}"
            raise RigError(f"{name}: expected {limits}, found {value}")
