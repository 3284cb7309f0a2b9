"""Pass that draws motion paths of joints as lines."""

from __future__ import annotations

import moderngl
import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.colors import path_colors
from viewer.rendering.gpu.draw_state import opacities, without_depth_writes
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.upload import buffer
from viewer.rendering.gpu.vertex_arrays import VertexArrays
from viewer.rendering.view import View, set_model
from viewer.rigs.arrays import Floats
from viewer.rigs.mesh import bounding_box
from viewer.rigs.motion.motion_paths import MotionPath, motion_path, segments
from viewer.rigs.pose import pose_key
from viewer.rigs.scene import Actor, Motion, still_pose

_WIDTH = 2.5  # width of the lines, pixels
_HIDDEN = 0.3  # opacity of hidden parts


@dataclass(frozen=True, slots=True)
class Moment:
    """Drawn part of motion paths: ``reach`` seconds before and after ``now``; all of them if 0."""

    now: float
    reach: float


class MotionPathBuffers:
    """Segments of one actor's paths, recomputed only if their inputs changed."""

    def __init__(self, context: moderngl.Context) -> None:
        self.context = context
        self.count = 0
        self.center: Floats = np.zeros(3)
        self._owner = Owner()
        self._arrays = VertexArrays(context)
        self._clip: Motion | None = None
        self._key: tuple[object, ...] | None = None

    def update(self, actor: Actor, joints: tuple[int, ...], min_confidence: float) -> None:
        """Recompute the paths if clip, joints or the pose outside the clip have changed."""
        has_pose = actor.joint_motion is not None and actor.own_pose is not None
        still = pose_key(still_pose(actor)) if has_pose else None
        key = (id(actor.clip), joints, min_confidence, actor.offset, still)
        if key == self._key or actor.clip is None:
            return
        self._clip = actor.clip  # a reference keeps the clip alive, so that its id is not reused
        path = motion_path(
            actor.figure, actor.clip, joints, base=actor.own_pose, min_confidence=min_confidence
        )
        self._upload(path, actor.offset)
        self._key = key

    def _upload(self, path: MotionPath, offset: float) -> None:
        self.release()
        points, times, which = segments(path)
        self.count = len(points)
        if not self.count:
            return
        self.center = bounding_box(points.reshape(-1, 3)).mean(axis=0)
        colors = path_colors(path.points.shape[1])[which]
        content = [(points - self.center).reshape(-1, 6), times + offset, colors]
        self._segments = self._owner.keep(buffer(self.context, np.hstack(content), "f4"))

    def array(self, program: moderngl.Program) -> moderngl.VertexArray:
        """Return the segments as instances for a program."""
        names = "in_start", "in_end", "in_times", "in_color"
        content = [(self._segments, "3f4 3f4 2f4 3f4/i", *names)]
        return self._arrays.get(program, lambda: content)

    def release(self) -> None:
        """Free the buffers."""
        self._arrays.release()
        self._owner.release()


class MotionPathPass:
    """Pass that draws motion paths."""

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.context, self.programs = context, programs

    def draw(
        self,
        paths: MotionPathBuffers,
        placement: Floats,
        view: View,
        size: tuple[int, int],
        at: Moment,
    ) -> None:
        """Draw one actor's paths, with hidden parts faint."""
        if not paths.count:
            return
        program = self.programs.drawing("motion_path")
        set_model(program, view, placement, paths.center)
        values = {
            "u_size": size,
            "u_width": _WIDTH,
            "u_now": at.now,
            "u_reach": at.reach,
        }
        set_uniforms(program, values)
        array = paths.array(program)
        with without_depth_writes(self.context):  # overlapping lines must not hide each other
            for opacity in opacities(self.context, _HIDDEN):
                set_uniforms(program, {"u_opacity": opacity})
                array.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=paths.count)
