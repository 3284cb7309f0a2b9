"""Pass that draws the ground grid."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import moderngl
import numpy as np

from viewer.rendering.gpu.draw_state import behind, without_depth_writes
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.upload import buffer
from viewer.rendering.options import parse_color
from viewer.rendering.view import View, set_model
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.vectors import Up
from viewer.rigs.mesh import box_size
from viewer.rigs.number_text import round_step

LINE_COLOR = (0.20, 0.25, 0.32)
_LINE_ON_DARK = (0.62, 0.67, 0.73)
_EXTENT = 6.0  # half the side length of the grid, relative to the scene's size


def grid_step(box: Floats) -> float:
    """Return the distance between grid lines: 1, 2 or 5 times a power of ten of scene units.

    >>> grid_step(np.array([[0.0, 0.0, 0.0], [0.0, 1.6, 0.0]]))
    0.2
    """
    return round_step((box_size(box) or 1.0) / 8.0)


class GroundPass:
    """Pass that draws the ground grid."""

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.context, self.programs = context, programs
        self._corners = buffer(context, [[-1, -1], [1, -1], [-1, 1], [1, 1]], "f4")
        self._ground: moderngl.VertexArray | None = None

    def draw_grid(self, view: View, box: Floats, background: str) -> None:
        """Draw the grid under a box, (2, 3), which defines the grid's height, step and extent."""
        program = self.programs.drawing("ground")
        placement, values = grid_of(box, view.camera.up)
        set_model(program, view, placement, np.zeros(3))
        dark = background.startswith("#") and sum(parse_color(background)) < 1.2
        color = _LINE_ON_DARK if dark else LINE_COLOR
        set_uniforms(program, {**values, "u_line_color": color})
        if self._ground is None:
            content = [(self._corners, "2f4", "in_corner")]
            self._ground = self.context.vertex_array(program, content)
        # The translucent grid must not hide later draw calls, nor show through a flat mesh on the
        # ground, which has the same depth.
        with without_depth_writes(self.context), behind(self.context):
            self._ground.render(moderngl.TRIANGLE_STRIP)

    def release(self) -> None:
        """Free vertex arrays and buffers."""
        for item in (self._ground, self._corners):
            if item is not None:
                item.release()


def grid_of(box: Floats, up: Up) -> tuple[Floats, Mapping[str, object]]:
    """Return the placement, (4, 4), and the uniforms of the grid under a box, (2, 3)."""
    return _grid(tuple(box.ravel().tolist()), up)


@lru_cache(maxsize=16)
def _grid(corners: tuple[float, ...], up: Up) -> tuple[Floats, Mapping[str, object]]:
    """Return the placement, (4, 4), and the uniforms of the grid; ``corners``: those of its box."""
    box = np.array(corners).reshape(2, 3)
    step, extent = grid_step(box), _EXTENT * (box_size(box) or 1.0)
    axes = ground_axes(up)
    # The square is centred on a crossing of lines near the box, so that float32 keeps its
    # precision.
    cells = np.round(axes[:2] @ box.mean(axis=0) / step)
    height = (axes[2] @ box.T).min()
    placement = np.eye(4)
    placement[:3, :3] = axes.T
    placement[:3, 3] = axes.T @ np.array([*(cells * step), height])
    # Every tenth line is stronger, counted from the scene's origin.
    origin = tuple(np.fmod(-cells, 10.0).tolist())
    values = {"u_extent": extent, "u_fade": extent, "u_step": step, "u_origin": origin}
    return placement, values


def ground_axes(up: Up) -> Floats:
    """Return the ground's two axes and the up axis as rows, right-handed: (3, 3)."""
    if up == "z":
        return np.eye(3)
    return np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
