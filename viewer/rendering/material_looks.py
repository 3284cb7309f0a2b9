"""Surfaces of an actor whose expressions change materials."""

from __future__ import annotations

from dataclasses import replace

from viewer.rendering.gpu.index_sets import IndexSet
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.surfaces import Surface
from viewer.rig.pose import Pose

__all__ = ["MaterialLooks"]


class MaterialLooks:
    """The surfaces of one actor that differ from its figure's surfaces.

    Parameters
    ----------
    mesh : MeshBuffers
        Mesh of the figure.
    """

    def __init__(self, mesh: MeshBuffers) -> None:
        self._mesh = mesh
        self._key = b""
        self._changed: dict[int, Surface] = {}

    def update(self, pose: Pose | None) -> None:
        """Compute the surfaces of a pose; None for the figure's surfaces."""
        shapes = self._mesh.figure.blend_shapes
        binds = None if shapes is None else shapes.material_binds
        if shapes is None or binds is None:
            return
        key = b"" if pose is None else pose.shape_weights.tobytes()
        if key == self._key:
            return
        self._key, self._changed = key, {}
        if pose is None:
            return
        surfaces = self._mesh.surfaces
        materials = self._mesh.figure.require_mesh().materials
        changed = binds.changed(materials, shapes.shown(pose.shape_weights))
        self._changed = {
            id(surfaces[index]): surfaces[index].changed(material)
            for index, material in changed.items()
        }

    def of(self, indices: IndexSet) -> IndexSet:
        """Return triangles with the surfaces of the last pose."""
        if not self._changed:
            return indices
        runs = (
            replace(run, surface=self._changed.get(id(run.surface), run.surface))
            for run in indices.runs
        )
        return replace(indices, runs=tuple(runs))
