"""Picking of actors, joints, triangles and keypoints by drawing their indices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.rendering.gpu.actor_buffers import ActorBuffers
from viewer.rendering.gpu.index_sets import MeshRun
from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.lineup import Group, has_joint_marks, placement_of, shows_mesh
from viewer.rendering.options import DisplayOptions
from viewer.rendering.overlay.joint_marks import joint_at, joint_marks_of
from viewer.rendering.passes.instance_pass import InstanceBuffers, draw_instance_shapes
from viewer.rendering.passes.joint_pass import draw_boxes, draw_joints, joint_program
from viewer.rendering.passes.mesh_pass import MeshPass
from viewer.rendering.passes.point_pass import PointPass
from viewer.rendering.view import View, in_front, set_model
from viewer.rendering.visibility import update_meshes, update_skeletons
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.scene import Actor, Scene

_REACH = 3  # search radius around the requested pixel, pixels
_SIDE = 2 * _REACH + 1
# Distance by which a keypoint may be farther from the pointer than a surface, pixels.
_PREFERENCE = 2.5


@dataclass(frozen=True, slots=True, eq=False)
class Pick:
    """The object at a pixel."""

    actor: int
    """Index in the scene."""
    joint: int
    """Joint whose box was hit, otherwise -1."""
    triangle: int
    """Index in the figure's mesh, or in its reduced mesh if that is drawn; otherwise -1."""
    keypoint: int
    """Captured point or keypoint of the figure, the nearer one on a limb; otherwise -1."""
    point: Floats
    """(3,). Hit point on the surface, scene space."""


_Found = Callable[[int, int, Floats], Pick]
"""Function from instance, index of the drawn triangle and point in scene space to a Pick."""


class PickPass:
    """Pass that draws indices instead of colours into a few pixels, on request."""

    def __init__(
        self,
        programs: Programs,
        meshes: MeshPass,
        points: PointPass,
        buffers: ActorBuffers,
    ) -> None:
        self.context, self._programs = programs.context, programs
        self._meshes, self._points, self._buffers = meshes, points, buffers
        self._numbers: moderngl.Texture | None = None
        self._found: list[_Found] = []
        self._is_small: list[bool] = []

    def pick(
        self,
        scene: Scene,
        view: View,
        options: DisplayOptions,
        size: tuple[int, int],
        pixel: tuple[float, float],
    ) -> Pick | None:
        """Return the item at a pixel, or the nearest one within three pixels."""
        if has_joint_marks(options):
            # Dots, and bones in X-ray mode, are drawn over everything else.
            marked = joint_at(joint_marks_of(scene.actors), view, size, pixel, options.xray)
            if marked is not None:
                whose, joint, point = marked
                return Pick(whose, joint, -1, -1, point)
        self._begin()
        near = replace(view, projection=_window(size, pixel) @ view.projection)
        self._found, self._is_small = [], []
        lineup = self._buffers.line_up(scene.actors, options)
        meshes = update_meshes(self._buffers, lineup, options)
        numbers = {id(actor): number for number, actor in enumerate(scene.actors)}
        for actor, mesh in meshes.singles:
            self._draw_mesh(numbers[id(actor)], mesh, placement_of(actor, options), near, options)
        for group, instances in meshes.instanced:
            whose_numbers = [numbers[id(actor)] for actor in group.actors]
            self._draw_instances(whose_numbers, instances, near, options)
        update_skeletons(self._buffers, lineup, options)
        for group in lineup.joint_groups:
            self._draw_joint_group(group, numbers, near, options)
        for which, draw in (
            (lineup.skeletons_alone, self._draw_skeleton),
            (lineup.points, self._draw_points),
            (lineup.markers, self._draw_markers),
        ):
            for actor in which:
                draw(numbers[id(actor)], actor, near, options)
        return self._read(near)

    def _begin(self) -> None:
        """Bind a small framebuffer with four integers per pixel, cleared to 0."""
        context = self.context
        if self._numbers is None:
            self._numbers = context.texture((_SIDE, _SIDE), 4, dtype="i4")
            self._depth = context.depth_renderbuffer((_SIDE, _SIDE))
            self._framebuffer = context.framebuffer([self._numbers], self._depth)
        self._numbers.write(np.zeros((_SIDE, _SIDE, 4), "i4"))
        # glClear is undefined for integer colour buffers.
        self._framebuffer.color_mask = False, False, False, False
        self._framebuffer.clear(depth=1.0)
        self._framebuffer.color_mask = True, True, True, True
        self._framebuffer.use()
        context.viewport = (0, 0, _SIDE, _SIDE)
        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func = "<"

    def _number(self, program: moderngl.Program, found: _Found, is_small: bool = False) -> None:
        """Assign a number to the next draw call, and store how to resolve a hit."""
        self._found.append(found)
        self._is_small.append(is_small)
        set_uniforms(program, {"u_item": len(self._found)})

    def _draw_mesh(
        self, index: int, mesh: PosedMesh, placement: Floats, view: View, options: DisplayOptions
    ) -> None:
        order = mesh.index_set(options).order

        def prepare(program: moderngl.Program, run: MeshRun) -> None:
            def found(_: int, triangle: int, point: Floats) -> Pick:
                return Pick(index, -1, int(order[run.first // 3 + triangle]), -1, point)

            self._number(program, found)

        self._meshes.draw_shape(mesh, placement, view, options, "pick", prepare)

    def _draw_instances(
        self,
        numbers: list[int],
        instances: InstanceBuffers,
        view: View,
        options: DisplayOptions,
    ) -> None:
        order = instances.mesh.index_set(options.reduced, options.hidden_parts).order

        def prepare(program: moderngl.Program, run: MeshRun) -> None:
            def found(instance: int, triangle: int, point: Floats) -> Pick:
                # Some drivers continue gl_PrimitiveID across instances.
                place = (run.first + 3 * triangle % run.count) // 3
                return Pick(numbers[instance], -1, int(order[place]), -1, point)

            self._number(program, found)

        how = view, options, "pick", prepare
        draw_instance_shapes(self._programs, instances, *how, instances.count)

    def _draw_skeleton(self, index: int, actor: Actor, view: View, options: DisplayOptions) -> None:
        skeleton = self._buffers.skeleton(actor)
        # A skeleton over a skin is drawn in front of it.
        view = in_front(view) if shows_mesh(actor.figure, options) else view
        program = joint_program(self._programs, skeleton, options, "", "pick")
        self._number(program, lambda joint, _, point: Pick(index, joint, -1, -1, point))
        draw_joints(program, skeleton, placement_of(actor, options), view, options)

    def _draw_joint_group(
        self, group: Group, numbers: dict[int, int], view: View, options: DisplayOptions
    ) -> None:
        skeleton = self._buffers.joint_group(group)
        view = in_front(view) if shows_mesh(group.actors[0].figure, options) else view
        program = joint_program(self._programs, skeleton, options, "", "pick")

        def found(instance: int, _: int, point: Floats) -> Pick:
            row, joint = divmod(instance, skeleton.n_joints)
            return Pick(numbers[id(group.actors[row])], joint, -1, -1, point)

        self._number(program, found)
        draw_joints(program, skeleton, skeleton.placement, view, options)

    def _draw_markers(self, index: int, actor: Actor, view: View, options: DisplayOptions) -> None:
        markers = self._buffers.keypoints_of(actor)
        markers.update(actor.pose, options.skinning)
        program = self._programs.drawing("joint", fragment="pick")
        self._number(program, lambda marker, _, point: Pick(index, -1, -1, marker, point), True)
        draw_boxes(program, markers.boxes, actor.placement, in_front(view), options)

    def _draw_points(self, index: int, actor: Actor, view: View, options: DisplayOptions) -> None:
        points = self._buffers.points_of(actor)
        points.update(actor, actor.placement, view, options)
        elements, places, layout = points.elements, actor.points, actor.figure.points
        assert places is not None and layout is not None  # guaranteed by with_points
        if not len(elements):
            return
        program = self._programs.drawing("point", fragment="pick")
        set_model(program, view, actor.placement, points.center)

        def found(instance: int, _: int, point: Floats) -> Pick:
            element = int(elements[instance]) - len(layout.names)
            if element < 0:
                return Pick(index, -1, -1, int(elements[instance]), point)
            ends = layout.limbs[element]
            apart = apply_transform(actor.placement, places[ends, :3]) - point
            return Pick(index, -1, -1, int(ends[np.linalg.norm(apart, axis=1).argmin()]), point)

        self._number(program, found, True)
        array = points.array(program, self._points.shape(points))
        array.render(moderngl.TRIANGLES, instances=len(elements))

    def _read(self, view: View) -> Pick | None:
        """Return the hit nearest to the centre; keypoints get a bonus because they are small."""
        rows = np.frombuffer(self._framebuffer.read(components=4, dtype="i4"), dtype=np.int32)
        numbers = rows.reshape(_SIDE, _SIDE, 4)
        row, column = np.nonzero(numbers[..., 0])
        if not len(row):
            return None
        away = np.hypot(row - _REACH, column - _REACH)
        away -= _PREFERENCE * np.array(self._is_small)[numbers[row, column, 0] - 1]
        nearest = away.argmin()
        y, x = int(row[nearest]), int(column[nearest])
        item, instance, triangle = (int(number) for number in numbers[y, x, :3])
        depth = float(numbers[y, x, 3:].view(np.float32)[0])
        return self._found[item - 1](instance, triangle, _unproject(view, (x, y), depth))

    def release(self) -> None:
        """Free the framebuffer."""
        if self._numbers is not None:
            for item in (self._framebuffer, self._depth, self._numbers):
                item.release()
            self._numbers = None


def _window(size: tuple[int, int], pixel: tuple[float, float]) -> Floats:
    """Return the matrix that maps a few pixels around a pixel to all of clip space."""
    x, y = np.floor(pixel[0]) + 0.5, np.floor(pixel[1]) + 0.5
    scale = size[0] / _SIDE, size[1] / _SIDE
    matrix: NDArray[np.float64] = np.diag([*scale, 1.0, 1.0])
    matrix[0, 3] = -scale[0] * (2.0 * x / size[0] - 1.0)
    matrix[1, 3] = -scale[1] * (1.0 - 2.0 * y / size[1])
    return matrix


def _unproject(view: View, pixel: tuple[int, int], depth: float) -> Floats:
    """Return the point in scene space at a pixel, with ``depth`` along the camera's z axis."""
    x, y = (2.0 * (side + 0.5) / _SIDE - 1.0 for side in pixel)
    _, _, clip_z, clip_w = view.projection @ [0.0, 0.0, depth, 1.0]
    back = np.linalg.inv(view.projection @ view.matrix)
    return back[:3] @ np.array([x * clip_w, y * clip_w, clip_z, clip_w])
