"""Posed vertices of one actor that is drawn individually, and all that its drawing needs."""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.rendering.gpu.back_faces import BackFaces
from viewer.rendering.gpu.index_sets import IndexSet
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.posed_vertices import PosedVertices, skinning_options_key
from viewer.rendering.gpu.program import Programs
from viewer.rendering.gpu.surfaces import Surface
from viewer.rendering.options import DisplayOptions
from viewer.rendering.scalar_quantities import ScalarBuffer
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.kinematics import palette_sizes, posed_skeleton
from viewer.rigs.pose import Pose
from viewer.rigs.shape import pose_weights, shaped
from viewer.rigs.skinning import Skinning

_ALONE = np.zeros(1, np.intp)


class PosedMesh:
    """One actor's posed vertices; see ``PosedVertices``."""

    def __init__(self, context: moderngl.Context, programs: Programs, mesh: MeshBuffers) -> None:
        self.context, self.programs, self.mesh = context, programs, mesh
        self._owner = Owner()
        with self._owner.guard():
            self._vertices = self._owner.keep(PosedVertices(context, programs, mesh))
            self._vertices.reserve(1)
        self.back_faces = BackFaces(mesh)
        self._looks = _MaterialLooks(mesh)
        self.scalars = self._owner.keep(ScalarBuffer(context, mesh))
        self._key: tuple[object, ...] | None = None
        self._is_mirrored = False
        self.hidden_parts: frozenset[int] = frozenset()
        self.n_updates = 0

    @property
    def posed(self) -> moderngl.Buffer:
        """The posed vertices: a row for every split vertex."""
        return self._vertices.posed

    @property
    def center(self) -> Floats:
        """Posed centre, figure space: (3,)."""
        return self._vertices.centers[0]

    def index_set(self, options: DisplayOptions, as_listed: bool = False) -> IndexSet:
        """Return the drawn triangles; see ``MeshBuffers.index_set``."""
        hidden = options.hidden_parts
        found = self.mesh.index_set(options.reduced, hidden, as_listed, self.hidden_parts)
        return self._looks.of(found)

    def update(self, pose: Pose | None, skinning: Skinning | str = "lbs") -> None:
        """Skin the mesh if pose (None: the bind pose) or method changed since the last call."""
        self._looks.update(pose)
        how = Skinning(skinning) if isinstance(skinning, str) else skinning
        if not self.mesh.figure.is_attached:
            pose = None
        key: tuple[object, ...] = ("binding",)
        if pose is not None:
            key = (*skinning_options_key(how), pose.skinning_key)
        if key == self._key:
            return
        self._key, self._is_mirrored = None, False
        figure = self.mesh.figure
        if pose is None:
            self._vertices.unpose()
        else:
            figure = shaped(figure, pose.shape_weights)
            self._skin(figure, pose, how)
        self.back_faces.update(figure, pose, how)
        self._key = key
        self.n_updates += 1

    def _skin(self, figure: Figure, pose: Pose, how: Skinning) -> None:
        skeleton, skin = figure.require_skeleton(), figure.require_skin()
        matrices = posed_skeleton(skeleton, pose).palette(skin)[None].copy()
        weights: Floats | None = None
        if figure.correctives is not None and how.correctives:
            weights = pose_weights(figure.correctives, skeleton, pose)[None]
        sizes = palette_sizes(skin, pose.scales, matrices)
        if not self._vertices.skin(_ALONE, figure, how, matrices, weights, sizes)[0]:
            signs = np.sign(np.linalg.det(matrices[0, :, :3, :3]))
            self._is_mirrored = bool(self.mesh.skin(how).joint_fractions @ signs < 0.0)

    def is_mirrored_by(self, placement: Floats) -> bool:
        """Return whether a placement, (4, 4), or most of the skinning reflects the mesh."""
        # Its triangles are then clockwise seen from their front.
        return self._is_mirrored != bool(np.linalg.det(placement[:3, :3]) < 0.0)

    def posed_positions(self) -> NDArray[np.float32]:
        """Return the current positions of the split vertices, relative to the centre: (R, 3)."""
        return np.frombuffer(self.posed.read(), dtype="f4").reshape(-1, 6)[:, :3]

    def read(self) -> tuple[Floats, Floats]:
        """Return the posed positions in figure space and normals of the vertices, (V, 3) each."""
        rows = np.frombuffer(self.posed.read(), dtype="f4").reshape(-1, 6).astype(np.float64)
        rows = rows[self.mesh.copies]
        return rows[:, :3] + self.center, rows[:, 3:]

    def release(self) -> None:
        """Free the buffers of this actor."""
        self._owner.release()


class _MaterialLooks:
    """The surfaces of one actor that differ from its figure's surfaces."""

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
