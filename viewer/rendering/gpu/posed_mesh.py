"""Posed vertices of an actor, skinned by a vertex shader with transform feedback.

The shader runs once per changed pose. All passes draw its output, the posed buffer, as a static
mesh, so shading, wireframe, normals and picking need no second skinning. Tests read the buffer
back.
"""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.rendering.gpu.back_faces import BackFaces
from viewer.rendering.gpu.index_sets import IndexSet
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.rest_buffers import SKINNING_SAMPLERS, RestBuffers
from viewer.rendering.gpu.surfaces import Surface
from viewer.rendering.gpu.upload import (
    checked,
    matrix_texture,
    rigid_texture,
    write_matrices,
    write_rigid,
)
from viewer.rendering.gpu.vertex_arrays import VertexArrays
from viewer.rendering.options import DisplayOptions
from viewer.rendering.scalar_quantities import ScalarBuffer
from viewer.rig.arrays import Floats
from viewer.rig.kinematics import is_rigid, posed_skeleton
from viewer.rig.pose import Pose
from viewer.rig.shape import shaped
from viewer.rig.skin import bind_positions
from viewer.rig.skinning import METHODS, Skinning

_BYTES_PER_VERTEX = 24  # a position and a normal, of three float32 each


class PosedMesh:
    """One actor's posed vertices.

    ``posed``: a row for every split vertex: position relative to ``center``, (3,) in figure space,
    and unit normal. Some framebuffer must be bound when ``update`` runs.
    """

    def __init__(
        self, context: moderngl.Context, programs: Programs, mesh: MeshBuffers, way: str = ""
    ) -> None:
        self.context, self.programs, self.mesh = context, programs, mesh
        self._owner = Owner()
        size = _BYTES_PER_VERTEX * mesh.n_vertices
        posed = checked(
            context, context.buffer(reserve=size), f"a posed mesh of {size / 1e6:.1f} MB"
        )
        self.posed = self._owner.keep(posed)
        self.center: Floats = mesh.center
        skin = mesh.figure.skin
        self._n_joints = skin.n_joints if skin else 0
        with self._owner.guard():
            self._palette = self._owner.keep(matrix_texture(context, self._n_joints))
            self._rest = self._owner.keep(RestBuffers(context, mesh, way))
        self._rigid: moderngl.Texture | None = None
        self.back_faces = BackFaces(mesh)
        self._looks = _MaterialLooks(mesh)
        self.scalars = self._owner.keep(ScalarBuffer(context, mesh))
        self._arrays = self._owner.keep(VertexArrays(context))
        self._key: tuple[object, ...] | None = None
        self._is_affine = self._is_mirrored = False
        self.hidden_parts: frozenset[int] = frozenset()
        self.n_updates = 0

    def index_set(self, options: DisplayOptions, as_listed: bool = False) -> IndexSet:
        """Return the drawn triangles; see ``MeshBuffers.index_set``."""
        hidden = options.hidden_parts
        found = self.mesh.index_set(options.reduced, hidden, as_listed, self.hidden_parts)
        return self._looks.of(found)

    def update(self, pose: Pose | None, skinning: Skinning | str = "lbs") -> None:
        """Skin the mesh if pose (None: the bind pose) or method changed since the last call."""
        self._looks.update(pose)
        how = Skinning(skinning) if isinstance(skinning, str) else skinning
        attached = self.mesh.figure.is_attached and pose is not None
        key = (*skinning_options_key(how), pose.skinning_key) if attached and pose else ("binding",)
        if key == self._key:
            return
        self.center, self._is_mirrored = self.mesh.center, False
        if attached and pose is not None:
            self.upload(pose, how)
        skin = self.mesh.skin(how)
        # Rigid joints, by far the most common, use a cheaper program without scale and shear.
        affine = attached and self._is_affine
        program = self.programs.feedback("skin", how.method, ("v_position", "v_normal"), affine)
        array = self._arrays.get(
            program,
            lambda: self._rest.attributes(skin, attached),
            key=(id(skin), attached and id(self._rest.positions)),
        )
        values = {
            "u_attached": attached,
            "u_rest_shift": tuple(self.mesh.center - self.center),
            "u_center": tuple(self.center),
            "u_blend_factor": -1.0 if how.blend_factor is None else how.blend_factor,
            "u_n_offsets": self._rest.n_offsets if attached else 0,
            "u_n_sources": len(self.mesh.copies),
            **SKINNING_SAMPLERS,
        }
        set_uniforms(program, values)
        self._palette.use(SKINNING_SAMPLERS["u_palette"])
        skin.pairs.use(SKINNING_SAMPLERS["u_pairs"])
        if self._rigid is not None:
            self._rigid.use(SKINNING_SAMPLERS["u_rigid"])
        self._rest.use()
        array.transform(self.posed, mode=moderngl.POINTS, vertices=self.mesh.n_vertices)
        shape = shaped(self.mesh.figure, pose.shape_weights) if attached and pose else None
        self.back_faces.update(shape or self.mesh.figure, pose if attached else None, how)
        self._key = key
        self.n_updates += 1

    def upload(self, pose: Pose, how: Skinning) -> None:
        """Upload the data of a pose without skinning: the CPU part of ``update``."""
        figure = shaped(self.mesh.figure, pose.shape_weights)
        self._rest.update(figure, pose, how)
        skeleton, skin = figure.skeleton, figure.skin
        assert skeleton is not None and skin is not None  # checked by the caller
        fractions = self.mesh.skin(how).joint_fractions
        palette = posed_skeleton(skeleton, pose).palette(skin).copy()
        self._is_affine = not is_rigid(palette)
        if self._is_affine:
            signs = np.sign(np.linalg.det(palette[:, :3, :3]))
            self._is_mirrored = bool(fractions @ signs < 0.0)
        # T(-center') M T(center), so that the shader's inputs and outputs are small.
        palette[:, :3, 3] += palette[:, :3, :3] @ self.mesh.center
        if fractions.any():
            self.center = fractions @ palette[:, :3, 3]
        palette[:, :3, 3] -= self.center
        method = METHODS[how.method]
        if method.uses_matrices:
            write_matrices(self._palette, palette)
        if method.uses_quaternions:
            from viewer.rig.skinning.dqs import split_palette

            if self._rigid is None:
                self._rigid = self._owner.keep(rigid_texture(self.context, self._n_joints))
            centers = bind_positions(skin) - self.mesh.center
            write_rigid(self._rigid, *split_palette(palette, centers))

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


def skinning_options_key(how: Skinning) -> tuple[object, ...]:
    """Return a key that identifies skinning settings."""
    return (how.method, how.blend_factor, how.max_influences, how.normalize, how.correctives)
