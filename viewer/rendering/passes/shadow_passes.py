"""Shadows: the key light's shadow map, soft contact shadows, both on the ground, and occlusion.

Contact shadows need no light source: they represent the ambient light that figures block from the
ground below them, as a blurred field of the heights of figures above the ground. Ambient occlusion
is that of surfaces by each other, in screen space, from the depths and normals of the image.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import moderngl
import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.camera import Camera
from viewer.rendering.gpu.draw_state import behind, without_depth_writes
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.upload import buffer, checked
from viewer.rendering.gpu.vertex_arrays import VertexArrays
from viewer.rendering.view import (
    FILTER_RADIUS,
    SHADOW_UNIT,
    Occlusion,
    Shadow,
    View,
    light_axes,
    set_model,
)
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.geometry.vectors import cross, unit

# The key light's shadow map.
_SIDES = 256, 2048  # minimum and maximum number of texels on each side of a shadow map
_MARGIN = FILTER_RADIUS + 2.0  # width of the margin without shadow around all casters, texels
_STEP = 2.0**0.25  # step factor of the map's extent: its resolution is constant while figures move
_TO_TEXTURE = np.array([[0.5, 0, 0, 0.5], [0, 0.5, 0, 0.5], [0, 0, 0.5, 0.5], [0, 0, 0, 1.0]])

# Contact shadows.
_FIELD_SIZE = 256  # texels on each side of the field
_NEAR, _FAR = 0.04, 0.35  # upper ends of contact and ambient shadow, figure sizes
_BELOW = 0.05  # maximum depth to which feet sink into the ground, figure sizes
_NARROW, _WIDE = 0.012, 0.07  # standard deviations of the blurs, figure sizes

# On the ground.
SHADOW_OPACITY = 0.42  # opacity of the key light's shadow
_CONTACT_OPACITIES = 0.55, 0.38
# Sine of the light's elevation at which its shadow appears and has full strength.
GRAZING = 0.06, 0.22
_FIELD_UNIT = 0

# Ambient occlusion.
_RADIUS = 0.09  # radius within which surfaces occlude, relative to a figure's size


class ShadowPass:
    """Pass that draws depths as seen from a light."""

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
    ) -> Shadow:
        """Draw the shadow map of spheres (N, 4), centre and radius, around the casters.

        ``direction``: unit, towards the light.
        """
        view, extent, low, high = light_view(spheres, direction, self.side)
        _draw_depths(self._framebuffer, draw, view)
        matrix = _TO_TEXTURE @ view.projection @ view.matrix
        return Shadow(self._texture, matrix, 2.0 * extent / self.side, low, high)

    def release(self) -> None:
        """Free the map."""
        self._owner.release()


class ContactPass:
    """Pass that draws heights as seen from below the ground, and blurs them."""

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.context, self.programs = context, programs
        self._owner = Owner()
        keep, size = self._owner.keep, (_FIELD_SIZE, _FIELD_SIZE)
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
    ) -> ContactShadows | None:
        """Draw the contact shadows of figures in (N, 4); None if all are far above the ground."""
        # The size of a figure determines the softness. The axes, (3, 3), are the ground's two axes
        # and the up axis as rows.
        centers, radii = axes @ spheres[:, :3].T, spheres[:, 3]
        near = centers[2] - radii < height + _FAR * size
        if not near.any():
            return None
        margin = 3.0 * _WIDE * size
        low = (centers - radii)[:2, near].min(axis=1) - margin
        high = (centers + radii)[:2, near].max(axis=1) + margin
        # Seen from below, the first axis points right and the second one down.
        below = np.stack([axes[0], -axes[1], -axes[2]])
        bottom, top = height - _BELOW * size, height + _FAR * size
        middle = np.array([0.5 * (low + high)[0], -0.5 * (low + high)[1], -0.5 * (bottom + top)])
        halves = np.array([*(0.5 * (high - low)), 0.5 * (top - bottom)])
        _draw_depths(self._framebuffer, draw, _parallel_view(below, middle, halves))
        self._blur(size / (high - low))
        return ContactShadows(self._fields[1], low, high)

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
                "u_narrow": tuple(step * max(_NARROW, 0.7 / (_FIELD_SIZE * scale[axis]))),
                "u_wide": tuple(step * _WIDE),
            }
            set_uniforms(self._array.program, deviations)
            self._array.render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        """Free textures and framebuffers."""
        self._owner.release()


@dataclass(frozen=True, slots=True)
class ContactShadows:
    """A field of contact shadows."""

    texture: moderngl.Texture
    """Red is darkness caused by contact, green darkness caused by occluders farther above, 0 to
    1."""
    low: Floats
    high: Floats
    """(2,). Opposite corners of the field, along the ground's axes."""


class GroundShadowPass:
    """Pass that draws black patches on the ground, whose opacity represents the shadow."""

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.context, self.programs = context, programs
        self._corners = buffer(context, [[0, 0], [1, 0], [0, 1], [1, 1]], "f4")
        self._arrays = VertexArrays(context)

    def draw_shadow(self, shadow: Shadow, view: View, up: Floats, height: float) -> None:
        """Draw the key light's shadow on the ground, which is at a height along ``up``, (3,)."""
        back = np.linalg.inv(shadow.matrix)
        away = back[:3, 2]
        slope = -(up @ away) / np.linalg.norm(away)
        fade = float(np.clip((slope - GRAZING[0]) / (GRAZING[1] - GRAZING[0]), 0.0, 1.0))
        if fade == 0.0:
            return
        # Only this part of the map and what the filter adds to it can be dark.
        filtered = shadow.filter(is_ground=True)
        margin = math.hypot(*filtered) + 1.0 / shadow.texture.width
        low, high = np.maximum(shadow.low - margin, 0.0), np.minimum(shadow.high + margin, 1.0)
        # Rays through three of its corners meet the ground at these depths.
        ends = (low[0], low[1]), (high[0], low[1]), (low[0], high[1])
        corners = np.array([(x, y, 0.0, 1.0) for x, y in ends]) @ back.T
        depths = (height - corners[:, :3] @ up) / (up @ away)
        places = corners[:, :3] + depths[:, None] * away
        program = self.programs.drawing("patch", fragment="ground_shadow")
        growth = depths[1:] - depths[0]
        values = {
            "u_shadow_map": SHADOW_UNIT,
            "u_shadow_filter": filtered,
            "u_part": (*low.tolist(), *(high - low).tolist()),
            "u_depth": (float(depths[0]), *growth.tolist()),
            "u_opacity": SHADOW_OPACITY * fade * shadow.strength,
        }
        set_uniforms(program, values)
        shadow.texture.use(SHADOW_UNIT)
        self._draw(program, view, places[0], places[1] - places[0], places[2] - places[0])

    def draw_contact(
        self, contact: ContactShadows, view: View, axes: Floats, height: float, strength: float
    ) -> None:
        """Draw contact shadows; the rows of ``axes`` are the ground's two axes and the up axis."""
        program = self.programs.drawing("patch", fragment="ground_contact")
        opacities = tuple(strength * opacity for opacity in _CONTACT_OPACITIES)
        set_uniforms(program, {"u_field": _FIELD_UNIT, "u_opacity": opacities})
        contact.texture.use(_FIELD_UNIT)
        # Seen from below, the second axis points down.
        origin = axes.T @ np.array([contact.low[0], contact.high[1], height])
        sides = contact.high - contact.low
        self._draw(program, view, origin, sides[0] * axes[0], -sides[1] * axes[1])

    def _draw(
        self, program: moderngl.Program, view: View, origin: Floats, first: Floats, second: Floats
    ) -> None:
        """Draw the parallelogram given by a corner and two sides, scene space."""
        placement = np.eye(4)
        placement[:3, 0], placement[:3, 1] = first, second
        # Only the direction matters: the product of two sides would exceed the range of float32.
        placement[:3, 2] = cross(unit(first), unit(second))
        placement[:3, 3] = origin
        set_model(program, view, placement, np.zeros(3))
        array = self._arrays.get(program, lambda: [(self._corners, "2f4", "in_corner")])
        # Patches are translucent and must not hide anything, nor show through a flat mesh on the
        # ground, which has the same depth.
        with without_depth_writes(self.context), behind(self.context):
            array.render(moderngl.TRIANGLE_STRIP)

    def release(self) -> None:
        """Free vertex arrays and corners."""
        self._arrays.release()
        self._corners.release()


def _draw_depths(
    framebuffer: moderngl.Framebuffer, draw: Callable[[View, str], object], view: View
) -> None:
    """Draw the depths of the shadow casters into a depth texture."""
    context = framebuffer.ctx
    framebuffer.use()
    context.viewport = (0, 0, *framebuffer.size)
    context.enable_only(moderngl.DEPTH_TEST)
    context.depth_func = "<"
    framebuffer.clear(depth=1.0)
    draw(view, "depth")


def map_side(size: tuple[int, int]) -> int:
    """Return the side length of an image's shadow map in texels, at least four texels per pixel.

    >>> map_side((1280, 720)), map_side((100, 75))
    (2048, 512)
    """
    wanted = 1 << math.ceil(math.log2(4 * max(size)))
    return min(max(wanted, _SIDES[0]), _SIDES[1])


def light_view(spheres: Floats, direction: Floats, side: int) -> tuple[View, float, Floats, Floats]:
    """Return a directional light's view of spheres (N, 4), half its extent, and their bounds in it.

    ``direction``: unit vector towards the light. The bounds are two opposite corners, (2,) each,
    in the map, 0 to 1.
    """
    # Extents grow in steps, and the centre is snapped to the texel grid, so that shadow edges do
    # not crawl while figures move.
    axes = np.stack([*light_axes(direction), direction])
    # Rows are contiguous, so that the extremes of many spheres are found quickly.
    centers, radii = axes @ spheres[:, :3].T, spheres[:, 3]
    low, high = (centers - radii).min(axis=1), (centers + radii).max(axis=1)
    half = 0.5 * max(high[0] - low[0], high[1] - low[1])
    # This leaves half a texel for snapping, and room for the filter.
    half /= 1.0 - 2.0 * (_MARGIN + 1.0) / side
    extent = _STEP ** np.ceil(np.log(max(half, 1e-30)) / np.log(_STEP))
    texel = 2.0 * extent / side
    middle = 0.5 * (low + high)
    middle[:2] = np.round(middle[:2] / texel) * texel
    deep = 0.5 * (high[2] - low[2]) * 1.01 + 1e-3 * extent
    view = _parallel_view(axes, middle, np.array([extent, extent, deep]))
    corners = (0.5 + 0.5 * (end - middle)[:2] / extent for end in (low, high))
    return view, float(extent), *corners


def _parallel_view(axes: Floats, middle: Floats, halves: Floats) -> View:
    """Return the parallel view of a box about a middle, along axes (3, 3): right, up, backward."""
    matrix = np.eye(4)
    matrix[:3, :3] = axes
    # OpenGL's depth grows away from the eye, against the backward axis.
    projection = np.diag([1.0 / halves[0], 1.0 / halves[1], -1.0 / halves[2], 1.0])
    return View(translation_matrix(-middle) @ matrix, projection, Camera(orthographic=True))


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
