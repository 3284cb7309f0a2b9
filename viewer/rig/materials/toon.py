"""Rim light and outline of toon materials, as VRM's MToon defines them."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rig.materials.texture import Texture

__all__ = ["OUTLINE_MODES", "Outline", "Rim"]

OUTLINE_MODES = ("world", "screen")
"""Units of outline widths: lengths, or fractions of the image height."""

Color = tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Rim:
    """Light at the edges of a surface, added to its colour.

    With the normal n and the direction v to the eye, the added light is (f m + c s) t, where m is
    the matcap, s = clamp(1 - n . v + lift)^power, and t the texture.

    Attributes
    ----------
    color : (r, g, b)
        c, linear.
    power, lift : float
        Exponent, at least 0, and summand.
    mix : float
        0 to 1: degree to which the rim is multiplied by the light on the surface.
    texture : Texture or None
        t, sRGB.
    matcap : Texture or None
        m, an image of a lit sphere, sRGB.
    matcap_factor : (r, g, b)
        f, linear.
    """

    color: Color = (0.0, 0.0, 0.0)
    power: float = 5.0
    lift: float = 0.0
    mix: float = 1.0
    texture: Texture | None = None
    matcap: Texture | None = None
    matcap_factor: Color = (1.0, 1.0, 1.0)

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
    """A line around a surface.

    Attributes
    ----------
    width : float
        At least 0, in the unit of the mode.
    mode : str
        Entry of ``OUTLINE_MODES``.
    color : (r, g, b)
        Linear.
    mix : float
        0 to 1: how much the colour of the surface multiplies that of the line.
    texture : Texture or None
        Factor of the width, in the green channel.
    """

    width: float
    mode: str = "world"
    color: Color = (0.0, 0.0, 0.0)
    mix: float = 1.0
    texture: Texture | None = None

    def __post_init__(self) -> None:
        if self.mode not in OUTLINE_MODES:
            raise RigError(f"outline: expected {' or '.join(OUTLINE_MODES)}, found {self.mode}")
        numbers = (self.width, *self.color, self.mix)
        if not np.isfinite(numbers).all() or self.width < 0.0:
            raise RigError(f"outline: expected finite numbers and a width of at least 0: {numbers}")
