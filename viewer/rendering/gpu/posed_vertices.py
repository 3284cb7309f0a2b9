"""Posed vertices of actors that share a figure and a shape, skinned by transform feedback.

One instanced draw of a vertex shader skins all actors whose pose changed, once. All passes draw its
output, so shadows, shading, wireframe and picking need no second skinning.
"""

from __future__ import annotations

from itertools import pairwise

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.phrases import file_size
from viewer.rendering.gpu.context import storage_limit
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.rest_buffers import RestBuffers
from viewer.rendering.gpu.upload import (
    checked,
    float32,
    matrix_texture,
    rigid_texture,
    write_stacked,
)
from viewer.rendering.gpu.vertex_arrays import VertexArrays
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.figure import Figure
from viewer.rigs.kinematics import are_rigid
from viewer.rigs.skin import bind_positions
from viewer.rigs.skinning import METHODS, Skinning

_SAMPLERS = {"u_palette": 0, "u_pairs": 1, "u_rigid": 2, "u_places": 3}
BYTES_PER_VERTEX = 24
"""A position and a normal, of three float32 each."""

# Maximum number of actors in one upload. The matrices of so many fit into the processor's cache,
# and the memory of one upload serves the next; larger arrays cost a page fault per 4 KB and frame.
_MOST_TOGETHER = 256
_MOST_RESTS = 64 << 20  # maximum size of the rest positions with correctives in one upload, bytes


class PosedVertices:
    """Posed vertices of a number of actors.

    ``posed``: R rows for every actor, one per split vertex: position relative to the actor's
    centre, and unit normal. ``centers``: (A, 3) in figure space. A framebuffer must be bound while
    skinning.
    """

    def __init__(self, context: moderngl.Context, programs: Programs, mesh: MeshBuffers) -> None:
        self.context, self.programs, self.mesh = context, programs, mesh
        skin = mesh.figure.skin
        self._n_joints = skin.n_joints if skin else 0
        self.size = BYTES_PER_VERTEX * mesh.n_vertices
        self._own: moderngl.Buffer | None = None
        self._shared: SharedVertices | None = None
        self.centers: Floats = np.zeros((0, 3))
        self._textures: dict[str, moderngl.Texture] = {}
        self.together = max(1, min(_MOST_TOGETHER, _MOST_RESTS // mesh.positions.size))
        """Maximum number of actors that ``skin`` accepts."""
        self._room = 0  # number of actors in the textures
        self._rest = RestBuffers(context, programs, mesh)
        self._arrays = VertexArrays(context)

    def reserve(self, count: int, shared: SharedVertices | None = None) -> None:
        """Make room for actors, in a shared buffer if given; it may lose the vertices of all."""
        if shared is not None:
            shared.reserve(count * self.size)
        if (self._shared, self._has_room(count)) == (shared, True):
            return
        # Half more, so that adding actors rarely reallocates, if shaders can read so much at once.
        most = storage_limit(self.context) // self.size if self.size else 0
        room = max(count, min(len(self.centers) * 3 // 2, most))
        self._free_own()
        self._shared, self.centers = shared, np.zeros((0, 3))
        if shared is None:
            what = f"posed vertices of {file_size(room * self.size)}"
            self._own = checked(self.context, self.context.buffer(reserve=room * self.size), what)
        self.centers = np.tile(self.mesh.center, (room, 1))
        self._free_textures()
        self._room = min(room, self.together)
        for name in ("u_palette", "u_places"):
            self._texture(name)

    def _has_room(self, count: int) -> bool:
        return count <= len(self.centers) and (self._own is None) == (self._shared is not None)

    @property
    def posed(self) -> moderngl.Buffer:
        """The posed vertices; room was reserved for them."""
        buffer = self._own if self._shared is None else self._shared.buffer
        assert buffer is not None  # reserved
        return buffer

    @property
    def are_lost(self) -> bool:
        """Whether other actors were skinned into the shared buffer since."""
        return self._shared is not None and self._shared.holder is not self

    def skin(
        self,
        rows: NDArray[np.intp],
        figure: Figure,
        how: Skinning,
        matrices: Floats,
        weights: Floats | None,
        sizes: Floats,
    ) -> Bools:
        """Skin at most ``together`` actors of one shaped figure; return which are rigid.

        ``rows``: (C,) ascending. ``matrices``: (C, J, 4, 4) skinning matrices, bind to posed; they
        are changed. ``weights``: (C, P) of the pose correctives, if used. ``sizes``:
        ``palette_sizes`` of the matrices.
        """
        self._rest.reshape(figure)
        self.centers[rows] = self._move_origins(how, matrices)
        rigid = np.broadcast_to(are_rigid(sizes), len(rows))
        self._upload(figure, how, matrices, self.centers[rows])
        self._rest.correct(weights)
        self._run(rows, how, not rigid.all())
        return rigid

    def unpose(self) -> None:
        """Store the bind pose as the vertices of the first actor."""
        self._rest.correct(None)
        self.centers[0] = self.mesh.center
        places = np.zeros((3, 4), "f4")
        places[0, :3] = self.mesh.center
        write_stacked(self._texture("u_places"), places)
        self._run(np.zeros(1, np.intp), Skinning(), False, attached=False)

    def _move_origins(self, how: Skinning, matrices: Floats) -> Floats:
        """Turn M into T(-posed centre) M T(rest centre), in place; return posed centres (C, 3)."""
        # The posed centre is the mean motion of the figure, by its weights: what is left is small.
        linear, places = matrices[..., :3, :3], matrices[..., :3, 3]
        places += np.einsum("ajik,k->aji", linear, self.mesh.center)
        fractions = self.mesh.skin(how).joint_fractions
        centers: Floats = np.broadcast_to(self.mesh.center, (len(matrices), 3))
        if fractions.any():
            centers = np.einsum("j,aji->ai", fractions, places)
        places -= centers[:, None]
        return centers

    def _upload(self, figure: Figure, how: Skinning, matrices: Floats, centers: Floats) -> None:
        """Upload joint matrices and centres of some actors, the only data that a pose changes."""
        method, count = METHODS[how.method], len(matrices)
        if method.uses_matrices:
            write_stacked(self._texture("u_palette"), float32(matrices[..., :3, :]))
        if method.uses_quaternions:
            from viewer.rigs.skinning.dqs import split_palette

            binds = bind_positions(figure.require_skin()) - self.mesh.center
            flat = matrices.reshape(-1, 4, 4)
            duals, stretches = split_palette(flat, np.tile(binds, (count, 1)))
            texels = np.concatenate([duals.reshape(-1, 2, 4), stretches], axis=1)
            write_stacked(self._texture("u_rigid"), float32(texels))
        places = np.zeros((count, 3, 4), "f4")
        places[:, 0, :3], places[:, 1, :3] = centers, self.mesh.center - centers
        write_stacked(self._texture("u_places"), places)

    def _texture(self, name: str) -> moderngl.Texture:
        if name not in self._textures:
            make = rigid_texture if name == "u_rigid" else matrix_texture
            each = 1 if name == "u_places" else self._n_joints
            self._textures[name] = make(self.context, self._room * each)
        return self._textures[name]

    def _run(
        self, rows: NDArray[np.intp], how: Skinning, affine: bool, attached: bool = True
    ) -> None:
        """Skin actors whose data are uploaded, those with consecutive rows at once."""
        rest, skin = self._rest, self.mesh.skin(how)
        # Rigid joints, by far the most common, use a cheaper program without scale and shear.
        macros = (("AFFINE_PALETTE", affine), ("REST_ROWS", attached and rest.has_rows))
        used = tuple(macro for macro, is_used in macros if is_used)
        program = self.programs.feedback("skin", how.method, ("v_position", "v_normal"), used)
        values = {
            "u_attached": attached,
            "u_n_joints": self._n_joints,
            "u_n_vertices": self.mesh.n_vertices,
            "u_blend_factor": -1.0 if how.blend_factor is None else how.blend_factor,
            **_SAMPLERS,
        }
        set_uniforms(program, values)
        for name, texture in self._textures.items():
            texture.use(_SAMPLERS[name])
        skin.pairs.use(_SAMPLERS["u_pairs"])
        rest.use()
        key = id(skin), attached, rest.version
        array = self._arrays.get(program, lambda: rest.attributes(skin, attached), key=key)
        breaks = np.flatnonzero(np.diff(rows) != 1) + 1
        for first, last in pairwise((0, *breaks.tolist(), len(rows))):
            set_uniforms(program, {"u_first": first})
            array.transform(
                self.posed,
                mode=moderngl.POINTS,
                vertices=self.mesh.n_vertices,
                instances=last - first,
                buffer_offset=int(rows[first]) * self.size,
            )
        if self._shared is not None:
            self._shared.holder = self

    def _free_textures(self) -> None:
        for texture in self._textures.values():
            texture.release()
        self._textures.clear()

    def release(self) -> None:
        """Free everything."""
        self._arrays.release()
        self._rest.release()
        self._free_textures()
        self._free_own()

    def _free_own(self) -> None:
        if self._own is not None:
            self._own.release()
        self._own = None


class SharedVertices:
    """A buffer for groups of actors that are skinned anew for each draw, to save memory."""

    def __init__(self, context: moderngl.Context) -> None:
        self.context = context
        self.buffer: moderngl.Buffer | None = None
        self.holder: PosedVertices | None = None

    def reserve(self, size: int) -> None:
        """Make room for the vertices of one group, in bytes."""
        if self.buffer is None or self.buffer.size < size:
            self.release()
            what = f"posed vertices of {file_size(size)}"
            self.buffer = checked(self.context, self.context.buffer(reserve=size), what)

    def release(self) -> None:
        """Free the buffer."""
        if self.buffer is not None:
            self.buffer.release()
        self.buffer = self.holder = None


def skinning_options_key(how: Skinning) -> tuple[object, ...]:
    """Return a key that identifies skinning settings."""
    return (how.method, how.blend_factor, how.max_influences, how.normalize, how.correctives)
