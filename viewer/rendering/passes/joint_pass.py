"""Pass that draws skeletons: one box per joint, as instances of a cube."""

from __future__ import annotations

from functools import partial

import moderngl
import numpy as np

from viewer.rendering.gpu.box_buffers import BoxBuffers
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.upload import buffer
from viewer.rendering.options import Color, DisplayOptions
from viewer.rendering.passes.see_through import draw_nearest
from viewer.rendering.view import View, in_front, set_lights, set_model
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.kinematics import posed_skeleton, world_matrices
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.number_key import NumberKey
from viewer.rig.pose import Pose, rest_pose
from viewer.rig.shape import shaped
from viewer.rig.skeleton import Skeleton

__all__ = ["JointPass", "SkeletonBuffers", "draw_boxes"]

_HIGHLIGHT = (1.0, 0.55, 0.02)  # linear
_CUBE_SIZE = 0.015  # of the skeleton's size, for a skeleton without boxes
_WORLD_UNIT = 0
_CUBE_VERTICES = 36


class SkeletonBuffers:
    """Boxes of one figure's joints, moved by one actor's pose."""

    def __init__(self, context: moderngl.Context, figure: Figure, cube: moderngl.Buffer) -> None:
        skeleton = figure.require_skeleton()
        self.figure = figure
        self.boxes = BoxBuffers(context, cube, _joint_boxes(skeleton))
        self._key: NumberKey | None = None

    def is_current(self, pose: Pose) -> bool:
        """Return whether the uploaded joint matrices belong to a pose."""
        return self._key == pose.skinning_key

    def update(self, pose: Pose) -> None:
        """Upload the joints' matrices if the pose changed.

        Parameters
        ----------
        pose : Pose
            DOFs in lengths and radians.
        """
        key = pose.skinning_key
        if key == self._key:
            return
        skeleton = shaped(self.figure, pose.shape_weights).skeleton
        assert skeleton is not None  # applying a shape keeps the skeleton
        self.boxes.move(posed_skeleton(skeleton, pose).world.copy())
        self._key = key

    def release(self) -> None:
        """Free every buffer."""
        self.boxes.release()


class JointPass:
    """Draws skeletons as boxes.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    programs : Programs
        Provides the shader program.
    """

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
        """Draw one box per joint.

        Parameters
        ----------
        skeleton : SkeletonBuffers
            Updated buffers.
        placement : (4, 4)
            Matrix from figure space to scene space.
        view : View
            The camera's matrices.
        options : DisplayOptions
            Lights.
        selected : int
            The joint to highlight, -1 for none.
        opacity : float
            Below 1 the boxes are drawn as one translucent layer.
        color : (r, g, b), optional
            Colour of all boxes, linear; by default each joint has its own colour.
        overlays : bool
            Draw over everything else: boxes often enclose the skin, which would hide them.
        """
        overlays = overlays and opacity < 1.0
        view = in_front(view) if overlays else view
        program = self.programs.drawing(
            "joint", "phong", fragment="mesh", effects=view.effects.defines
        )
        how = placement, view, options, selected, opacity, color
        draw = partial(draw_boxes, program, skeleton.boxes, *how)
        if opacity < 1.0:
            # Draw only the nearest surface, so that other boxes do not show through.
            draw_nearest(self.context, draw)
        else:
            draw()

    def release(self) -> None:
        """Free the cube."""
        self.cube.release()


def draw_boxes(
    program: moderngl.Program,
    boxes: BoxBuffers,
    placement: Floats,
    view: View,
    options: DisplayOptions,
    selected: int = -1,
    opacity: float = 1.0,
    color: Color | None = None,
) -> None:
    """Draw boxes whose matrices are already uploaded."""
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
    array = boxes.array(program)
    array.render(moderngl.TRIANGLES, vertices=_CUBE_VERTICES, instances=boxes.count)


def _joint_boxes(skeleton: Skeleton) -> Floats:
    """Return the joints' boxes, small cubes if the skeleton has none: (J, 2, 3)."""
    if skeleton.boxes is not None:
        return skeleton.boxes
    points = world_matrices(skeleton, rest_pose(skeleton))[:, :3, 3]
    half = _CUBE_SIZE * (box_size(bounding_box(points)) or 1.0)
    return np.tile([[-half] * 3, [half] * 3], (skeleton.n_joints, 1, 1))


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
