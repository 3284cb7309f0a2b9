"""Studio environment light and matcaps on the GPU; ``assets/make_studio.py`` generates them."""

from __future__ import annotations

import moderngl
import numpy as np

from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.upload import checked
from viewer.rendering.options import Matcap
from viewer.resources import resource

STUDIO_SAMPLERS = {"u_studio": 13, "u_split_sum": 7, "u_matcap": 7}
"""Texture units that materials and effects do not use; no program uses both of the last two."""

_SRGB8 = 0x8C41


def studio_arrays() -> tuple[np.ndarray, np.ndarray]:
    """Return the light (layers, side, side, 3) and the table (64, 64, 2), float16."""
    with np.load(resource("assets", "studio", "studio.npz")) as stored:
        return stored["light"], stored["split_sum"]


class Studio:
    """Prefiltered studio environment, and the lookup table of the split-sum approximation."""

    def __init__(self, context: moderngl.Context) -> None:
        light, table = studio_arrays()
        self._owner = Owner()
        with self._owner.guard():
            layers, height, width = light.shape[:3]
            size = width, height, layers
            lights = context.texture_array(size, 3, light.tobytes(), alignment=2, dtype="f2")
            self._light = self._owner.keep(lights)
            lights.filter = (moderngl.LINEAR, moderngl.LINEAR)
            lights.repeat_x = lights.repeat_y = False
            split_sum = context.texture(table.shape[1::-1], 2, table.tobytes(), dtype="f2")
            self._table = self._owner.keep(checked(context, split_sum, "the studio's light"))
            split_sum.filter = (moderngl.LINEAR, moderngl.LINEAR)
            split_sum.repeat_x = split_sum.repeat_y = False

    def use(self) -> None:
        """Bind the textures."""
        self._light.use(STUDIO_SAMPLERS["u_studio"])
        self._table.use(STUDIO_SAMPLERS["u_split_sum"])

    def release(self) -> None:
        """Free the textures."""
        self._owner.release()


class Matcaps:
    """Images of lit spheres (matcaps), each uploaded on first use."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context, self._owner = context, Owner()
        self._textures: dict[str, moderngl.Texture] = {}

    def use(self, name: Matcap) -> None:
        """Bind a matcap."""
        if name not in self._textures:
            with np.load(resource("assets", "studio", "matcaps.npz")) as stored:
                pixels = stored[name]
            data = np.ascontiguousarray(pixels[::-1]).tobytes()
            size = pixels.shape[1], pixels.shape[0]
            texture = self._context.texture(size, 3, data, alignment=1, internal_format=_SRGB8)
            texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            texture.repeat_x = texture.repeat_y = False
            self._textures[name] = self._owner.keep(texture)
        self._textures[name].use(STUDIO_SAMPLERS["u_matcap"])

    def release(self) -> None:
        """Free the textures."""
        self._owner.release()
