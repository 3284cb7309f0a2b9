"""A figure's mesh and skin on the GPU: uploaded once, never changed."""

from __future__ import annotations

import moderngl
import numpy as np

from viewer.rendering.upload import buffer, pair_texture, picture_texture
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.mesh import bounding_box
from viewer.rig.skin import has_influence, weight_sums

__all__ = ["MeshBuffers", "MeshRun"]


class MeshRun:
    """Consecutive triangles with one material: first index, number of indices, its texture."""

    __slots__ = ("count", "first", "texture")

    def __init__(self, first: int, count: int, texture: moderngl.Texture | None) -> None:
        self.first, self.count, self.texture = first, count, texture


class MeshBuffers:
    """Rest vertices, triangle indices, influences and textures of one figure.

    Positions are stored relative to the middle of the mesh: float32 then spends its digits on
    the figure's shape, however far from the origin it stands.

    Parameters
    ----------
    context : moderngl.Context
        Owns nothing here; ``release`` frees all.
    figure : Figure
        With a mesh.
    notes : list of str
        Gets a line for each thing that the driver cannot do as asked.

    Attributes
    ----------
    center : (3,)
        What was subtracted, figure space.
    joint_shares : (J,)
        Each joint's part in all weights: their mean motion is that of the figure.
    """

    def __init__(self, context: moderngl.Context, figure: Figure, notes: list[str]) -> None:
        mesh = figure.mesh
        assert mesh is not None  # only figures with a mesh come here
        self.figure = figure
        self.n_vertices = mesh.n_vertices
        self.center: Floats = bounding_box(mesh.positions).mean(axis=0)
        self.positions = buffer(context, mesh.positions - self.center, "f4")
        self.normals = buffer(context, mesh.normals, "f4")
        self.uvs = None if mesh.uvs is None else buffer(context, mesh.uvs, "f4")
        self.indices = buffer(context, mesh.triangles, "u4")
        self._upload_influences(context, figure)
        self._textures = [
            None if material.image is None else picture_texture(context, material.image, notes)
            for material in mesh.materials
        ]
        self.runs = self._runs(mesh.material_indices)

    def _upload_influences(self, context: moderngl.Context, figure: Figure) -> None:
        skin = figure.skin
        if skin is None:
            self.joint_shares = np.zeros(0)
            ranges, self.pairs = np.zeros((self.n_vertices, 2)), pair_texture(context, [], [])
            excess = np.zeros(self.n_vertices)
        else:
            counts = np.where(has_influence(skin), np.diff(skin.starts), 0)
            ranges = np.stack([skin.starts[:-1], counts], axis=1)
            self.pairs = pair_texture(context, skin.joints, skin.weights)
            sums = np.bincount(skin.joints, np.abs(skin.weights), minlength=skin.n_joints)
            self.joint_shares = sums / (sums.sum() or 1.0)
            # Summed in float64: in float32 even thirds miss 1, which far away moves a vertex.
            excess = weight_sums(skin) - 1.0
        self.influences = buffer(context, ranges, "u4")
        self.excess = buffer(context, excess, "f4")

    def _runs(self, materials: np.ndarray) -> list[MeshRun]:
        edges = np.flatnonzero(np.diff(materials)) + 1
        runs = []
        for first, last in zip([0, *edges], [*edges, len(materials)], strict=True):
            index = int(materials[first]) if len(materials) else -1
            texture = None if index < 0 or self.uvs is None else self._textures[index]
            runs.append(MeshRun(3 * int(first), 3 * int(last - first), texture))
        return runs

    def release(self) -> None:
        """Free every buffer and texture."""
        owned = [self.positions, self.normals, self.uvs, self.indices]
        for item in [*owned, self.influences, self.excess, self.pairs, *self._textures]:
            if item is not None:
                item.release()
