"""Instances of a cube: the corners, colour and matrix of each box."""

from __future__ import annotations

import moderngl
import numpy as np

from viewer.rendering.colors import joint_colors
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.upload import buffer, float32, matrix_texture, write_stacked
from viewer.rendering.gpu.vertex_arrays import VertexArrays
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.mesh import bounding_box

_MANY = 1000  # minimum number of boxes for which coincident boxes are searched


class BoxBuffers:
    """Boxes on the GPU, each with its own matrix.

    ``world``: the matrices, relative to ``center``: (3,), figure space; part of the model matrix.
    ``cube``: corners and normals of a cube from 0 to 1, shared by all boxes. ``boxes``: (N, 2, 3),
    lower and upper corner of each box. ``colors``: (N, 3) linear; those of joints if omitted.
    """

    def __init__(
        self,
        context: moderngl.Context,
        cube: moderngl.Buffer,
        boxes: Floats,
        colors: Floats | None = None,
    ) -> None:
        self.count, self._boxes = len(boxes), boxes
        self.center: Floats = np.zeros(3)
        self._cube = cube
        self._owner = Owner()
        with self._owner.guard():
            keep = self._owner.keep
            self._low = keep(buffer(context, boxes[:, 0], "f4"))
            self._high = keep(buffer(context, boxes[:, 1], "f4"))
            colors = joint_colors(self.count) if colors is None else colors
            self._colors = keep(buffer(context, colors, "f4"))
            self.world = keep(matrix_texture(context, self.count))
        self._arrays = self._owner.keep(VertexArrays(context))

    def move(self, matrices: Floats, hides: bool = True) -> None:
        """Upload the matrices from box to figure space, (N, 4, 4), which are modified in place."""
        # If ``hides`` is true, only one of many coincident boxes is drawn.
        self.center = bounding_box(matrices[:, :3, 3]).mean(axis=0)
        matrices[:, :3, 3] -= self.center
        if hides and self.count > _MANY:
            matrices[self._hidden(matrices)] = 0.0
        write_stacked(self.world, float32(matrices[:, :3]))

    def _hidden(self, matrices: Floats) -> Bools:
        """Return a mask of boxes that coincide with an earlier one, to collapse them to a point."""
        # Software drivers take minutes to draw a hundred thousand overlapping boxes.
        rows = np.concatenate([matrices[:, :3].reshape(-1, 12), self._boxes.reshape(-1, 6)], axis=1)
        _, first = np.unique(rows.astype(np.float32), axis=0, return_index=True)
        hidden = np.ones(len(rows), dtype=bool)
        hidden[first] = False
        return hidden

    def array(self, program: moderngl.Program) -> moderngl.VertexArray:
        """Return the instanced boxes for a program, with the attributes that it uses."""
        content = [
            (self._cube, "3f4 3f4", "in_corner", "in_normal"),
            (self._low, "3f4/i", "in_low"),
            (self._high, "3f4/i", "in_high"),
            (self._colors, "3f4/i", "in_color"),
        ]
        return self._arrays.get(program, lambda: content)

    def release(self) -> None:
        """Free every buffer."""
        self._owner.release()
