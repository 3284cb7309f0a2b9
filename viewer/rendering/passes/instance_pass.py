"""Instanced drawing of actors that share a figure and a shape: one draw for all of them.

Their posed vertices are in one storage buffer. Actors that did not change are not skinned again,
and only changed placements are uploaded: the camera is subtracted in the vertex shader.
"""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
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
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.figure import Figure
from viewer.rigs.kinematics import palette_sizes, skinning_matrices
from viewer.rigs.motion.instances import PoseTable, placements, worlds
from viewer.rigs.pose import Pose, local_rotations
from viewer.rigs.scene import Actor
from viewer.rigs.shape import pose_weights, shaped
from viewer.rigs.skinning import Skinning

FEWEST = 8
"""Minimum number of actors to draw as instances; see ``instance_groups``."""

_PER_INSTANCE = {
    "in_model_x": 3,
    "in_model_y": 3,
    "in_model_z": 3,
    "in_place": 3,
    "in_place_rest": 3,
    "in_actor_color": 3,
}
_FLOATS = sum(_PER_INSTANCE.values())
_LAYOUT = " ".join(f"{count}f4" for count in _PER_INSTANCE.values())


def instance_groups(actors: Sequence[Actor], options: DisplayOptions) -> list[list[Actor]]:
    """Return groups, of at least ``FEWEST`` actors of one figure and shape, drawn as instances."""
    # Translucent actors, actors with hidden parts, outlines or changed materials are drawn one by
    # one, and so is everything in views that draw lines or values of single vertices.
    if options.show == "binding" or options.shading == "scalar":
        return []
    if options.wireframe or options.normals:
        return []
    kinds: dict[int, _Kind] = {}
    groups: dict[tuple[int, bytes], list[Actor]] = {}
    for actor in actors:
        pose, figure = actor.pose, actor.figure
        if pose is None or actor.hidden_parts or options.opacity * actor.opacity != 1.0:
            continue
        kind = kinds.get(id(figure))
        if kind is None:
            kind = kinds[id(figure)] = _kind_of(figure)
        if not kind.is_plain or (kind.has_binds and pose.shape_weights.any()):
            continue
        groups.setdefault((id(figure), pose.shape_weights.tobytes()), []).append(actor)
    found = [
        side
        for (figure, _), group in groups.items()
        if len(group) >= FEWEST
        for side in _by_side(group, options.cull or kinds[figure].is_culled)
    ]
    return [group for group in found if len(group) >= FEWEST]


@dataclass(frozen=True, slots=True)
class _Kind:
    """What decides whether actors of a figure are drawn as instances."""

    is_plain: bool
    """Whether the figure is skinned, and no material has an outline."""
    has_binds: bool
    """Whether expressions may change materials."""
    is_culled: bool
    """Whether back faces of a material are not drawn."""


def _kind_of(figure: Figure) -> _Kind:
    shapes, materials = figure.blend_shapes, figure.require_mesh().materials
    has_outline = any(material.outline is not None for material in materials)
    return _Kind(
        figure.is_attached and not has_outline,
        shapes is not None and shapes.material_binds is not None,
        not all(material.double_sided for material in materials),
    )


def _by_side(group: list[Actor], is_culled: bool) -> list[list[Actor]]:
    """Split actors whose placements reflect from the others: their triangles are clockwise."""
    poses = [actor.require_pose() for actor in group]
    if is_culled:
        # Joints that reflect turn only a part of the triangles: such actors are drawn alone.
        scales = np.concatenate([pose.scales for pose in poses]).reshape(len(group), -1)
        if (scales < 0.0).any():
            reflects = (scales < 0.0).any(axis=1)
            group = [group[row] for row in np.flatnonzero(~reflects).tolist()]
            poses = [actor.require_pose() for actor in group]
            if not group:
                return []
    linear = _stacked(group)[:, :3, :3]
    signs = np.linalg.det(linear) * np.array([pose.figure_scale for pose in poses]) < 0.0
    if not signs.any():
        return [group]
    sides = (np.flatnonzero(signs == side).tolist() for side in (False, True))
    return [[group[row] for row in side] for side in sides]


def _stacked(actors: Sequence[Actor]) -> Floats:
    """Return the actors' placements: (A, 4, 4)."""
    return np.concatenate([actor.placement for actor in actors]).reshape(-1, 4, 4)


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
) -> None:
    """Draw instanced surfaces with a fragment shader that shows no colours."""
    materials = instances.mesh.has_materials
    program = programs.drawing("mesh", fragment=fragment, materials=materials, instanced=True)
    instances.use(program, view)
    set_uniforms(program, {"u_has_tint": has_tints(instances.mesh, options)})
    indices = instances.mesh.index_set(options.reduced, options.hidden_parts)
    array, mirrored = instances.array(program, indices), instances.is_mirrored
    draw_shapes(array, indices, options, fragment, prepare, instances.count, mirrored)


class InstanceBuffers:
    """Posed vertices, placements and colours of actors that share a figure and a shape.

    Either all placements reflect, ``is_mirrored``, or none does.
    """

    def __init__(self, context: moderngl.Context, programs: Programs, mesh: MeshBuffers) -> None:
        self.context, self.mesh = context, mesh
        self.count = self.n_updates = 0
        self.is_mirrored = False
        self.vertices = PosedVertices(context, programs, mesh)
        self._table = PoseTable()
        self._key: tuple[object, ...] = ()
        self._poses: Sequence[Pose] = ()
        self._how = Skinning()
        self._figure = mesh.figure
        self._spheres: Floats = np.zeros((0, 0, 4))
        self._has_one_side: Bools = np.zeros(0, dtype=np.bool_)
        self._models: Floats = np.zeros((0, 4, 4))
        self._placed: tuple[object, ...] = ()
        self._bounds: Bounds | None = None
        self._instances: moderngl.Buffer | None = None
        self._arrays = VertexArrays(context)

    def update(self, actors: Sequence[Actor], how: Skinning) -> None:
        """Skin the actors whose pose changed, and upload placements that changed."""
        poses = [actor.require_pose() for actor in actors]
        changed = self._table.update(poses)
        key = (*skinning_options_key(how), poses[0].shape_weights.tobytes())
        self.count, self._poses, self._how = len(poses), poses, how
        if key != self._key:
            changed[:] = True
        if changed.any():
            self._key = ()  # after an error, all actors are skinned again
            self._skin(np.flatnonzero(changed | self.vertices.are_lost))
            self.n_updates += 1
            self._key = key
        self._place(actors, poses)

    def _skin(self, rows: NDArray[np.intp]) -> None:
        poses, how = self._poses, self._how
        assert self._table.arrays is not None  # just updated
        figure = shaped(self.mesh.figure, poses[0].shape_weights)
        skeleton, skin = figure.require_skeleton(), figure.require_skin()
        arrays = self._table.arrays.rows(rows)
        rotations = local_rotations(skeleton, arrays.rotations, arrays.dofs)
        matrices = skinning_matrices(worlds(skeleton, arrays, rotations), skin.inverse_bind)
        sizes = palette_sizes(skin, arrays.scales, matrices)
        spheres = skin_spheres(figure, matrices, sizes)
        if self._spheres.shape[:2] != (self.count, spheres.shape[1]):
            self._spheres = np.zeros((4, spheres.shape[1], self.count)).T
            self._has_one_side = np.zeros(self.count, dtype=np.bool_)
        self._spheres[rows] = spheres
        weights = None
        if figure.correctives is not None and how.correctives:
            chosen = [poses[row] for row in rows.tolist()]
            weights = _pose_weights(figure, chosen, rotations)
        rigid = self.vertices.skin(rows, figure, how, matrices, weights, sizes)
        self._has_one_side[rows] = rigid | have_one_side(matrices) if not rigid.all() else True
        self._figure = figure

    def _place(self, actors: Sequence[Actor], poses: Sequence[Pose]) -> None:
        """Upload the actors' placements and colours if any changed, or the posed centres did."""
        models = _stacked(actors) @ placements(poses)
        colors = np.array([actor.color or SKIN_COLOR for actor in actors])
        state = models.tobytes(), colors.tobytes(), self.n_updates
        if state == self._placed:
            return
        self._placed = ()
        linear = models[:, :3, :3]
        self.is_mirrored = bool(np.linalg.det(linear[0]) < 0.0)
        centers = self.vertices.centers[: self.count]
        places = models[:, :3, 3] + (linear @ centers[..., None])[..., 0]
        rows = [linear.reshape(-1, 9), *_two_floats(places), colors]
        data = float32(np.concatenate(rows, axis=1))
        if self._instances is None or self._instances.size < data.nbytes:
            self._arrays.release()
            if self._instances is not None:
                self._instances.release()
            self._instances = None
            self._instances = reserved(self.context, 3 * data.nbytes // 2, "instances")
        self._instances.write(data)
        self._models, self._bounds, self._placed = models, None, state

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
