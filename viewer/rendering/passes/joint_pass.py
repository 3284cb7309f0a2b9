"""Pass that draws skeletons: boxes, octahedra, sticks or axes, as instances."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from viewer.rendering.gpu.draw_state import draw_nearest
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.upload import buffer
from viewer.rendering.lineup import Group
from viewer.rendering.options import BoneStyle, Color, DisplayOptions, bone_style, skeleton_opacity
from viewer.rendering.view import View, in_front, set_lights, set_model
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.kinematics import posed_skeleton, world_matrices
from viewer.rigs.memo import Memo, NumberKey
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.motion.instances import worlds
from viewer.rigs.pose import Pose, batch_last, rest_pose
from viewer.rigs.shape import shaped_skeleton
from viewer.rigs.skeleton import Skeleton, shown_joints
from viewer.rigs.skinning import deform

if TYPE_CHECKING:
    from viewer.rendering.gpu.bones import BoneBuffers
    from viewer.rendering.gpu.box_buffers import BoxBuffers


_HIGHLIGHT = (1.0, 0.55, 0.02)  # linear
_CUBE_SIZE = 0.015  # size of the cubes of a skeleton without boxes, as a fraction of its size
_WORLD_UNIT = 0
_CUBE_VERTICES = 36
_sizes: Memo[Figure, float] = Memo()


class SkeletonBuffers:
    """Shapes of a figure's joints, moved by the pose of one actor or by those of a group.

    ``colors``: of a group's actors; see ``BoneBuffers``. ``worlds``: (A, J, 4, 4) of a group,
    figure space. ``placement``: of the shapes of a group in the scene.
    """

    def __init__(
        self,
        context: moderngl.Context,
        figure: Figure,
        cube: moderngl.Buffer,
        colors: Sequence[Color | None] = (None,),
    ) -> None:
        from viewer.rendering.colors import actor_colors, joint_colors
        from viewer.rendering.gpu.box_buffers import BoxBuffers

        skeleton = figure.require_skeleton()
        self.context, self.figure, self.colors = context, figure, colors
        self._size = skeleton_size(figure)
        boxes = np.tile(_joint_boxes(skeleton, self._size), (len(colors), 1, 1))
        painted = actor_colors(joint_colors(skeleton.n_joints), colors)
        self.boxes = BoxBuffers(context, cube, boxes, painted.reshape(-1, 3))
        self._bones: dict[str, BoneBuffers] = {}
        self._key: tuple[NumberKey, bool] | None = None
        self._versions: tuple[int, int] | None = None
        self.worlds: Floats = np.zeros((0, 0, 4, 4))
        self.placement: Floats = np.eye(4)

    @property
    def n_joints(self) -> int:
        """Number of joints of one actor."""
        return self.figure.require_skeleton().n_joints

    def style(self, options: DisplayOptions) -> BoneStyle:
        """Return the style of the drawn skeleton; see ``bone_style``."""
        return bone_style(self.figure.require_skeleton(), options)

    def opacity(self, options: DisplayOptions) -> float:
        """Return the opacity of the skeleton over a skin."""
        return skeleton_opacity(self.figure.require_skeleton(), options)

    def bones(self, style: BoneStyle) -> BoneBuffers:
        """Return the shapes of a style other than boxes, created on first use."""
        if style not in self._bones:
            from viewer.rendering.gpu.bones import BoneBuffers

            skeleton = self.figure.require_skeleton()
            how = style, self._size, self.colors
            self._bones[style] = BoneBuffers(self.context, skeleton, *how)
        return self._bones[style]

    def is_current(self, pose: Pose, options: DisplayOptions) -> bool:
        """Return whether the uploaded joint matrices belong to a pose."""
        return self._key == (pose.skinning_key, self.style(options) == "boxes")

    def update(self, pose: Pose, options: DisplayOptions) -> None:
        """Upload the joints' matrices if the pose changed."""
        if self.is_current(pose, options):
            return
        skeleton = shaped_skeleton(self.figure, pose.shape_weights)
        are_boxes = self.style(options) == "boxes"
        # Bones reach from one joint to another, so they need the matrices of all joints.
        self.boxes.move(posed_skeleton(skeleton, pose).world.copy(), hides=are_boxes)
        self._key = pose.skinning_key, are_boxes

    def update_group(self, group: Group) -> None:
        """Upload the matrices of a group's joints if a pose or a placement changed."""
        crowd = group.crowd
        versions = crowd.version, crowd.placement_version
        if versions == self._versions:
            return
        if self._versions is None or self._versions[0] != crowd.version:
            skeleton = shaped_skeleton(self.figure, crowd.shape_weights)
            self.worlds = worlds(skeleton, crowd.arrays.rows(group.rows))
        models = crowd.models[group.rows]
        # Widths of bones are in figure units, so the common scale stays in the placement.
        scale = float(np.linalg.norm(models[0, :3, 0]))
        self.placement = np.diag([scale, scale, scale, 1.0])
        entries = batch_last(np.linalg.inv(self.placement) @ models, 2)
        placed = np.einsum("ika,ajkl->ajil", entries, self.worlds)
        self.boxes.move(placed.reshape(-1, 4, 4), hides=False)
        self._versions = versions

    def release(self) -> None:
        """Free every buffer."""
        self.boxes.release()
        for bones in self._bones.values():
            bones.release()
        self._bones.clear()


class JointPass:
    """Pass that draws skeletons."""

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.context, self.programs = context, programs
        self.cube = buffer(context, _cube_vertices(), "f4")

    def draw(
        self,
        skeleton: SkeletonBuffers,
        placement: Floats,
        view: View,
        options: DisplayOptions,
        selected: int = -1,
        opacity: float = 1.0,
        color: Color | None = None,
        overlays: bool = False,
    ) -> None:
        """Draw a skeleton in one linear colour; one colour per joint if it is None."""
        overlays = overlays and opacity < 1.0
        view = in_front(view) if overlays else view
        program = joint_program(
            self.programs, skeleton, options, "phong", "mesh", view.effects.defines
        )
        how = placement, view, options, selected, opacity, color
        draw = partial(draw_joints, program, skeleton, *how)
        if opacity < 1.0:
            # Only the nearest parts are drawn, as the others would show through.
            draw_nearest(self.context, draw)
        else:
            draw()

    def release(self) -> None:
        """Free the cube."""
        self.cube.release()


def joint_program(
    programs: Programs,
    skeleton: SkeletonBuffers,
    options: DisplayOptions,
    chunk: str,
    fragment: str,
    effects: tuple[str, ...] = (),
) -> moderngl.Program:
    """Return the program for ``draw_joints`` that draws a skeleton in its style."""
    name = "joint" if skeleton.style(options) == "boxes" else "bone"
    return programs.drawing(name, chunk, fragment=fragment, effects=effects)


def draw_joints(
    program: moderngl.Program,
    skeleton: SkeletonBuffers,
    placement: Floats,
    view: View,
    options: DisplayOptions,
    selected: int = -1,
    opacity: float = 1.0,
    color: Color | None = None,
    only: int = -1,
) -> None:
    """Draw a skeleton in its style; with ``only``, draw a single joint."""
    style, boxes = skeleton.style(options), skeleton.boxes
    _set_up(program, boxes, placement, view, options, selected, opacity, color)
    set_uniforms(program, {"u_only": only})
    if style == "boxes":
        _draw_instances(program, boxes)
    else:
        set_uniforms(program, {"u_height": skeleton.context.fbo.viewport[3]})
        skeleton.bones(style).draw(program)


def draw_boxes(
    program: moderngl.Program,
    boxes: BoxBuffers,
    placement: Floats,
    view: View,
    options: DisplayOptions,
    opacity: float = 1.0,
) -> None:
    """Draw boxes whose matrices have been uploaded."""
    _set_up(program, boxes, placement, view, options, -1, opacity, None)
    set_uniforms(program, {"u_only": -1})
    _draw_instances(program, boxes)


def _set_up(
    program: moderngl.Program,
    boxes: BoxBuffers,
    placement: Floats,
    view: View,
    options: DisplayOptions,
    selected: int,
    opacity: float,
    color: Color | None,
) -> None:
    """Set matrices, lights and colours."""
    set_model(program, view, placement, boxes.center)
    set_lights(program, view, options.lights)
    values = {
        "u_world": _WORLD_UNIT,
        "u_selected": selected,
        "u_highlight": _HIGHLIGHT,
        "u_has_color": color is not None,
        "u_color": color or (0.0, 0.0, 0.0),
        "u_flat": False,
        "u_textured": False,
        "u_opacity": opacity,
    }
    set_uniforms(program, values)
    boxes.world.use(_WORLD_UNIT)


def _draw_instances(program: moderngl.Program, boxes: BoxBuffers) -> None:
    array = boxes.array(program)
    array.render(moderngl.TRIANGLES, vertices=_CUBE_VERTICES, instances=boxes.count)


def skeleton_size(figure: Figure) -> float:
    """Return the size of a skeleton at rest, or of the mesh if all joints coincide."""
    return _sizes.get(figure, None, lambda: _size(figure))


def _size(figure: Figure) -> float:
    skeleton = figure.require_skeleton()
    points = world_matrices(skeleton, rest_pose(skeleton))[shown_joints(skeleton), :3, 3]
    size = box_size(bounding_box(points))
    if size == 0.0 and figure.mesh is not None:
        size = box_size(bounding_box(deform(figure)[0]))
    return size or 1.0


def _joint_boxes(skeleton: Skeleton, size: float) -> Floats:
    """Return the joints' boxes, small cubes if the skeleton has none: (J, 2, 3)."""
    if skeleton.boxes is not None:
        return skeleton.boxes
    half = _CUBE_SIZE * size
    # Joints that are not shown have boxes without extent.
    boxes = np.zeros((skeleton.n_joints, 2, 3))
    boxes[shown_joints(skeleton)] = [[-half] * 3, [half] * 3]
    return boxes


def _cube_vertices() -> Floats:
    """Return the 12 triangles of a cube from 0 to 1: (36, 6) corners and face normals."""
    rows = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, 1):
            normal = np.zeros(3)
            normal[axis] = 2 * side - 1
            order = [(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)]
            for a, b in order if side else order[::-1]:
                corner = np.zeros(3)
                corner[[axis, u, v]] = side, a, b
                rows.append([*corner, *normal])
    return np.array(rows)
