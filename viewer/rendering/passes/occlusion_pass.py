"""Ambient occlusion in screen space, from the depths and normals of posed surfaces."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import moderngl
import numpy as np

from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.upload import checked
from viewer.rendering.view import Occlusion, View

_RADIUS = 0.09  # radius within which surfaces occlude, relative to a figure's size


class OcclusionPass:
    """Pass that computes how much ambient light reaches each pixel, at half resolution."""

    def __init__(
        self, context: moderngl.Context, programs: Programs, size: tuple[int, int]
    ) -> None:
        self.context, self.size = context, size
        self._half = (size[0] + 1) // 2, (size[1] + 1) // 2
        self._owner = Owner()
        keep = self._owner.keep
        with self._owner.guard():
            what = f"ambient occlusion of {size[0]} x {size[1]} pixels"
            self._geometry = keep(
                checked(context, context.texture(self._half, 4, dtype="f4"), what)
            )
            depth = keep(context.depth_renderbuffer(self._half))
            self._surfaces = keep(context.framebuffer([self._geometry], depth))
            self._fields = [keep(context.texture(self._half, 2, dtype="f4")) for _ in range(2)]
            for texture in (self._geometry, *self._fields):
                texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._targets = [keep(context.framebuffer([field])) for field in self._fields]
            self._arrays = [
                keep(context.vertex_array(programs.drawing("fullscreen", fragment=name), []))
                for name in ("occlusion", "occlusion_blur")
            ]

    def draw(
        self,
        draw: Callable[[View, str], object],
        view: View,
        size: float,
        phase: float,
        strength: float,
    ) -> Occlusion:
        """Compute an image's occlusion, of a strength from 0 to 1, for figures of a scene size."""
        # The size determines the radius; the phase of the direction pattern, 0 to 1, is different
        # for each pass of an image.
        halved = self._halved(view)
        context = self.context
        self._surfaces.use()
        context.viewport = (0, 0, *self._half)
        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func = "<"
        self._surfaces.clear(depth=1.0)
        draw(halved, "geometry")
        context.enable_only(moderngl.NOTHING)
        projection, is_parallel = halved.projection, view.camera.is_parallel
        focal = np.array([projection[0, 0], projection[1, 1]])
        middle = -projection[:2, 3] if is_parallel else projection[:2, 2]
        scale, shift = 2.0 / (np.array(self._half) * focal), (middle - 1.0) / focal
        search = {
            "u_geometry": 0,
            "u_unproject": (*scale.tolist(), *shift.tolist()),
            "u_orthographic": is_parallel,
            "u_radius": _RADIUS * size,
            "u_pixels": 0.5 * self._half[1] * float(focal[1]),
            "u_phase": phase,
        }
        self._run(0, self._geometry, search)
        blur = {"u_occlusion": 0, "u_radius": 0.25 * _RADIUS * size}
        self._run(1, self._fields[0], blur)
        return Occlusion(self._fields[1], strength)

    def _halved(self, view: View) -> View:
        """Return the view of the half-resolution image, whose full size is rounded up to even."""
        scale = np.array(self.size) / (2.0 * np.array(self._half))
        matrix = np.diag([*scale, 1.0, 1.0])
        matrix[:2, 3] = scale - 1.0
        return replace(view, projection=matrix @ view.projection)

    def _run(self, step: int, source: moderngl.Texture, values: Mapping[str, object]) -> None:
        self._targets[step].use()
        source.use(0)
        set_uniforms(self._arrays[step].program, values)
        self._arrays[step].render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        """Free textures and framebuffers."""
        self._owner.release()
