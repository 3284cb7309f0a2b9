"""Draws a figure's keypoints as small cubes, through the surface."""

from __future__ import annotations

import moderngl
import numpy as np

from viewer.rendering.gpu.box_buffers import BoxBuffers
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.joint_pass import JointPass, draw_boxes
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
        assert figure.keypoints is not None and figure.mesh is not None  # the caller looked
        self.figure = figure
        half = _CUBE_SIZE * box_size(bounding_box(figure.mesh.positions))
        cubes = np.tile([[-half] * 3, [half] * 3], (len(figure.keypoints.names), 1, 1))
        self.boxes = BoxBuffers(context, cube, cubes)
        self._key: tuple[object, ...] | None = None

    def update(self, pose: Pose, skinning: Skinning) -> None:
        """Follow the pose."""
        key = (repr(skinning), pose_key(pose))
        if key != self._key:
            self.boxes.move(translation_matrix(posed_keypoints(self.figure, pose, skinning)))
            self._key = key

    def release(self) -> None:
        """Free every buffer."""
        self.boxes.release()


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
        draw_boxes(program, points.boxes, placement, in_front(view), options)
