"""Rest vertices with shape and pose correctives, of one actor or of many instances.

Pose correctives are summed in one of two ways. On a graphics card, the vertex shader sums them
from a texture, and a frame uploads only the weights. Software drivers are several times faster
with one matrix-vector product per changed pose (``tests/bench`` prints both).
"""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.errors import RenderError
from viewer.rendering.gpu.context import is_software
from viewer.rendering.gpu.mesh_buffers import MeshBuffers, SkinBuffers
from viewer.rendering.gpu.upload import (
    empty_offsets,
    float32,
    pair_texture,
    reserved,
    write_pairs,
    write_stacked,
)
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.pose import Pose
from viewer.rig.shape import pose_weights
from viewer.rig.skinning import Skinning

SKINNING_SAMPLERS = {
    "u_palette": 0,
    "u_pairs": 1,
    "u_rigid": 2,
    "u_offset_list": 3,
    "u_offsets": 4,
}
"""Texture unit of each sampler of ``include/skinning.glsl``."""

WAYS = ("texture", "product")
"""Methods of summing pose correctives."""

# Maximum number of offsets in a texture, 12 bytes each; more are summed on the CPU.
_MOST_TEXELS = 24 << 20


class RestBuffers:
    """Positions and normals of one actor, the input of the skinning shader."""

    # They are the figure's, from a mesh that is used unchanged while shape and correctives are 0,
    # or a copy with shape and correctives applied.

    def __init__(self, context: moderngl.Context, mesh: MeshBuffers, way: str = "") -> None:
        self.context, self.mesh = context, mesh
        self.way = way or _usual_way(context, mesh)
        self.positions, self.normals = mesh.positions, mesh.normals
        self.n_offsets = 0
        self._own: tuple[moderngl.Buffer, moderngl.Buffer] | None = None
        self._list: moderngl.Texture | None = None
        self._key: tuple[bytes, bytes] = b"", b""

    def update(self, figure: Figure, pose: Pose, how: Skinning) -> None:
        """Update to a shape and pose."""
        weights = self._weights(figure, pose) if how.correctives else np.zeros(0)
        active = weights.any()
        self.n_offsets = 0
        if active and self.way == "texture":
            rows = np.flatnonzero(weights)
            if self._list is None:
                empty = np.zeros(len(weights))
                self._list = pair_texture(self.context, empty, empty)
            write_pairs(self._list, rows, weights[rows])
            self.n_offsets = len(rows)
        shape = b"" if figure is self.mesh.figure else pose.shape_weights.tobytes()
        key = (shape, weights.tobytes() if active and self.way == "product" else b"")
        if key != self._key:
            mesh, is_reshaped = figure.require_mesh(), key[0] != self._key[0]
            if self._own is None:
                size = self.mesh.positions.size
                positions = reserved(self.context, size, "a shaped mesh")
                try:
                    self._own = positions, reserved(self.context, size, "a shaped mesh")
                except RenderError:
                    positions.release()
                    raise
                self.positions, self.normals = self._own
                is_reshaped = True
            rest = float32(mesh.positions - self.mesh.center)
            if key[1]:
                rest += self.mesh.summed(weights[None])[0].reshape(-1, 3)
            self.positions.write(rest[self.mesh.sources])
            if is_reshaped:
                self.normals.write(float32(mesh.normals[self.mesh.sources]))
            self._key = key

    def _weights(self, figure: Figure, pose: Pose) -> Floats:
        if figure.correctives is None or figure.skeleton is None:
            return np.zeros(0)
        return pose_weights(figure.correctives, figure.skeleton, pose)

    def attributes(
        self, skin: SkinBuffers, attached: bool = True
    ) -> list[tuple[moderngl.Buffer, str, str]]:
        """Return the attributes of ``include/skinning.glsl``."""
        rest = self if attached else self.mesh
        return [
            (rest.positions, "3f4", "in_position"),
            (rest.normals, "3f4", "in_normal"),
            (skin.bindings, "4u4", "in_bindings"),
            (skin.fractions, "1f4", "in_dqs_fraction"),
        ]

    def use(self) -> None:
        """Bind the textures for summing correctives in the shader, if used."""
        if self.n_offsets and self._list is not None:
            self._list.use(SKINNING_SAMPLERS["u_offset_list"])
            self.mesh.offsets.use(SKINNING_SAMPLERS["u_offsets"])

    def release(self) -> None:
        """Free the buffers of this actor."""
        for item in (*(self._own or ()), self._list):
            if item is not None:
                item.release()


class SummedOffsets:
    """Offsets that ``include/skinning.glsl`` adds to the vertices of each instance."""

    # If the shader sums the offsets, a list contains the weights of all instances, ``n_listed`` of
    # each. If the CPU sums them, one matrix product computes a row of offsets for every instance.

    def __init__(self, context: moderngl.Context, mesh: MeshBuffers, way: str) -> None:
        self.context, self.mesh, self.way = context, mesh, way
        self.n_listed, self.has_sums = 0, False
        self._weights: NDArray[np.float32] = np.zeros((0, 0), "f4")
        self._sums: NDArray[np.float32] = np.zeros((0, 0), "f4")
        self._list: moderngl.Texture | None = None
        self._summed: moderngl.Texture | None = None

    def update(self, weights: Floats | None, rows: NDArray[np.intp], count: int) -> None:
        """Update changed instances, ``rows`` (C,), to the correctives' weights, (C, P), if any."""
        self.n_listed, self.has_sums = 0, False
        if weights is None:
            self._weights = np.zeros((0, 0), "f4")
            return
        if len(self._weights) < count or self._weights.shape[1] != weights.shape[1]:
            grown = np.zeros((count, weights.shape[1]), "f4")
            if self._weights.shape[1] == weights.shape[1]:
                grown[: len(self._weights)] = self._weights
            self._weights = grown
        self._weights[rows] = weights
        if not self._weights[:count].any():
            self._sums = self._sums[:0]  # all sums are invalid
            return
        if self.way == "texture":
            self._list_weights(count)
        else:
            self._sum(rows, count)

    def _list_weights(self, count: int) -> None:
        columns = np.flatnonzero(self._weights[:count].any(axis=0))
        self.n_listed = len(columns)
        indices, weights = np.tile(columns, count), self._weights[:count, columns].ravel()
        if self._list is None or self._list.width * self._list.height < len(indices):
            if self._list is not None:
                self._list.release()
                self._list = None
            self._list = pair_texture(self.context, indices, weights)
        else:
            write_pairs(self._list, indices, weights)

    def _sum(self, rows: NDArray[np.intp], count: int) -> None:
        """Multiply the weights of all changed instances by the offsets in one product."""
        size = 3 * len(self.mesh.copies)
        if len(self._sums) < count:
            self._sums, rows = np.zeros((count, size), "f4"), np.arange(count)
        self._sums[rows] = self.mesh.summed(self._weights[rows])
        texels = count * size // 3
        if self._summed is None or self._summed.width * self._summed.height < texels:
            if self._summed is not None:
                self._summed.release()
                self._summed = None
            self._summed = empty_offsets(self.context, texels)
        write_stacked(self._summed, self._sums[:count])
        self.has_sums = True

    def use(self) -> None:
        """Bind the textures for summing in the shader, if used."""
        if self.n_listed and self._list is not None:
            self._list.use(SKINNING_SAMPLERS["u_offset_list"])
            self.mesh.offsets.use(SKINNING_SAMPLERS["u_offsets"])
        if self.has_sums and self._summed is not None:
            self._summed.use(SKINNING_SAMPLERS["u_offsets"])

    def release(self) -> None:
        """Free the textures."""
        for item in (self._list, self._summed):
            if item is not None:
                item.release()
        self._list = self._summed = None


def _usual_way(context: moderngl.Context, mesh: MeshBuffers) -> str:
    correctives = mesh.figure.correctives
    count = 0 if correctives is None else correctives.offsets.shape[0] * correctives.n_vertices
    return "product" if is_software(context) or count > _MOST_TEXELS else "texture"
