"""Instanced drawing of actors that share a figure and a shape.

No posed vertices are stored: the vertex shader skins each instance with its own row of matrices.
With software rendering, this is faster than writing posed vertices and reading them back
(``tests/bench/bench_instances.py``). Every draw repeats the skinning, so views that draw a mesh
several times use the posed buffers of single actors instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.rendering.gpu.index_sets import IndexSet
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.posed_mesh import skinning_options_key
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.rest_buffers import SKINNING_SAMPLERS, RestBuffers, SummedOffsets
from viewer.rendering.gpu.upload import (
    as_uniform,
    float32,
    matrix_texture,
    reserved,
    rigid_texture,
    write_stacked,
)
from viewer.rendering.gpu.vertex_arrays import Source, VertexArrays
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.material_runs import Prepare, draw_runs, draw_shapes
from viewer.rendering.passes.mesh_pass import (
    SKIN_COLOR,
    fragment_macros,
    has_tints,
    set_surface,
    shading_of,
)
from viewer.rendering.view import View, set_lights
from viewer.rig.arrays import Bools, Floats
from viewer.rig.figure import Figure
from viewer.rig.kinematics import is_rigid, skinning_matrices
from viewer.rig.memo import NumberKey
from viewer.rig.pose import Pose
from viewer.rig.scene import Actor
from viewer.rig.shape import pose_weights, shaped
from viewer.rig.skin import bind_positions
from viewer.rig.skinning import METHODS, Skinning

FEWEST = 8
"""Minimum number of actors to draw as instances; see ``instance_groups``."""

_PER_INSTANCE = {
    "in_model_x": 4,
    "in_model_y": 4,
    "in_model_z": 4,
    "in_actor_color": 3,
    "in_rest_shift": 3,
    "in_center": 3,
}
_FLOATS = sum(_PER_INSTANCE.values())
_LAYOUT = " ".join(f"{count}f4" for count in _PER_INSTANCE.values())


def instance_groups(actors: Sequence[Actor], options: DisplayOptions) -> list[list[Actor]]:
    """Return groups, of at least ``FEWEST`` actors of one figure and shape, drawn as instances."""
    # Posed buffers are used instead for small groups, so that camera moves need no re-skinning, and
    # for translucent actors, actors with hidden parts, outlines or changed materials, and meshes
    # that are drawn several times per frame, in the bind pose or coloured by a scalar. If back
    # faces are culled, either all or none of the actors of a group are mirrored, and actors with
    # mirrored joints are drawn individually.
    if options.show == "binding" or options.shading == "scalar":
        return []
    if options.wireframe or options.normals:
        return []
    groups: dict[tuple[int, bytes, bool], list[Actor]] = {}
    for actor in actors:
        pose, is_opaque = actor.pose, options.opacity * actor.opacity == 1.0
        is_plain = is_opaque and not actor.hidden_parts and not _has_own_look(actor)
        if pose is None or not actor.figure.is_attached or not is_plain:
            continue
        is_mirrored = False
        materials = actor.figure.require_mesh().materials
        if options.cull or not all(material.double_sided for material in materials):
            if (pose.scales < 0.0).any():
                continue
            sign = np.linalg.det(actor.placement[:3, :3]) * pose.figure_scale
            is_mirrored = bool(sign < 0.0)
        key = id(actor.figure), pose.shape_weights.tobytes(), is_mirrored
        groups.setdefault(key, []).append(actor)
    return [group for group in groups.values() if len(group) >= FEWEST]


def _has_own_look(actor: Actor) -> bool:
    """Return whether outlines are drawn, or expressions may change materials."""
    shapes, mesh, pose = actor.figure.blend_shapes, actor.figure.require_mesh(), actor.pose
    if any(material.outline is not None for material in mesh.materials):
        return True
    has_binds = shapes is not None and shapes.material_binds is not None
    return has_binds and pose is not None and bool(pose.shape_weights.any())


def draw_instances(
    programs: Programs,
    instances: InstanceBuffers,
    actors: Sequence[Actor],
    view: View,
    options: DisplayOptions,
    blended: bool = False,
) -> None:
    """Draw the opaque or the blended surfaces of actors that share a mesh."""
    program = programs.drawing(
        "instance",
        shading_of(instances.mesh, options),
        "mesh",
        skin=instances.method,
        affine=instances.is_affine,
        summed=instances.has_sums,
        materials=instances.mesh.has_materials,
        effects=fragment_macros(instances.mesh, view, options),
    )
    instances.place(actors, view)
    instances.use(program, view)
    set_lights(program, view, options.lights)
    set_surface(program, instances.mesh, options)
    indices = instances.mesh.index_set(options.reduced, options.hidden_parts)
    array = instances.array(program, indices)
    draw_runs(array, indices, options, instances.count, blended, instances.is_mirrored)


def draw_instance_shapes(
    programs: Programs,
    instances: InstanceBuffers,
    actors: Sequence[Actor],
    view: View,
    options: DisplayOptions,
    fragment: str,
    prepare: Prepare,
) -> None:
    """Draw instanced surfaces with a fragment shader that shows no colours."""
    program = programs.drawing(
        "instance",
        fragment=fragment,
        skin=instances.method,
        affine=instances.is_affine,
        summed=instances.has_sums,
        materials=instances.mesh.has_materials,
    )
    instances.place(actors, view)
    instances.use(program, view)
    set_uniforms(program, {"u_has_tint": has_tints(instances.mesh, options)})
    indices = instances.mesh.index_set(options.reduced, options.hidden_parts)
    array, mirrored = instances.array(program, indices), instances.is_mirrored
    draw_shapes(array, indices, options, fragment, prepare, instances.count, mirrored)


class InstanceBuffers:
    """Matrices, placements and colours of actors that share a figure and a shape."""

    # If faces are culled, all placements are reflections, or none.

    def __init__(self, context: moderngl.Context, mesh: MeshBuffers, way: str = "") -> None:
        self.context, self.mesh = context, mesh
        self.count = self.n_updates = 0
        self.is_mirrored = False
        self._n_joints = mesh.figure.require_skin().n_joints
        self._rest = RestBuffers(context, mesh, way)
        self._offsets = SummedOffsets(context, mesh, self._rest.way)
        self._how = Skinning()
        self._skinning_key: tuple[object, ...] = ()
        self._keys: list[NumberKey] = []
        self._centers: Floats = np.zeros((0, 3))
        self._is_rigid: Bools = np.ones(0, dtype=np.bool_)
        self._rows: NDArray[np.float32] = np.zeros((0, self._n_joints, 3, 4), "f4")
        self._rigid_rows: NDArray[np.float32] = np.zeros((0, self._n_joints, 5, 4), "f4")
        self._palette: moderngl.Texture | None = None
        self._rigid: moderngl.Texture | None = None
        self._instances: moderngl.Buffer | None = None
        self._arrays = VertexArrays(context)

    def update(self, poses: Sequence[Pose], how: Skinning) -> None:
        """Upload the matrices of poses that changed."""
        figure = shaped(self.mesh.figure, poses[0].shape_weights)
        skinning_key = (*skinning_options_key(how), poses[0].shape_weights.tobytes())
        keys = [pose.skinning_key for pose in poses]
        old = self._keys if skinning_key == self._skinning_key else []
        changed = [row for row, key in enumerate(keys) if row >= len(old) or key != old[row]]
        self._how, self._skinning_key, self.count = how, skinning_key, len(poses)
        if changed:
            self._keys = []  # after an error, everything is uploaded again
            self._reserve(len(poses))
            # Sums of pose correctives differ between actors and are uploaded separately.
            self._rest.update(figure, poses[0], replace(how, correctives=False))
            self._write(figure, [poses[row] for row in changed], np.array(changed))
            self.n_updates += 1
        self._keys = keys

    def _reserve(self, count: int) -> None:
        """Reserve space; textures grow by half, so that adding actors rarely reallocates."""
        if self._palette is not None and count <= len(self._rows):
            return
        room = max(count, len(self._rows) * 3 // 2)
        self._release_textures()
        self._palette = matrix_texture(self.context, room * self._n_joints)
        self._instances = reserved(self.context, 4 * _FLOATS * room, "instances")
        more = room - len(self._rows)
        empty = np.zeros((more, self._n_joints, 5, 4), "f4")
        self._rows = np.concatenate([self._rows, empty[:, :, :3]])
        self._rigid_rows = np.concatenate([self._rigid_rows, empty])
        self._centers = np.concatenate([self._centers, np.zeros((more, 3))])
        self._is_rigid = np.concatenate([self._is_rigid, np.ones(more, dtype=np.bool_)])

    def _write(self, figure: Figure, poses: list[Pose], rows: NDArray[np.intp]) -> None:
        """Upload T(-center') M T(center) for the poses at ``rows``; see ``PosedMesh``."""
        from viewer.rig.motion.instances import local_rotations, posed_worlds

        skeleton, skin, how = figure.require_skeleton(), figure.require_skin(), self._how
        assert self._palette is not None
        rotations = local_rotations(skeleton, poses)
        palette = skinning_matrices(posed_worlds(skeleton, poses, rotations), skin.inverse_bind)
        self._is_rigid[rows] = is_rigid(palette)
        palette[..., :3, 3] += palette[..., :3, :3] @ self.mesh.center
        fractions = self.mesh.skin(how).joint_fractions
        moved = np.einsum("j,aji->ai", fractions, palette[..., :3, 3])
        self._centers[rows] = moved if fractions.any() else self.mesh.center
        palette[..., :3, 3] -= self._centers[rows, None]
        method = METHODS[how.method]
        if method.uses_matrices:
            self._rows[rows] = palette[..., :3, :]
            write_stacked(self._palette, self._rows[: self.count])
        if method.uses_quaternions:
            from viewer.rig.skinning.dqs import split_palette

            if self._rigid is None:
                self._rigid = rigid_texture(self.context, len(self._rows) * self._n_joints)
            binds = np.tile(bind_positions(skin) - self.mesh.center, (len(poses), 1))
            duals, stretches = split_palette(palette.reshape(-1, 4, 4), binds)
            shape = (len(poses), self._n_joints)
            self._rigid_rows[rows, :, :2] = duals.reshape(*shape, 2, 4)
            self._rigid_rows[rows, :, 2:] = stretches.reshape(*shape, 3, 4)
            write_stacked(self._rigid, self._rigid_rows[: self.count])
        weights = _pose_weights(figure, poses, rotations) if how.correctives else None
        self._offsets.update(weights, rows, self.count)

    def place(self, actors: Sequence[Actor], view: View) -> None:
        """Upload the actors' placements, relative to a camera, and their colours."""
        # Products are formed in float64: large translations cancel before the conversion to
        # float32.
        from viewer.rig.motion.instances import placements

        assert self._instances is not None  # guaranteed by update
        poses = [actor.pose for actor in actors if actor.pose is not None]
        model = view.matrix @ np.stack([actor.placement for actor in actors]) @ placements(poses)
        self.is_mirrored = bool(np.linalg.det(model[0, :3, :3]) < 0.0)
        centers = self._centers[: self.count]
        model[:, :3, 3] += np.einsum("aij,aj->ai", model[:, :3, :3], centers)
        colors = np.array([actor.color or SKIN_COLOR for actor in actors])
        rows = [model[:, :3].reshape(-1, 12), colors, self.mesh.center - centers, centers]
        self._instances.write(float32(np.concatenate(rows, axis=1)))

    def use(self, program: moderngl.Program, view: View) -> None:
        """Set the uniforms and textures of ``instance.vert``."""
        skin = self.mesh.skin(self._how)
        values = {
            "u_projection": as_uniform(view.projection),
            "u_orthographic": view.camera.is_parallel,
            "u_blend_factor": -1.0 if self._how.blend_factor is None else self._how.blend_factor,
            "u_n_joints": self._n_joints,
            "u_n_offsets": self._offsets.n_listed,
            "u_n_sources": len(self.mesh.copies),
            **SKINNING_SAMPLERS,
        }
        set_uniforms(program, values)
        skin.pairs.use(SKINNING_SAMPLERS["u_pairs"])
        for texture, name in ((self._palette, "u_palette"), (self._rigid, "u_rigid")):
            if texture is not None:
                texture.use(SKINNING_SAMPLERS[name])
        self._offsets.use()

    @property
    def method(self) -> str:
        """The skinning method, a key of ``viewer.rig.skinning.METHODS``."""
        return self._how.method

    @property
    def is_affine(self) -> bool:
        """Whether joints of at least one actor scale or shear."""
        return not self._is_rigid[: self.count].all()

    @property
    def has_sums(self) -> bool:
        """Whether the pose correctives of each actor were summed before the draw."""
        return self._offsets.has_sums

    def array(
        self, program: moderngl.Program, indices: IndexSet | None = None
    ) -> moderngl.VertexArray:
        """Return the vertex array for a program; without indices, it draws single vertices."""
        mesh, skin = self.mesh, self.mesh.skin(self._how)
        listed = None if indices is None else indices.indices
        key = (id(listed), id(skin), id(self._rest.positions))

        def content() -> list[Source]:
            own = self._instances, f"{_LAYOUT}/i", *_PER_INSTANCE
            return [*self._rest.attributes(skin), *mesh.attributes(), own]

        index_buffer = None if indices is None else indices.indices
        return self._arrays.get(program, content, index_buffer, key)

    def _release_textures(self) -> None:
        self._arrays.release()
        for item in (self._palette, self._rigid, self._instances):
            if item is not None:
                item.release()
        self._palette = self._rigid = self._instances = None

    def release(self) -> None:
        """Free the buffers of these actors."""
        self._release_textures()
        self._offsets.release()
        self._rest.release()


def _pose_weights(figure: Figure, poses: Sequence[Pose], rotations: Floats) -> Floats | None:
    """Return the pose correctives' weights, (C, P), for local rotations (C, J, 3, 3), if any."""
    correctives, skeleton = figure.correctives, figure.require_skeleton()
    if correctives is None:
        return None
    if correctives.feature is None:
        return (rotations[:, 1:] - np.eye(3)).reshape(len(poses), -1)
    return np.stack([pose_weights(correctives, skeleton, pose) for pose in poses])
