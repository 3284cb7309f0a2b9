"""Pose correctives of many actors on the GPU, by the two methods of ``rest_buffers``."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.upload import (
    empty_offsets,
    pair_texture,
    write_pairs,
    write_stacked,
)
from viewer.rig.arrays import Floats

__all__ = ["SummedOffsets"]


class SummedOffsets:
    """Offsets that ``include/skinning.glsl`` adds to the vertices of each instance.

    If the shader sums the offsets, a list contains the weights of all instances. If the CPU sums
    them, one matrix product computes a row of offsets for every instance.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    mesh : MeshBuffers
        Mesh of the figure.
    way : str
        One of ``rest_buffers.WAYS``.

    Attributes
    ----------
    n_listed : int
        Length of each instance's list; 0 if there are no correctives.
    has_sums : bool
        Whether there is a row of sums for each instance.
    """

    def __init__(self, context: moderngl.Context, mesh: MeshBuffers, way: str) -> None:
        self.context, self.mesh, self.way = context, mesh, way
        self.n_listed, self.has_sums = 0, False
        self._weights: NDArray[np.float32] = np.zeros((0, 0), "f4")
        self._sums: NDArray[np.float32] = np.zeros((0, 0), "f4")
        self._list: moderngl.Texture | None = None
        self._summed: moderngl.Texture | None = None

    def update(self, weights: Floats | None, rows: NDArray[np.intp], count: int) -> None:
        """Update to new poses.

        Parameters
        ----------
        weights : (C, P) or None
            Weights of the correctives, for changed instances; None for no correctives.
        rows : (C,)
            Indices of these instances.
        count : int
            Number of all instances, A.
        """
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

    def use(self, list_unit: int, offsets_unit: int) -> None:
        """Bind the textures for summing in the shader, if used."""
        if self.n_listed and self._list is not None:
            self._list.use(list_unit)
            self.mesh.offsets.use(offsets_unit)
        if self.has_sums and self._summed is not None:
            self._summed.use(offsets_unit)

    def release(self) -> None:
        """Free the textures."""
        for item in (self._list, self._summed):
            if item is not None:
                item.release()
        self._list = self._summed = None
