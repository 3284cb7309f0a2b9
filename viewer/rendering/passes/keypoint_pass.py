"""Pass that draws a figure's keypoints as small cubes that are visible through the surface."""

from __future__ import annotations

import moderngl
import numpy as np

from viewer.rendering.gpu.box_buffers import BoxBuffers
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.joint_pass import JointPass, draw_boxes
from viewer.rendering.view import View, in_front
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.keypoints import posed_keypoints
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.pose import Pose, pose_key
from viewer.rigs.skinning import Skinning

_CUBE_SIZE = 0.006  # half the side length of a cube, relative to the figure's size


class KeypointBuffers:
    """Cubes of one actor's keypoints."""

    def __init__(self, context: moderngl.Context, figure: Figure, cube: moderngl.Buffer) -> None:
        assert figure.keypoints is not None  # checked by the caller
        self.figure = figure
        half = _CUBE_SIZE * box_size(bounding_box(figure.require_mesh().positions))
        cubes = np.tile([[-half] * 3, [half] * 3], (len(figure.keypoints.names), 1, 1))
        self.boxes = BoxBuffers(context, cube, cubes)
        self._key: tuple[object, ...] | None = None

    def update(self, pose: Pose, skinning: Skinning) -> None:
        """Move the cubes to the keypoints of a pose, if it changed."""
        key = (repr(skinning), pose_key(pose))
        if key != self._key:
            self.boxes.move(translation_matrix(posed_keypoints(self.figure, pose, skinning)))
            self._key = key

    def release(self) -> None:
        """Free every buffer."""
        self.boxes.release()


class KeypointPass:
    """Pass that draws keypoints with the shader program of the joints."""

    def __init__(self, joints: JointPass) -> None:
        self.joints = joints

    def draw(
        self,
        points: KeypointBuffers,
        placement: Floats,
        view: View,
        options: DisplayOptions,
        opacity: float = 1.0,
    ) -> None:
        """Draw the markers, in front of everything."""
        program = self.joints.programs.drawing("joint", "phong", fragment="mesh")
        draw_boxes(program, points.boxes, placement, in_front(view), options, opacity=opacity)
