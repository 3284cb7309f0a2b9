"""Shadows and ambient occlusion as used by the lit shaders."""

from __future__ import annotations

import math

import moderngl
import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.gpu.program import set_uniforms
from viewer.rendering.gpu.upload import as_uniform
from viewer.rig.arrays import Floats

__all__ = ["FILTER_RADIUS", "NO_EFFECTS", "SHADOW_UNIT", "Effects", "Occlusion", "Shadow"]

SHADOW_UNIT, _OCCLUSION_UNIT = 14, 15  # texture units; materials and skinning use the lower ones
FILTER_RADIUS = 3.5
"""Radius of the shadow filter on surfaces, texels."""


@dataclass(frozen=True, slots=True)
class Shadow:
    """The key light's shadow map.

    Attributes
    ----------
    texture : moderngl.Texture
        Depths as seen from the light.
    matrix : (4, 4)
        Maps scene space to coordinates in the map, 0 to 1 on all axes.
    texel : float
        Side of a texel, scene units.
    strength : float
        Fraction of the light that a shadow removes, 0 to 1.
    angle : float
        Rotation of the filter's pattern, radians.
    blur : float
        Radius of the filter on the ground, scene units; never less than the radius on surfaces.
    """

    texture: moderngl.Texture
    matrix: Floats
    texel: float
    strength: float
    angle: float = 0.0
    blur: float = 0.0

    def filter(self, is_ground: bool = False) -> tuple[float, float]:
        """Return the filter's radius, relative to the map's width, as a vector at its angle."""
        texels = max(FILTER_RADIUS, self.blur / self.texel if is_ground else 0.0)
        radius = texels / self.texture.width
        return radius * math.cos(self.angle), radius * math.sin(self.angle)


@dataclass(frozen=True, slots=True)
class Occlusion:
    """The ambient light that reaches each pixel.

    Attributes
    ----------
    texture : moderngl.Texture
        Fraction of the light, and depth in camera space, at half of the image's resolution.
    strength : float
        Strength of the occlusion, 0 to 1.
    """

    texture: moderngl.Texture
    strength: float


@dataclass(frozen=True, slots=True)
class Effects:
    """Effects on the light at surfaces: shadows and occlusion."""

    shadow: Shadow | None = None
    occlusion: Occlusion | None = None

    @property
    def defines(self) -> tuple[str, ...]:
        """Macros that enable these effects in shaders."""
        pairs = (("SHADOWS", self.shadow), ("OCCLUSION", self.occlusion))
        return tuple(name for name, effect in pairs if effect is not None)

    def bind(self, program: moderngl.Program, view: Floats) -> None:
        """Set uniforms and textures of a program; ``view`` maps scene to camera space, (4, 4)."""
        shadow, occlusion = self.shadow, self.occlusion
        if shadow is not None:
            values = {
                "u_shadow_map": SHADOW_UNIT,
                "u_shadow_matrix": as_uniform(shadow.matrix @ np.linalg.inv(view)),
                "u_shadow_filter": shadow.filter(),
                # The offset equals the reach of the filter; otherwise surfaces would shadow
                # themselves.
                "u_shadow_offset": (FILTER_RADIUS + 1.0) * shadow.texel,
                "u_shadow_strength": shadow.strength,
            }
            set_uniforms(program, values)
            shadow.texture.use(SHADOW_UNIT)
        if occlusion is not None:
            set_uniforms(
                program,
                {"u_occlusion": _OCCLUSION_UNIT, "u_occlusion_strength": occlusion.strength},
            )
            occlusion.texture.use(_OCCLUSION_UNIT)


NO_EFFECTS = Effects()
"""No effects: lighting depends only on the lights."""
