"""Draws a skeleton: one box per joint, instances of a small cube."""

from __future__ import annotations

import colorsys
from typing import Any

import moderngl
import numpy as np

from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.upload import buffer, matrix_texture, write_matrices
from viewer.rendering.options import Color, DisplayOptions
from viewer.rendering.view import View, in_front, set_lights, set_model
from viewer.rig.arrays import Bools, Floats
from viewer.rig.figure import Figure
from viewer.rig.kinematics import posed_skeleton, world_matrices
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.number_key import NumberKey
from viewer.rig.pose import Pose, rest_pose
from viewer.rig.shape import shaped
from viewer.rig.skeleton import Skeleton

__all__ = ["JointPass", "SkeletonBuffers", "box_content", "draw_boxes", "joint_colors"]

_HIGHLIGHT = (1.0, 0.55, 0.02)  # linear
_CUBE_SIZE = 0.015  # of a skeleton without boxes
_GOLDEN = 0.618033988749895
_WORLD_UNIT = 0
_CUBE_VERTICES = 36
_CROWD = 1000  # joints from which on it pays to look for coincident boxes


def joint_colors(n_joints: int) -> Floats:
    """Return a colour for each joint: hues a golden ratio apart, so neighbours differ.

    Returns
    -------
    (J, 3)
        Linear.
    """
    hues = 0.58 + _GOLDEN * np.arange(n_joints)
    return np.array([colorsys.hsv_to_rgb(hue % 1.0, 0.42, 0.72) for hue in hues])


class SkeletonBuffers:
    """Boxes and colours of one figure's joints, and the matrices of one actor's pose."""

    def __init__(self, context: moderngl.Context, figure: Figure, cube: moderngl.Buffer) -> None:
        skeleton = figure.skeleton
        assert skeleton is not None  # only figures with a skeleton come here
        self.context, self.figure, self._cube = context, figure, cube
        self.n_joints = skeleton.n_joints
        boxes = skeleton.boxes if skeleton.boxes is not None else _cubes(skeleton)
        self._boxes = boxes
        self._owner = Owner()
        with self._owner.guard():
            keep = self._owner.keep
            self._low = keep(buffer(context, boxes[:, 0], "f4"))
            self._high = keep(buffer(context, boxes[:, 1], "f4"))
            self._colors = keep(buffer(context, joint_colors(skeleton.n_joints), "f4"))
            self.world = keep(matrix_texture(context, skeleton.n_joints))
        self.center: Floats = np.zeros(3)
        self._arrays: dict[int, moderngl.VertexArray] = {}
        self._key: NumberKey | None = None

    def is_current(self, pose: Pose) -> bool:
        """Return whether the joints' matrices are those of a pose."""
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
        assert skeleton is not None  # shaping keeps it
        world = posed_skeleton(skeleton, pose).world.copy()
        self.center = bounding_box(world[:, :3, 3]).mean(axis=0)
        world[:, :3, 3] -= self.center
        if self.n_joints > _CROWD:
            world[self._hidden(world)] = 0.0
        write_matrices(self.world, world)
        self._key = key

    def _hidden(self, world: Floats) -> Bools:
        """Return which joints' boxes coincide with another's; shrunk to a point, they cost nothing.

        A hundred thousand boxes over one another would take minutes to draw in software.
        """
        rows = np.concatenate([world[:, :3].reshape(-1, 12), self._boxes.reshape(-1, 6)], axis=1)
        _, first = np.unique(rows.astype(np.float32), axis=0, return_index=True)
        hidden = np.ones(len(rows), dtype=bool)
        hidden[first] = False
        return hidden

    def array(self, program: moderngl.Program) -> moderngl.VertexArray:
        """Return the instanced cubes for a program."""
        if id(program) not in self._arrays:
            content = box_content(program, self._cube, self._low, self._high, self._colors)
            self._arrays[id(program)] = self.context.vertex_array(program, content)
        return self._arrays[id(program)]

    def release(self) -> None:
        """Free every buffer."""
        for array in self._arrays.values():
            array.release()
        self._owner.release()


class JointPass:
    """Draws skeletons as boxes.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    programs : Programs
        Gives the program.
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
    ) -> None:
        """Draw one box per joint.

        Parameters
        ----------
        skeleton : SkeletonBuffers
            Already updated.
        placement : (4, 4)
            Figure space to scene.
        view : View
            The camera's matrices.
        options : DisplayOptions
            Lights.
        selected : int
            The joint to highlight, -1 for none.
        opacity : float
            Below 1 the boxes are one translucent layer over everything drawn before: boxes
            often enclose the skin, and would hide it.
        color : (r, g, b), optional
            Of all boxes, linear; a colour for each joint if omitted.
        """
        overlays = opacity < 1.0
        view = in_front(view) if overlays else view
        program = self.programs.drawing("joint", "phong", fragment="mesh")
        array, count = skeleton.array(program), skeleton.n_joints
        if overlays:
            # Only the nearest boxes count: the others would show through them.
            target = self.context.fbo
            target.color_mask = False, False, False, False
            target.use()  # moderngl hands masks to OpenGL only then
        place = placement, skeleton.center, view, options, selected, opacity, color
        draw_boxes(program, array, count, skeleton.world, *place)
        if overlays:
            target.color_mask = True, True, True, True
            target.use()
            self.context.depth_func = "<="
            draw_boxes(program, array, count, skeleton.world, *place)
        self.context.depth_func = "<"

    def release(self) -> None:
        """Free the cube."""
        self.cube.release()


def box_content(
    program: moderngl.Program,
    cube: moderngl.Buffer,
    low: moderngl.Buffer,
    high: moderngl.Buffer,
    colors: moderngl.Buffer,
) -> list[Any]:
    """Return what a vertex array of boxes is made of: those attributes that the compiler kept."""
    content: list[Any] = [(cube, "3f4 3f4", "in_corner", "in_normal")]
    if "in_normal" not in program:
        content = [(cube, "3f4 12x", "in_corner")]
    content += [(low, "3f4/i", "in_low"), (high, "3f4/i", "in_high")]
    return content + ([(colors, "3f4/i", "in_color")] if "in_color" in program else [])


def draw_boxes(
    program: moderngl.Program,
    array: moderngl.VertexArray,
    count: int,
    world: moderngl.Texture,
    placement: Floats,
    center: Floats,
    view: View,
    options: DisplayOptions,
    selected: int = -1,
    opacity: float = 1.0,
    color: Color | None = None,
) -> None:
    """Draw instances of the cube, each by its own matrix of ``world``."""
    set_model(program, view, placement, center)
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
    world.use(_WORLD_UNIT)
    array.render(moderngl.TRIANGLES, vertices=_CUBE_VERTICES, instances=count)


def _cubes(skeleton: Skeleton) -> Floats:
    """Return small cubes for joints that no file gave a box: (J, 2, 3)."""
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
