"""The key light's shadow map, fitted to the shadow casters."""

from __future__ import annotations

import math
from collections.abc import Callable

import moderngl
import numpy as np

from viewer.rendering.camera import Camera
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.view import FILTER_RADIUS, Shadow, View
from viewer.rig.arrays import Floats
from viewer.rig.geometry.transform import translation_matrix

__all__ = ["ShadowPass", "light_view", "map_side", "parallel_view"]

_SIDES = 256, 2048  # minimum and maximum number of texels on each side of a shadow map
_MARGIN = FILTER_RADIUS + 2.0  # width of the margin without shadow around all casters, texels
_STEP = 2.0**0.25  # step factor of the map's extent: its resolution is constant while figures move
_TO_TEXTURE = np.array([[0.5, 0, 0, 0.5], [0, 0.5, 0, 0.5], [0, 0, 0.5, 0.5], [0, 0, 0, 1.0]])


class ShadowPass:
    """Pass that draws depths as seen from a light.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    side : int
        Texels on each side of the map.
    """

    def __init__(self, context: moderngl.Context, side: int) -> None:
        self.context, self.side = context, side
        self._owner = Owner()
        with self._owner.guard():
            self._texture = self._owner.keep(context.depth_texture((side, side)))
            self._texture.compare_func = "<="
            self._texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            self._texture.repeat_x = self._texture.repeat_y = False
            self._framebuffer = self._owner.keep(context.framebuffer((), self._texture))

    def draw(
        self,
        draw: Callable[[View, str], object],
        spheres: Floats,
        direction: Floats,
        strength: float,
    ) -> Shadow:
        """Draw a shadow map.

        Parameters
        ----------
        draw : callable
            Draws the shadow casters, with a view and a fragment shader.
        spheres : (N, 4)
            Bounds of the casters: centres and radii, scene space; at least one.
        direction : (3,)
            Unit vector towards the light, scene space.
        strength : float
            0 to 1: fraction of the light that a shadow removes.
        """
        view, extent = light_view(spheres, direction, self.side)
        self._framebuffer.use()
        context = self.context
        context.viewport = (0, 0, self.side, self.side)
        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func = "<"
        self._framebuffer.clear(depth=1.0)
        draw(view, "depth")
        matrix = _TO_TEXTURE @ view.projection @ view.matrix
        return Shadow(self._texture, matrix, 2.0 * extent / self.side, strength)

    def release(self) -> None:
        """Free the map."""
        self._owner.release()


def map_side(size: tuple[int, int]) -> int:
    """Return the side length of an image's shadow map in texels, at least four texels per pixel.

    >>> map_side((1280, 720)), map_side((100, 75))
    (2048, 512)
    """
    wanted = 1 << math.ceil(math.log2(4 * max(size)))
    return min(max(wanted, _SIDES[0]), _SIDES[1])


def light_view(spheres: Floats, direction: Floats, side: int) -> tuple[View, float]:
    """Return the view of a directional light that contains the spheres, and its half extent.

    Extents grow in steps, and the centre is snapped to the texel grid, so that shadow edges do
    not crawl while figures move.

    Parameters
    ----------
    spheres : (N, 4)
        Centres and radii, scene space.
    direction : (3,)
        Unit vector towards the light.
    side : int
        Texels on each side of the map.
    """
    aside = np.eye(3)[np.argmin(np.abs(direction))]
    right = np.cross(aside, direction)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(direction, right), direction])
    centers, radii = spheres[:, :3] @ axes.T, spheres[:, 3:]
    low, high = (centers - radii).min(axis=0), (centers + radii).max(axis=0)
    half = 0.5 * max(high[0] - low[0], high[1] - low[1])
    # This leaves half a texel for snapping, and room for the filter.
    half /= 1.0 - 2.0 * (_MARGIN + 1.0) / side
    extent = _STEP ** np.ceil(np.log(max(half, 1e-30)) / np.log(_STEP))
    texel = 2.0 * extent / side
    middle = 0.5 * (low + high)
    middle[:2] = np.round(middle[:2] / texel) * texel
    deep = 0.5 * (high[2] - low[2]) * 1.01 + 1e-3 * extent
    return parallel_view(axes, middle, np.array([extent, extent, deep])), float(extent)


def parallel_view(axes: Floats, middle: Floats, halves: Floats) -> View:
    """Return a parallel view of a box.

    Parameters
    ----------
    axes : (3, 3)
        Right, up and backward as rows, scene space.
    middle : (3,)
        Centre of the box, along these axes.
    halves : (3,)
        Half the side lengths of the box.
    """
    matrix = np.eye(4)
    matrix[:3, :3] = axes
    # OpenGL's depth grows away from the eye, against the backward axis.
    projection = np.diag([1.0 / halves[0], 1.0 / halves[1], -1.0 / halves[2], 1.0])
    return View(translation_matrix(-middle) @ matrix, projection, Camera(orthographic=True))
