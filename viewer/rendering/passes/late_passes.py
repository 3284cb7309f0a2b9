"""Optional passes, imported and created on first use."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import moderngl

from viewer.rendering.gpu.actor_buffers import ActorBuffers
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.program import Programs
from viewer.rendering.gpu.studio import Matcaps, Studio
from viewer.rendering.gpu.target import Accumulation
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.background_pass import BackdropPass
from viewer.rendering.passes.joint_pass import JointPass
from viewer.rendering.passes.mesh_pass import MeshPass, shading_of
from viewer.rendering.view import View
from viewer.rigs.scene import Scene

if TYPE_CHECKING:
    from viewer.rendering.gpu.mesh_buffers import MeshBuffers
    from viewer.rendering.passes.annotation_pass import AnnotationPass
    from viewer.rendering.passes.camera_image_pass import CameraImagePass
    from viewer.rendering.passes.ghost_pass import GhostPass
    from viewer.rendering.passes.keypoint_pass import KeypointPass
    from viewer.rendering.passes.legend_pass import LegendPass
    from viewer.rendering.passes.motion_path_pass import MotionPathPass
    from viewer.rendering.passes.outline_pass import OutlinePass
    from viewer.rendering.passes.point_pass import PointPass
    from viewer.rendering.picking import PickPass


class LatePasses:
    """Passes that many scenes do not need, each created on demand."""

    def __init__(
        self,
        context: moderngl.Context,
        programs: Programs,
        mesh_pass: MeshPass,
        joint_pass: JointPass,
        buffers: ActorBuffers,
    ) -> None:
        self._context, self._programs, self._buffers = context, programs, buffers
        self._mesh_pass, self._joint_pass = mesh_pass, joint_pass
        self._sum: Accumulation | None = None
        self._owner = Owner()

    @cached_property
    def keypoint_pass(self) -> KeypointPass:
        """Pass for the keypoints of figures."""
        from viewer.rendering.passes.keypoint_pass import KeypointPass

        return KeypointPass(self._joint_pass)

    @cached_property
    def point_pass(self) -> PointPass:
        """Pass for captured points."""
        from viewer.rendering.passes.point_pass import PointPass

        return self._owner.keep(PointPass(self._context, self._programs))

    @cached_property
    def motion_path_pass(self) -> MotionPathPass:
        """Pass for motion paths."""
        from viewer.rendering.passes.motion_path_pass import MotionPathPass

        return MotionPathPass(self._context, self._programs)

    @cached_property
    def pick_pass(self) -> PickPass:
        """Pass that finds the object at a pixel."""
        from viewer.rendering.picking import PickPass

        return self._owner.keep(
            PickPass(self._programs, self._mesh_pass, self.point_pass, self._buffers)
        )

    @cached_property
    def legend_pass(self) -> LegendPass:
        """Pass for legends of scalar quantities."""
        from viewer.rendering.passes.legend_pass import LegendPass

        return self._owner.keep(LegendPass(self._context, self._programs))

    @cached_property
    def annotation_pass(self) -> AnnotationPass:
        """Pass for marks, joint marks and annotations."""
        from viewer.rendering.passes.annotation_pass import AnnotationPass

        return self._owner.keep(AnnotationPass(self._context, self._programs))

    @cached_property
    def ghost_pass(self) -> GhostPass:
        """Pass for ghosts over the scene."""
        from viewer.rendering.passes.ghost_pass import GhostPass

        return self._owner.keep(GhostPass(self._context, self._programs, self._mesh_pass))

    @cached_property
    def camera_image_pass(self) -> CameraImagePass:
        """Pass for the images of calibrated cameras."""
        from viewer.rendering.passes.camera_image_pass import CameraImagePass

        return self._owner.keep(CameraImagePass(self._context, self._programs))

    @cached_property
    def studio(self) -> Studio:
        """Light of metallic-roughness surfaces."""
        return self._owner.keep(Studio(self._context))

    @cached_property
    def matcaps(self) -> Matcaps:
        """Images of lit spheres."""
        return self._owner.keep(Matcaps(self._context))

    @cached_property
    def backdrop_pass(self) -> BackdropPass:
        """Pass that draws the studio behind the scene."""
        return self._owner.keep(BackdropPass(self._context, self._programs, self.studio))

    def use_pictures(self, meshes: Sequence[MeshBuffers], options: DisplayOptions) -> None:
        """Bind the textures that shading needs in addition to the meshes' textures."""
        if options.shading == "matcap":
            self.matcaps.use(options.matcap)
        elif any(shading_of(mesh, options) == "pbr" for mesh in meshes):
            self.studio.use()

    @cached_property
    def outline_pass(self) -> OutlinePass:
        """Pass for outlines of selected and hovered parts."""
        from viewer.rendering.passes.outline_pass import OutlinePass

        return self._owner.keep(
            OutlinePass(self._programs, self._mesh_pass, self.point_pass, self._buffers)
        )

    def accumulation(self, size: tuple[int, int]) -> Accumulation:
        """Return the accumulation buffer for images of this size."""
        if self._sum is None or self._sum.size != size:
            if self._sum is not None:
                self._sum.release()
            self._sum = None
            self._sum = Accumulation(self._context, self._programs, size)
        return self._sum

    def draw_motion_paths(
        self, scene: Scene, view: View, options: DisplayOptions, size: tuple[int, int]
    ) -> None:
        """Draw the paths of joints around the scene's time."""
        if not options.path_joints:
            return
        from viewer.rendering.passes.motion_path_pass import Moment

        at = Moment(scene.time or 0.0, options.path_seconds)
        for index, actor in enumerate(scene.actors):
            joints = tuple(joint for owner, joint in options.path_joints if owner == index)
            # Paths are drawn even while actors are absent, to show their past and future positions.
            if joints and actor.visible and actor.clip is not None:
                paths = self._buffers.motion_path(actor)
                paths.update(actor, joints, options.min_confidence)
                self.motion_path_pass.draw(paths, actor.placement, view, size, at)

    def release(self) -> None:
        """Free all passes that were created."""
        self._owner.release()
        if self._sum is not None:
            self._sum.release()
