"""Draws a figure's keypoints as small cubes, through the surface."""

from __future__ import annotations

import moderngl
import numpy as np

from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.upload import buffer, matrix_texture, write_matrices
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.joint_pass import JointPass, box_content, draw_boxes, joint_colors
from viewer.rendering.view import View, in_front
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.geometry.transform import translation_matrix
from viewer.rig.keypoints import posed_keypoints
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.pose import Pose, pose_key
from viewer.rig.skinning import Skinning

__all__ = ["KeypointBuffers", "KeypointPass"]

_CUBE_SIZE = 0.006  # of the figure's size, half a side


class KeypointBuffers:
    """Cubes of one actor's keypoints.

    Parameters
    ----------
    context : moderngl.Context
        Gives the buffers.
    figure : Figure
        With keypoints and a mesh.
    cube : moderngl.Buffer
        Shared by all.
    """

    def __init__(self, context: moderngl.Context, figure: Figure, cube: moderngl.Buffer) -> None:
        self.context, self.figure, self.cube = context, figure, cube
        assert figure.keypoints is not None and figure.mesh is not None  # the caller looked
        self.count = len(figure.keypoints.names)
        half = _CUBE_SIZE * box_size(bounding_box(figure.mesh.positions))
        self._owner = Owner()
        with self._owner.guard():
            keep = self._owner.keep
            self.low = keep(buffer(context, np.full((self.count, 3), -half), "f4"))
            self.high = keep(buffer(context, np.full((self.count, 3), half), "f4"))
            self.colors = keep(buffer(context, joint_colors(self.count), "f4"))
            self.world = keep(matrix_texture(context, self.count))
        self.center: Floats = np.zeros(3)
        self._arrays: dict[int, moderngl.VertexArray] = {}
        self._key: tuple[object, ...] | None = None

    def update(self, pose: Pose, skinning: Skinning) -> None:
        """Follow the pose."""
        key = (repr(skinning), pose_key(pose))
        if key != self._key:
            points = posed_keypoints(self.figure, pose, skinning)
            self.center = bounding_box(points).mean(axis=0)
            write_matrices(self.world, translation_matrix(points - self.center))
            self._key = key

    def array(self, program: moderngl.Program) -> moderngl.VertexArray:
        """Return the instanced cubes for a program."""
        if id(program) not in self._arrays:
            content = box_content(program, self.cube, self.low, self.high, self.colors)
            self._arrays[id(program)] = self.context.vertex_array(program, content)
        return self._arrays[id(program)]

    def release(self) -> None:
        """Free every buffer."""
        for array in self._arrays.values():
            array.release()
        self._owner.release()


class KeypointPass:
    """Draws keypoints with the program of the joints.

    Parameters
    ----------
    joints : JointPass
        Gives program and cube.
    """

    def __init__(self, joints: JointPass) -> None:
        self.joints = joints

    def draw(
        self, points: KeypointBuffers, placement: Floats, view: View, options: DisplayOptions
    ) -> None:
        """Draw the markers, in front of everything.

        Parameters
        ----------
        points : KeypointBuffers
            Already updated.
        placement : (4, 4)
            Figure space to scene.
        view : View
            The camera's matrices.
        options : DisplayOptions
            Lights.
        """
        program = self.joints.programs.drawing("joint", "phong", fragment="mesh")
        draw_boxes(
            program,
            points.array(program),
            points.count,
            points.world,
            placement,
            points.center,
            in_front(view),
            options,
        )
