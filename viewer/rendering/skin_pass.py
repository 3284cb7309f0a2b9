"""The skinning vertex shader, run once per changed pose, by transform feedback.

What it writes, the posed buffer, is what every other pass draws as a static mesh, and what the
tests read back: shading, wireframe, normals and picking cost no second skinning.
"""

from __future__ import annotations

import moderngl
import numpy as np

from viewer.rendering.context import check_errors
from viewer.rendering.mesh_buffers import MeshBuffers
from viewer.rendering.program import Programs, set_uniforms
from viewer.rendering.upload import matrix_texture, write_matrices
from viewer.rig.arrays import Floats
from viewer.rig.kinematics import skinning_matrices, world_matrices
from viewer.rig.pose import Pose, pose_key

__all__ = ["PosedMesh"]

_BYTES_PER_VERTEX = 24  # position and normal, three float32 each
_PALETTE_UNIT, _PAIRS_UNIT = 0, 1


class PosedMesh:
    """One actor's posed vertices.

    Parameters
    ----------
    context : moderngl.Context
        The context in use; some framebuffer must be bound when ``update`` runs.
    programs : Programs
        Gives the skinning program.
    mesh : MeshBuffers
        Shared with all actors of the figure.

    Attributes
    ----------
    posed : moderngl.Buffer
        V rows of position (relative to ``center``) and unit normal.
    center : (3,)
        Add it to the positions for figure space; it is part of the model matrix.
    """

    def __init__(self, context: moderngl.Context, programs: Programs, mesh: MeshBuffers) -> None:
        self.context, self.programs, self.mesh = context, programs, mesh
        size = _BYTES_PER_VERTEX * mesh.n_vertices
        self.posed = context.buffer(reserve=size)
        check_errors(context, f"a posed mesh of {size / 1e6:.1f} MB")
        self.center: Floats = mesh.center
        skin = mesh.figure.skin
        self._palette = matrix_texture(context, skin.n_joints if skin else 0)
        self._arrays: dict[str, moderngl.VertexArray] = {}
        self._key: tuple[object, ...] | None = None
        self.n_updates = 0

    def update(self, pose: Pose | None, method: str = "lbs") -> None:
        """Skin the mesh if pose or method changed since the last call.

        Parameters
        ----------
        pose : Pose or None
            None leaves the mesh in its binding space.
        method : str
            A key of ``viewer.rig.skinning.METHODS``.
        """
        attached = self.mesh.figure.is_attached and pose is not None
        key = (method, *pose_key(pose)) if attached and pose is not None else ("binding",)
        if key == self._key:
            return
        array = self._array(method)
        program = array.program
        self.center = self.mesh.center
        if attached and pose is not None:
            self._write_palette(pose)
        values = {
            "u_attached": attached,
            "u_rest_shift": tuple(self.mesh.center - self.center),
            "u_center": tuple(self.center),
            "u_palette": _PALETTE_UNIT,
            "u_pairs": _PAIRS_UNIT,
        }
        set_uniforms(program, values)
        self._palette.use(_PALETTE_UNIT)
        self.mesh.pairs.use(_PAIRS_UNIT)
        array.transform(self.posed, mode=moderngl.POINTS, vertices=self.mesh.n_vertices)
        self._key = key
        self.n_updates += 1

    def _write_palette(self, pose: Pose) -> None:
        """Upload T(-center') M T(center): the shader sees small numbers on both sides."""
        figure = self.mesh.figure
        assert figure.skeleton is not None and figure.skin is not None  # the caller looked
        palette = skinning_matrices(world_matrices(figure.skeleton, pose), figure.skin.inverse_bind)
        palette[:, :3, 3] += palette[:, :3, :3] @ self.mesh.center
        if self.mesh.joint_shares.any():
            self.center = self.mesh.joint_shares @ palette[:, :3, 3]
        palette[:, :3, 3] -= self.center
        write_matrices(self._palette, palette)

    def _array(self, method: str) -> moderngl.VertexArray:
        if method not in self._arrays:
            program = self.programs.feedback("skin", method, ("v_position", "v_normal"))
            mesh = self.mesh
            attributes = [
                (mesh.positions, "3f4", "in_position"),
                (mesh.normals, "3f4", "in_normal"),
                (mesh.influences, "2u4", "in_influences"),
                (mesh.excess, "f4", "in_excess"),
            ]
            self._arrays[method] = self.context.vertex_array(
                program, [item for item in attributes if item[2] in program]
            )
        return self._arrays[method]

    def read(self) -> tuple[Floats, Floats]:
        """Return what was drawn last: positions in figure space and normals, (V, 3) each."""
        rows = np.frombuffer(self.posed.read(), dtype="f4").reshape(-1, 6).astype(np.float64)
        return rows[:, :3] + self.center, rows[:, 3:]

    def release(self) -> None:
        """Free what belongs to this actor alone."""
        for array in self._arrays.values():
            array.release()
        self.posed.release()
        self._palette.release()
