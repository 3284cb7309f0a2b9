"""Instanced drawing of actors that share a figure and a shape: one draw for all of them.

Their posed vertices are in one storage buffer. Actors that did not change are not skinned again,
and only changed placements are uploaded: the camera is subtracted in the vertex shader.
"""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.rendering.gpu.back_faces import are_before, have_one_side, is_together
from viewer.rendering.gpu.index_sets import IndexSet
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.posed_vertices import PosedVertices, skinning_options_key
from viewer.rendering.gpu.program import POSED_BINDING, Programs, set_uniforms
from viewer.rendering.gpu.upload import as_uniform, float32, reserved
from viewer.rendering.gpu.vertex_arrays import Source, VertexArrays
from viewer.rendering.joint_spheres import (
    Bounds,
    bounds_of,
    moved_spheres,
    skin_spheres,
    stretch_bounds,
)
from viewer.rendering.lineup import Group, Rows
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
from viewer.rigs.arrays import Bools, Floats, span
from viewer.rigs.figure import Figure
from viewer.rigs.kinematics import palette_sizes, skinning_matrices
from viewer.rigs.motion.instances import worlds
from viewer.rigs.pose import Pose, local_rotations
from viewer.rigs.shape import pose_weights, shaped
from viewer.rigs.skinning import Skinning

_PER_INSTANCE = {
    "in_model_x": 3,
    "in_model_y": 3,
    "in_model_z": 3,
    "in_place": 3,
    "in_place_rest": 3,
    "in_actor_color": 3,
    "in_actor_opacity": 1,
}
_FLOATS = sum(_PER_INSTANCE.values())
_LAYOUT = " ".join(f"{count}f4" for count in _PER_INSTANCE.values())


def draw_instances(
    programs: Programs,
    instances: InstanceBuffers,
    view: View,
    options: DisplayOptions,
    blended: bool = False,
) -> None:
    """Draw the opaque or the blended surfaces of actors that share a mesh."""
    program = programs.drawing(
        "mesh",
        shading_of(instances.mesh, options),
        materials=instances.mesh.has_materials,
        instanced=True,
        effects=fragment_macros(instances.mesh, view, options),
    )
    instances.use(program, view)
    set_lights(program, view, options.lights)
    set_surface(program, instances.mesh, options)
    indices = instances.mesh.index_set(options.reduced, options.hidden_parts)
    array, count = instances.array(program, indices), instances.count
    # Hidden parts may reveal back faces anywhere.
    is_whole = not (blended or options.hidden_parts or options.reduced)
    backs = () if is_whole and instances.hides_backs(view, options.skinning) else None
    draw_runs(array, indices, options, count, blended, instances.is_mirrored, backs)


def draw_instance_shapes(
    programs: Programs,
    instances: InstanceBuffers,
    view: View,
    options: DisplayOptions,
    fragment: str,
    prepare: Prepare,
    count: int,
) -> None:
    """Draw the first ``count`` instances with a fragment shader that shows no colours."""
    materials = instances.mesh.has_materials
    program = programs.drawing("mesh", fragment=fragment, materials=materials, instanced=True)
    instances.use(program, view)
    set_uniforms(program, {"u_has_tint": has_tints(instances.mesh, options)})
    indices = instances.mesh.index_set(options.reduced, options.hidden_parts)
    array, mirrored = instances.array(program, indices), instances.is_mirrored
    draw_shapes(array, indices, options, fragment, prepare, count, mirrored)


class InstanceBuffers:
    """Posed vertices, placements, colours and opacities of actors of one figure and shape.

    Either all placements reflect, ``is_mirrored``, or none does.
    """

    def __init__(self, context: moderngl.Context, programs: Programs, mesh: MeshBuffers) -> None:
        self.context, self.mesh = context, mesh
        self.count = self.n_updates = 0
        self.is_mirrored = False
        self.vertices = PosedVertices(context, programs, mesh)
        self._state: tuple[object, ...] = ()
        self._versions: NDArray[np.int64] = np.zeros(0, np.int64)  # of the skinned poses
        self._group: Group
        self._how = Skinning()
        self._figure = mesh.figure
        self._spheres: Floats = np.zeros((0, 0, 4))
        self._has_one_side: Bools = np.zeros(0, dtype=np.bool_)
        self._models: Floats = np.zeros((0, 4, 4))
        self._bounds: Bounds | None = None
        self._instances: moderngl.Buffer | None = None
        self._arrays = VertexArrays(context)

    def update(self, group: Group, how: Skinning) -> None:
        """Skin the actors whose pose changed, and upload placements that changed."""
        crowd, options = group.crowd, skinning_options_key(how)
        state = group, options, crowd.version, crowd.placement_version
        if state == self._state:
            return
        versions = crowd.versions[group.rows]
        changed = np.ones(len(versions), dtype=np.bool_)
        if self._state[:2] == (group, options):
            changed = versions != self._versions
        self._state = ()  # after an error, all actors are skinned again
        self.count, self._group, self._how = len(versions), group, how
        if changed.any():
            self._skin(np.flatnonzero(changed | self.vertices.are_lost))
            self.n_updates += 1
        self._place()
        self._versions, self._state = versions, state

    def _skin(self, rows: Rows) -> None:
        figure = self._figure = shaped(self.mesh.figure, self._group.crowd.shape_weights)
        for start in range(0, len(rows), self.vertices.together):
            self._skin_some(rows[start : start + self.vertices.together], figure)

    def _skin_some(self, rows: Rows, figure: Figure) -> None:
        crowd, how, chosen = self._group.crowd, self._how, self._group.rows[rows]
        skeleton, skin = figure.require_skeleton(), figure.require_skin()
        arrays = crowd.arrays.rows(chosen)
        rotations = local_rotations(skeleton, arrays.rotations, arrays.dofs)
        matrices = skinning_matrices(worlds(skeleton, arrays, rotations), skin.inverse_bind)
        sizes = palette_sizes(skin, arrays.scales, matrices)
        spheres = skin_spheres(figure, matrices, sizes)
        if self._spheres.shape[:2] != (self.count, spheres.shape[1]):
            self._spheres = np.zeros((4, spheres.shape[1], self.count)).T
            self._has_one_side = np.zeros(self.count, dtype=np.bool_)
        which = span(rows)
        self._spheres[which] = spheres
        weights = None
        if figure.correctives is not None and how.correctives:
            poses = [crowd.poses[row] for row in chosen.tolist()]
            weights = _pose_weights(figure, poses, rotations)
        rigid = self.vertices.skin(rows, figure, how, matrices, weights, sizes)
        self._has_one_side[which] = rigid | have_one_side(matrices) if not rigid.all() else True

    def _place(self) -> None:
        """Upload the placements, which include the posed centres, the colours and opacities."""
        crowd, rows = self._group.crowd, self._group.rows
        models = crowd.models[rows]
        colors = np.array([crowd.colors[row] or SKIN_COLOR for row in rows.tolist()])
        linear = models[:, :3, :3]
        self.is_mirrored = bool(np.linalg.det(linear[0]) < 0.0)
        centers = self.vertices.centers[: self.count]
        places = models[:, :3, 3] + (linear @ centers[..., None])[..., 0]
        opacities = crowd.opacities[rows, None]
        parts = [linear.reshape(-1, 9), *_two_floats(places), colors, opacities]
        data = float32(np.concatenate(parts, axis=1))
        if self._instances is None or self._instances.size < data.nbytes:
            self._arrays.release()
            if self._instances is not None:
                self._instances.release()
            self._instances = None
            self._instances = reserved(self.context, 3 * data.nbytes // 2, "instances")
        self._instances.write(data)
        self._models, self._bounds = models, None

    def count_above(self, opacity: float) -> int:
        """Return the number of actors of more than an opacity; they come first."""
        return int((self._group.crowd.opacities[self._group.rows] > opacity).sum())

    def bounds(self) -> Bounds:
        """Return the bounds of the vertices in scene space."""
        if self._bounds is None:
            self._bounds = bounds_of(moved_spheres(self._models, self._spheres))
        return self._bounds

    @property
    def largest_scale(self) -> float:
        """Largest scale of a placement."""
        return float(stretch_bounds(self._models).max())

    def hides_backs(self, view: View, how: Skinning) -> bool:
        """Return whether no back face can be seen: all surfaces are closed and before the eye."""
        shell = self.mesh.shell
        if shell is None or len(shell.borders) or not is_together(shell, self._figure, how):
            return False
        bounds = self.bounds()
        if not self._has_one_side.all() or len(bounds.spheres) < self._spheres[..., 0].size:
            return False
        return are_before(bounds.spheres, view.projection @ view.matrix)

    def use(self, program: moderngl.Program, view: View) -> None:
        """Set the uniforms of ``mesh.vert`` for instances, and bind their posed vertices."""
        linear = view.matrix[:3, :3]
        origin: Floats = -np.linalg.inv(linear) @ view.matrix[:3, 3]
        eye, rest = _two_floats(origin)
        values = {
            "u_projection": as_uniform(view.projection),
            "u_orthographic": view.camera.is_parallel,
            "u_n_vertices": self.mesh.n_vertices,
            "u_view": as_uniform(linear),
            "u_eye": tuple(eye.tolist()),
            "u_eye_rest": tuple(rest.tolist()),
        }
        set_uniforms(program, values)
        if self.vertices.are_lost:
            self._skin(np.arange(self.count))
        self.vertices.posed.bind_to_storage_buffer(POSED_BINDING)

    def array(
        self, program: moderngl.Program, indices: IndexSet | None = None
    ) -> moderngl.VertexArray:
        """Return the vertex array for a program; without indices, it draws single vertices."""
        listed = None if indices is None else indices.indices

        def content() -> list[Source]:
            return [*self.mesh.attributes(), (self._instances, f"{_LAYOUT}/i", *_PER_INSTANCE)]

        return self._arrays.get(program, content, listed, (id(listed),))

    def release(self) -> None:
        """Free the buffers of these actors."""
        self._arrays.release()
        self.vertices.release()
        if self._instances is not None:
            self._instances.release()
        self._instances = None


def _two_floats(values: Floats) -> tuple[Floats, Floats]:
    """Return values as the sum of two float32: the nearest one, and what is left."""
    nearest = values.astype(np.float32).astype(np.float64)
    return nearest, values - nearest


def _pose_weights(figure: Figure, poses: Sequence[Pose], rotations: Floats) -> Floats | None:
    """Return the pose correctives' weights, (C, P), for local rotations (C, J, 3, 3), if any."""
    correctives, skeleton = figure.correctives, figure.require_skeleton()
    if correctives is None:
        return None
    if correctives.feature is None:
        return (rotations[:, 1:] - np.eye(3)).reshape(len(poses), -1)
    return np.stack([pose_weights(correctives, skeleton, pose) for pose in poses])
