"""Outlines around selected and hovered actors, joints and points.

The pass draws a mask of the outlined parts, then the distances from it, then a line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import Any

import moderngl
import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.gpu.actor_buffers import ActorBuffers
from viewer.rendering.gpu.draw_state import without_depth_test
from viewer.rendering.gpu.index_sets import MeshRun
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.target import Target
from viewer.rendering.lineup import has_points, placement_of, shows_mesh, shows_skeleton
from viewer.rendering.options import DisplayOptions
from viewer.rendering.overlay.segments import SegmentPass, SegmentStyle, dots
from viewer.rendering.passes.joint_pass import draw_joints, joint_program
from viewer.rendering.passes.mesh_pass import MeshPass
from viewer.rendering.passes.point_pass import PointPass
from viewer.rendering.projection import picture_scale
from viewer.rendering.view import View
from viewer.rigs.arrays import Floats
from viewer.rigs.scene import Actor, Scene

_COLORS = ((1.0, 0.66, 0.10), (0.80, 0.93, 1.0))
"""Outline colours of selected and hovered parts, sRGB."""

_WIDTH = 2.0  # line width, pixels in an image of standard height
_POINT = 9.0  # diameter of a point, pixels in an image of standard height
# Side length of the tiles of tile.vert, pixels; mipmap level with texels of that size.
_TILE, _LEVEL = 16, 4
_MOST = 12  # maximum search radius around a mask, pixels


@dataclass(frozen=True, slots=True, eq=False)
class Outlined:
    """An outlined part of the scene."""

    actor: int
    """Index in the scene."""
    joint: int = -1
    """Joint of the actor, outlined if the skeleton is drawn; -1 for the whole actor."""
    points: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    """(N, 3). Points in scene space, outlined instead of the actor and joint if there are any."""
    is_hovered: bool = False
    """Whether it lies under the pointer, rather than being selected."""

    def key(self) -> tuple[object, ...]:
        """Return a key that identifies the outline in an unchanged scene."""
        return self.actor, self.joint, self.points.tobytes(), self.is_hovered


class OutlinePass:
    """Pass that draws outlines over everything, even objects in front of the outlined parts."""

    def __init__(
        self,
        programs: Programs,
        meshes: MeshPass,
        points: PointPass,
        buffers: ActorBuffers,
    ) -> None:
        self.context, self._programs = programs.context, programs
        self._meshes, self._points, self._buffers = meshes, points, buffers
        self._segments = SegmentPass(self.context, programs)
        self._spread = programs.drawing("tile", fragment="spread")
        self._line = programs.drawing("tile", fragment="outline")
        self._arrays = [self.context.vertex_array(p, []) for p in (self._spread, self._line)]
        self._mask: Target | None = None
        self._distance: list[Any] = []

    def draw(
        self,
        outlined: Sequence[Outlined],
        scene: Scene,
        view: View,
        options: DisplayOptions,
        target: Target,
        is_layer: bool = False,
    ) -> None:
        """Draw outlines into a target; its framebuffer is bound afterwards."""
        # A layer replaces the target's colours where there are lines, with straight instead of
        # premultiplied alpha.
        self._make(target.size, options.samples)
        assert self._mask is not None  # ``_make`` created it
        mask = self._mask
        mask.framebuffer.use()
        self.context.viewport = (0, 0, *target.size)
        mask.framebuffer.clear()
        self.context.blend_func = moderngl.ONE, moderngl.ONE
        with without_depth_test(self.context):
            for one in outlined:
                if 0 <= one.actor < len(scene.actors):
                    self._cover(one, scene.actors[one.actor], view, options, target.size)
            self.context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
            covered = mask.resolve()
            covered.build_mipmaps(max_level=_LEVEL)
            covered.use(0)
            self._compose(target, is_layer)

    def _make(self, size: tuple[int, int], samples: int) -> None:
        """Create masks of the image's size."""
        mask = self._mask
        if mask is not None and (mask.size, mask.asked_samples) == (size, samples):
            return
        self._free()
        self._mask = Target(self.context, size, samples)
        self._mask.texture.filter = (moderngl.NEAREST_MIPMAP_NEAREST, moderngl.NEAREST)
        texture = self.context.texture(size, 2, dtype="f2")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._distance = [texture, self.context.framebuffer([texture])]

    def _compose(self, target: Target, is_layer: bool) -> None:
        """Find distances from the resolved mask, and draw the lines, in tiles with an edge."""
        size, scale = target.size, picture_scale(target.size)
        reach = min(int(np.ceil(scale * _WIDTH)) + 2, _MOST)
        level = min(_LEVEL, int(np.log2(min(size))))
        tiles = -(-size[0] // _TILE) * -(-size[1] // _TILE)
        texture, framebuffer = self._distance
        framebuffer.use()
        self.context.viewport = (0, 0, *size)
        framebuffer.clear(1.0, 1.0, 1.0, 1.0)
        self.context.disable(moderngl.BLEND)
        edges = {"u_mask": 0, "u_reach": reach, "u_level": level}
        set_uniforms(self._spread, edges)
        self._arrays[0].render(moderngl.TRIANGLE_STRIP, vertices=4, instances=tiles)
        target.framebuffer.use()
        self.context.viewport = (0, 0, *size)
        if not is_layer:
            self.context.enable(moderngl.BLEND)
        texture.use(1)
        colors = np.array(_COLORS, dtype="f4").tobytes()
        values = {
            "u_distance": 1,
            "u_width": scale * _WIDTH,
            "u_colors": colors,
            "u_straight": is_layer,
        }
        set_uniforms(self._line, {**edges, **values})
        self._arrays[1].render(moderngl.TRIANGLE_STRIP, vertices=4, instances=tiles)
        self.context.enable(moderngl.BLEND)

    def _cover(
        self,
        one: Outlined,
        actor: Actor,
        view: View,
        options: DisplayOptions,
        size: tuple[int, int],
    ) -> None:
        """Add the coverage of one part to the mask."""
        mask = (0.0, 1.0, 0.0, 1.0) if one.is_hovered else (1.0, 0.0, 0.0, 1.0)
        if len(one.points):
            marks = dots(one.points, np.array(mask), picture_scale(size) * _POINT)
            self._segments.draw(marks, view, size, SegmentStyle(on_top=True))
            return
        if not actor.is_drawn:
            return
        placement = placement_of(actor, options)
        if shows_skeleton(actor, options):
            skeleton = self._buffers.skeleton(actor)
            program = joint_program(self._programs, skeleton, options, "", "mask")
            set_uniforms(program, {"u_mask": mask})
            draw_joints(program, skeleton, placement, view, options, only=one.joint)
        if one.joint >= 0:
            return
        if shows_mesh(actor.figure, options):
            mesh = self._buffers.posed_mesh(actor)
            mesh.update(None if options.show == "binding" else actor.own_pose, options.skinning)

            def prepare(program: moderngl.Program, _: MeshRun) -> None:
                set_uniforms(program, {"u_mask": mask})

            self._meshes.draw_shape(mesh, placement, view, options, "mask", prepare)
        if has_points(actor, options):
            points = self._buffers.points_of(actor)
            points.update(actor, actor.placement, view, options)
            set_uniforms(self._programs.drawing("point", fragment="mask"), {"u_mask": mask})
            self._points.draw_shapes(points, actor.placement, view, "mask")

    def _free(self) -> None:
        for item in self._distance:
            item.release()
        if self._mask is not None:
            self._mask.release()
        self._mask, self._distance = None, []

    def release(self) -> None:
        """Free the masks and vertex arrays."""
        self._free()
        self._segments.release()
        for array in self._arrays:
            array.release()
