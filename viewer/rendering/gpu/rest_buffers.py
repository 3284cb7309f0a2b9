"""Rest vertices of one actor: the figure's, or a copy with shape and correctives applied.

Pose correctives are summed in one of two ways. On a graphics card, the vertex shader sums them
from a texture, and a frame uploads only the weights. Software drivers are several times faster
with one matrix-vector product per changed pose (``tests/bench`` prints both).
"""

from __future__ import annotations

import moderngl
import numpy as np

from viewer.errors import RenderError
from viewer.rendering.gpu.context import is_software
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.skin_buffers import SkinBuffers
from viewer.rendering.gpu.upload import float32, pair_texture, reserved, write_pairs
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.pose import Pose
from viewer.rig.shape import pose_weights
from viewer.rig.skinning import Skinning

__all__ = ["WAYS", "RestBuffers"]

WAYS = ("texture", "product")
"""Methods of summing pose correctives."""

# Maximum number of offsets in a texture, 12 bytes each; more are summed on the CPU.
_MOST_TEXELS = 24 << 20


class RestBuffers:
    """Positions and normals that are the input of the skinning shader.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    mesh : MeshBuffers
        Mesh that is used unchanged while shape and correctives are 0.
    way : str
        One of ``WAYS``; chosen by the driver if empty.

    Attributes
    ----------
    positions, normals : moderngl.Buffer
        One row per split vertex; positions are relative to the mesh's centre.
    n_offsets : int
        Number of rows of correctives that the shader adds.
    """

    def __init__(self, context: moderngl.Context, mesh: MeshBuffers, way: str = "") -> None:
        self.context, self.mesh = context, mesh
        self.way = way or _usual_way(context, mesh)
        self.positions, self.normals = mesh.positions, mesh.normals
        self.n_offsets = 0
        self._own: tuple[moderngl.Buffer, moderngl.Buffer] | None = None
        self._list: moderngl.Texture | None = None
        self._key: tuple[bytes, bytes] = b"", b""

    def update(self, figure: Figure, pose: Pose, how: Skinning) -> None:
        """Update to a shape and pose.

        Parameters
        ----------
        figure : Figure
            Figure with its shape applied.
        pose : Pose
            DOFs in lengths and radians.
        how : Skinning
            Whether pose correctives are added.
        """
        weights = self._weights(figure, pose) if how.correctives else np.zeros(0)
        active = weights.any()
        self.n_offsets = 0
        if active and self.way == "texture":
            self._write_list(weights)
        shape = b"" if figure is self.mesh.figure else pose.shape_weights.tobytes()
        key = (shape, weights.tobytes() if active and self.way == "product" else b"")
        if key != self._key:
            self._write(figure, weights if key[1] else None, normals=key[0] != self._key[0])
            self._key = key

    def _weights(self, figure: Figure, pose: Pose) -> Floats:
        if figure.correctives is None or figure.skeleton is None:
            return np.zeros(0)
        return pose_weights(figure.correctives, figure.skeleton, pose)

    def _write_list(self, weights: Floats) -> None:
        rows = np.flatnonzero(weights)
        if self._list is None:
            self._list = pair_texture(self.context, np.zeros(len(weights)), np.zeros(len(weights)))
        write_pairs(self._list, rows, weights[rows])
        self.n_offsets = len(rows)

    def _write(self, figure: Figure, weights: Floats | None, normals: bool) -> None:
        """Upload positions, and normals if the shape changed, of every split vertex."""
        shape = figure.require_mesh()
        if self._own is None:
            size = self.mesh.positions.size
            positions = reserved(self.context, size, "a shaped mesh")
            try:
                self._own = positions, reserved(self.context, size, "a shaped mesh")
            except RenderError:
                positions.release()
                raise
            self.positions, self.normals = self._own
            normals = True
        rest = float32(shape.positions - self.mesh.center)
        if weights is not None:
            rest += self.mesh.summed(weights[None])[0].reshape(-1, 3)
        self.positions.write(rest[self.mesh.sources])
        if normals:
            self.normals.write(float32(shape.normals[self.mesh.sources]))

    def attributes(
        self, program: moderngl.Program, skin: SkinBuffers, attached: bool = True
    ) -> list[tuple[moderngl.Buffer, str, str]]:
        """Return the vertex attributes of ``include/skinning.glsl``, for a vertex array.

        Parameters
        ----------
        program : moderngl.Program
            Attributes that it does not use are omitted.
        skin : SkinBuffers
            Influences.
        attached : bool
            Whether shape and correctives apply; otherwise the mesh is used as stored.
        """
        rest = self if attached else self.mesh
        found = [
            (rest.positions, "3f4", "in_position"),
            (rest.normals, "3f4", "in_normal"),
            (skin.bindings, "4u4", "in_bindings"),
            (skin.fractions, "1f4", "in_dqs_fraction"),
        ]
        return [row for row in found if row[2] in program]

    def use(self, list_unit: int, offsets_unit: int) -> None:
        """Bind the textures for summing correctives in the shader, if used."""
        if self.n_offsets and self._list is not None:
            self._list.use(list_unit)
            self.mesh.offsets.use(offsets_unit)

    def release(self) -> None:
        """Free the buffers of this actor."""
        for item in (*(self._own or ()), self._list):
            if item is not None:
                item.release()


def _usual_way(context: moderngl.Context, mesh: MeshBuffers) -> str:
    correctives = mesh.figure.correctives
    count = 0 if correctives is None else correctives.offsets.shape[0] * correctives.n_vertices
    return "product" if is_software(context) or count > _MOST_TEXELS else "texture"
