"""Rest vertices with shape and pose correctives, the input of the skinning shader."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.errors import RenderError
from viewer.rendering.gpu.corrective_sums import Request, Way
from viewer.rendering.gpu.mesh_buffers import MeshBuffers, SkinBuffers
from viewer.rendering.gpu.program import RESTS_BINDING, Programs
from viewer.rendering.gpu.upload import float32, reserved
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure


class RestBuffers:
    """Rest positions and normals of actors of one shape.

    Without shape, they are the figure's. ``n_corrected``: number of poses whose positions with pose
    correctives are in ``corrected``, (n_corrected, R, 3); 0 if correctives are off or all 0.
    """

    def __init__(self, context: moderngl.Context, programs: Programs, mesh: MeshBuffers) -> None:
        self.context, self.programs, self.mesh = context, programs, mesh
        self.positions, self.normals = mesh.positions, mesh.normals
        self.n_corrected = 0
        self.corrected: moderngl.Buffer | None = None
        self._own: tuple[moderngl.Buffer, moderngl.Buffer] | None = None
        self._shape: Figure = mesh.figure
        self._rest: NDArray[np.float32] | None = None
        self._version = 0

    def reshape(self, figure: Figure) -> None:
        """Upload the vertices of a shaped figure if they differ from the present ones."""
        if figure is self._shape:
            return
        if figure is self.mesh.figure:
            self.positions, self.normals = self.mesh.positions, self.mesh.normals
        else:
            mesh = figure.require_mesh()
            if self._own is None:
                size = self.mesh.positions.size
                positions = reserved(self.context, size, "a shaped mesh")
                try:
                    self._own = positions, reserved(self.context, size, "a shaped mesh")
                except RenderError:
                    positions.release()
                    raise
            self.positions, self.normals = self._own
            self.positions.write(float32((mesh.positions - self.mesh.center)[self.mesh.sources]))
            self.normals.write(float32(mesh.normals[self.mesh.sources]))
        self._shape, self._rest = figure, None

    def correct(self, weights: Floats | None) -> None:
        """Add the pose correctives of poses, weights (A, P), to the positions of the shape."""
        self.n_corrected = 0
        if weights is None or not weights.any():
            return
        self.mesh.corrective_sums.write(self._request(weights))
        self.n_corrected = len(weights)

    def corrective_times(self, weights: Floats) -> dict[Way, float]:
        """Return the seconds that ``correct`` takes in each way; see ``CorrectiveSums``."""
        return self.mesh.corrective_sums.times(self._request(weights))

    def _request(self, weights: Floats) -> Request:
        size = len(weights) * self.mesh.positions.size
        if self.corrected is None or self.corrected.size < size:
            if self.corrected is not None:
                self.corrected.release()
            self.corrected = None
            self.corrected = reserved(self.context, size, "rest positions with pose correctives")
            self._version += 1
        if self._rest is None:
            self._rest = float32(self._shape.require_mesh().positions - self.mesh.center)
        return Request(self.programs, weights, self._rest, self.positions, self.corrected)

    @property
    def version(self) -> tuple[int, bool, bool]:
        """Key of the buffers that ``attributes`` returns."""
        is_shaped = self.positions is not self.mesh.positions
        return self._version, is_shaped, self.n_corrected == 1

    @property
    def has_rows(self) -> bool:
        """Whether several poses have their own rest positions, which the shader looks up."""
        return self.n_corrected > 1

    def attributes(
        self, skin: SkinBuffers, attached: bool = True
    ) -> list[tuple[moderngl.Buffer, str, str]]:
        """Return the attributes of ``skin.vert``."""
        rest = self if attached else self.mesh
        positions = rest.positions
        if attached and self.n_corrected == 1 and self.corrected is not None:
            positions = self.corrected
        return [
            (positions, "3f4", "in_position"),
            (rest.normals, "3f4", "in_normal"),
            (skin.bindings, "3u4", "in_bindings"),
            (skin.fractions, "1f4", "in_dqs_fraction"),
        ]

    def use(self) -> None:
        """Bind the rest positions of several poses."""
        if self.has_rows and self.corrected is not None:
            self.corrected.bind_to_storage_buffer(RESTS_BINDING)

    def release(self) -> None:
        """Free the buffers of these actors."""
        for item in (*(self._own or ()), self.corrected):
            if item is not None:
                item.release()
        self._own = self.corrected = None
