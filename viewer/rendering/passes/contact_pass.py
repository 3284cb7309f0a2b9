"""Soft contact shadows: a blurred field of the heights of figures above the ground.

They need no light source: they represent the ambient light that figures block from the ground below
them.
"""

from __future__ import annotations

from collections.abc import Callable

import moderngl
import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.passes.shadow_pass import parallel_view
from viewer.rendering.view import View
from viewer.rig.arrays import Floats

__all__ = ["Contact", "ContactPass"]

_SIZE = 256  # texels on each side of the field
_NEAR, _FAR = 0.04, 0.35  # upper ends of contact and ambient shadow, figure sizes
_BELOW = 0.05  # maximum depth to which feet sink into the ground, figure sizes
_NARROW, _WIDE = 0.012, 0.07  # standard deviations of the blurs, figure sizes


@dataclass(frozen=True, slots=True)
class Contact:
    """A field of contact shadows.

    Attributes
    ----------
    texture : moderngl.Texture
        Red is darkness caused by contact, green darkness caused by occluders farther above, 0 to 1.
    low, high : (2,)
        Opposite corners of the field, along the ground's axes.
    """

    texture: moderngl.Texture
    low: Floats
    high: Floats


class ContactPass:
    """Pass that draws heights as seen from below the ground, and blurs them.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    programs : Programs
        Provides the programs.
    """

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.context, self.programs = context, programs
        self._owner = Owner()
        keep, size = self._owner.keep, (_SIZE, _SIZE)
        with self._owner.guard():
            self._depth = keep(context.depth_texture(size))
            self._depth.compare_func = ""
            self._depth.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._framebuffer = keep(context.framebuffer((), self._depth))
            self._fields = [keep(context.texture(size, 2, dtype="f2")) for _ in range(2)]
            for field in self._fields:
                field.repeat_x = field.repeat_y = False
            self._targets = [keep(context.framebuffer([field])) for field in self._fields]
            program = programs.drawing("fullscreen", fragment="contact_blur")
            self._array = keep(context.vertex_array(program, []))

    def draw(
        self,
        draw: Callable[[View, str], object],
        spheres: Floats,
        size: float,
        axes: Floats,
        height: float,
    ) -> Contact | None:
        """Draw and return the contact shadows of figures; None if all are far above the ground.

        Parameters
        ----------
        draw : callable
            Draws the figures, with a view and a fragment shader.
        spheres : (N, 4)
            Bounds of the figures: centres and radii, scene space.
        size : float
            Size of a figure in scene units, which determines the softness.
        axes : (3, 3)
            The ground's two axes and the up axis as rows.
        height : float
            Height of the ground, scene units.
        """
        centers, radii = spheres[:, :3] @ axes.T, spheres[:, 3:]
        near = (centers - radii)[:, 2] < height + _FAR * size
        if not near.any():
            return None
        margin = 3.0 * _WIDE * size
        low = (centers - radii)[near, :2].min(axis=0) - margin
        high = (centers + radii)[near, :2].max(axis=0) + margin
        # Seen from below, the first axis points right and the second one down.
        below = np.stack([axes[0], -axes[1], -axes[2]])
        bottom, top = height - _BELOW * size, height + _FAR * size
        middle = np.array([0.5 * (low + high)[0], -0.5 * (low + high)[1], -0.5 * (bottom + top)])
        halves = np.array([*(0.5 * (high - low)), 0.5 * (top - bottom)])
        self._draw_heights(draw, parallel_view(below, middle, halves))
        self._blur(size / (high - low))
        return Contact(self._fields[1], low, high)

    def _draw_heights(self, draw: Callable[[View, str], object], view: View) -> None:
        context = self.context
        self._framebuffer.use()
        context.viewport = (0, 0, _SIZE, _SIZE)
        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func = "<"
        self._framebuffer.clear(depth=1.0)
        draw(view, "depth")

    def _blur(self, scale: Floats) -> None:
        """Convert depths to darkness and blur it; ``scale`` is a figure's size in the field."""
        self.context.enable_only(moderngl.NOTHING)
        values = {
            "u_field": 0,
            "u_bottom": -_BELOW,
            "u_top": _FAR,
            "u_near": _NEAR,
        }
        set_uniforms(self._array.program, values)
        sources = self._depth, self._fields[0]
        for axis, (source, target) in enumerate(zip(sources, self._targets, strict=True)):
            target.use()
            source.use(0)
            step = np.eye(2)[axis] * scale[axis]
            deviations = {
                "u_is_depth": axis == 0,
                "u_narrow": tuple(step * max(_NARROW, 0.7 / (_SIZE * scale[axis]))),
                "u_wide": tuple(step * _WIDE),
            }
            set_uniforms(self._array.program, deviations)
            self._array.render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        """Free textures and framebuffers."""
        self._owner.release()
