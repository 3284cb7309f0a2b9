"""Renderer of a scene into a framebuffer, used for the window and for image files."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import moderngl

from viewer.rendering.camera import Camera
from viewer.rendering.camera_views import (
    depth_bounds,
    draw_image_behind,
    draw_image_planes,
    frusta_of,
)
from viewer.rendering.casters import Casters
from viewer.rendering.gpu.actor_buffers import ActorBuffers
from viewer.rendering.gpu.draw_state import draw_nearest, without_depth_writes
from viewer.rendering.gpu.program import Programs
from viewer.rendering.gpu.target import Target
from viewer.rendering.lighting import Lighting
from viewer.rendering.lineup import Group, Lineup, has_joint_marks, placement_of, shows_mesh
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.background_pass import BackgroundPass, is_light
from viewer.rendering.passes.ground_pass import GroundPass
from viewer.rendering.passes.instance_pass import draw_instances
from viewer.rendering.passes.joint_pass import JointPass
from viewer.rendering.passes.late_passes import LatePasses
from viewer.rendering.passes.mesh_pass import MeshPass, draw_layer
from viewer.rendering.sampling import jittered, n_passes, pass_sample
from viewer.rendering.scalar_quantities import ScalarQuantities
from viewer.rendering.view import View, view_of
from viewer.rendering.visibility import (
    Meshes,
    far_first,
    prepare_meshes,
    update_meshes,
    update_skeletons,
)
from viewer.rigs.arrays import Floats
from viewer.rigs.scene import Actor, Scene

if TYPE_CHECKING:
    from viewer.rendering.overlay.annotation import Annotation, Marks
    from viewer.rendering.passes.ghost_pass import Ghost
    from viewer.rendering.passes.outline_pass import Outlined
    from viewer.rendering.picking import Pick


class Renderer:
    """Owner of all programs, passes and buffers needed for drawing.

    ``marks`` are drawn over everything except annotations and legends, ``annotations`` over
    everything except legends. ``names_left_out``: number of joint names omitted from the last image
    for lack of room, and number of joints in the image.
    """

    def __init__(self, programs: Programs) -> None:
        self.programs, self.context = programs, programs.context
        context = self.context
        self.notes: list[str] = []
        self.scalars = ScalarQuantities()
        self.mesh_pass = MeshPass(context, programs)
        self.joint_pass = JointPass(context, programs)
        self.background_pass = BackgroundPass(context, programs)
        self.ground_pass = GroundPass(context, programs)
        self.buffers = ActorBuffers(
            context, programs, self.joint_pass.cube, self.notes, self.mesh_pass.forget
        )
        self.marks: Marks | None = None
        self.annotations: Sequence[Annotation] = ()
        self.ghost: Ghost | None = None
        self.names_left_out = 0, 0
        self.lighting = Lighting(context, programs)
        self.late = LatePasses(context, programs, self.mesh_pass, self.joint_pass, self.buffers)

    def draw(
        self,
        scene: Scene,
        camera: Camera,
        options: DisplayOptions,
        target: Target,
        box: Floats,
        selected: tuple[int, int] = (0, -1),
        passes: range | None = None,
        strength: float = 1.0,
    ) -> None:
        """Draw a scene, without actors that are hidden, or absent at this time.

        ``box``: (2, 3), bounds for the ground grid and the depth range, scene space: ``scene_box``
        of the pose in which the scene was opened. ``selected``: index of an actor and of its
        highlighted joint, -1 for none. The joint is also used for a scalar quantity that needs one
        and does not specify it. ``passes``: passes of final quality to draw now, in order from 0;
        all if omitted. The target shows the average of the passes drawn so far. ``strength``: of
        shadows and occlusion.
        """
        note = f"{target.asked_samples} samples per pixel requested, {target.samples or 1} drawn"
        if target.asked_samples > max(target.samples, 1) and note not in self.notes:
            self.notes.append(note)
        self.buffers.keep_only(scene.actors)
        target.framebuffer.use()
        view = view_of(camera, target.size, depth_bounds(scene, camera.fixed, options, box))
        lineup = self.buffers.line_up(scene.actors, options)
        meshes = self._update(scene, lineup, view, options, selected)
        parts = self.programs, self.mesh_pass, self.late, self.buffers
        casters = Casters(*parts, meshes, lineup, options)
        self.lighting.begin(casters, camera.up, box)
        count = n_passes(options)
        for index in range(count) if passes is None else passes:
            one = pass_sample(index, count)
            shifted = jittered(view, one.shift, target.size)
            lit = self.lighting.light(casters, shifted, target.size, one, strength)
            self._set_state(target)
            self.background_pass.draw(target, options.background)
            self._draw_layers(scene, lineup, meshes, lit, options, target, box, selected, strength)
            if count > 1:
                self._accumulate(target, index == 0)
        self._draw_overlays(scene, view, options, target.size, box, selected)
        if options.outline:
            from viewer.rendering.passes.outline_pass import Outlined

            self.late.outline_pass.draw([Outlined(*selected)], scene, view, options, target)
        if options.legend and options.shading == "scalar" and meshes:
            legend = self.scalars.legend
            assert legend is not None  # meshes were drawn with values, so there is a legend
            width, height = target.size
            note = f"an image of {width} x {height} pixels has no room for a legend"
            light = is_light(options.background)
            is_drawn = self.late.legend_pass.draw(legend, target.size, light)
            if not is_drawn and note not in self.notes:
                self.notes.append(note)

    def _draw_layers(
        self,
        scene: Scene,
        lineup: Lineup,
        meshes: Meshes,
        view: View,
        options: DisplayOptions,
        target: Target,
        box: Floats,
        selected: tuple[int, int],
        strength: float,
    ) -> None:
        """Draw everything that is part of the scene, starting with the background."""
        if options.background == "environment":
            self.late.backdrop_pass.draw(view, options.lights)
        draw_image_behind(self.late, scene, view, options, target.size)
        self.late.use_pictures(meshes.uploaded, options)
        opaque = meshes.opaque(options)
        draw = partial(self._draw_layer, opaque, view, options, blended=False)
        draw_layer(self.context, options, draw)
        for actor, mesh in opaque.singles:
            self.mesh_pass.draw_lines(mesh, placement_of(actor, options), view, options)
        draw_image_planes(self.late, scene, view, options, box)
        index = selected[0]
        chosen = scene.actors[index] if 0 <= index < len(scene.actors) else None
        skeletons = [
            (actor, selected[1] if actor is chosen else -1) for actor in lineup.skeletons_alone
        ]
        for group in lineup.joint_groups:
            if not shows_mesh(group.actors[0].figure, options):
                self._draw_joint_group(group, view, options, chosen, selected[1])
        for actor, joint in skeletons:
            if not shows_mesh(actor.figure, options):
                self._draw_skeleton(actor, view, options, joint, 1.0)
        if options.has_shadows:
            self.lighting.draw_ground(view, box, strength)
        if options.grid:
            self.ground_pass.draw_grid(view, box, options.background)
        self._draw_translucent(meshes.translucent(options), view, options)
        if any(mesh.is_blended for mesh in opaque.uploaded):
            with without_depth_writes(self.context):
                self._draw_layer(far_first(opaque, options, view), view, options, blended=True)
        for actor in lineup.points:
            points = self.buffers.points_of(actor)
            self.late.point_pass.draw(points, actor.placement, view, options, bool(meshes))
        self.late.draw_motion_paths(scene, view, options, target.size)
        for group in lineup.joint_groups:
            if shows_mesh(group.actors[0].figure, options):
                self._draw_joint_group(group, view, options, chosen, selected[1], overlays=True)
        for actor, joint in skeletons:
            if shows_mesh(actor.figure, options):
                opacity = self.buffers.skeleton(actor).opacity(options)
                self._draw_skeleton(actor, view, options, joint, opacity, overlays=True)
        for actor in lineup.markers:
            markers = self.buffers.keypoints_of(actor)
            markers.update(actor.pose, options.skinning)
            # Marker positions already include the placement of the pose.
            place, opacity = actor.placement, options.opacity * actor.opacity
            self.late.keypoint_pass.draw(markers, place, view, options, opacity)

    def _draw_overlays(
        self,
        scene: Scene,
        view: View,
        options: DisplayOptions,
        size: tuple[int, int],
        box: Floats,
        selected: tuple[int, int],
    ) -> None:
        """Draw joint marks, ghost, marks and annotations over the scene; all labels come last."""
        marked: list[Annotation] = []
        if has_joint_marks(options):
            from viewer.rendering.overlay.joint_marks import joint_annotation

            joints = joint_annotation(scene.actors, options, size, selected)
            if joints is not None:
                self.late.annotation_pass.draw(joints, view, size)
                marked.append(joints)
        if self.ghost is not None:
            self.late.ghost_pass.draw(self.ghost, view, options)
        over = frusta_of(scene, view.camera.fixed, options, box, size)
        if self.marks is not None:
            from viewer.rendering.overlay.annotation import mark_annotation

            over.insert(0, mark_annotation(self.marks))
        over += self.annotations
        for annotation in over:
            self.late.annotation_pass.draw(annotation, view, size)
        self.names_left_out = 0, 0
        if marked or over:
            left_out = self.late.annotation_pass.write([*marked, *over], view, size)
            self.names_left_out = left_out[0] if marked else (0, 0)

    def _accumulate(self, target: Target, is_first: bool) -> None:
        """Add the pass in a target, and replace it by the average of all passes so far."""
        summed = self.late.accumulation(target.size)
        if is_first:
            summed.clear()
        summed.add(target)
        summed.show(target)
        self._set_state(target)

    def pick(
        self,
        scene: Scene,
        camera: Camera,
        options: DisplayOptions,
        size: tuple[int, int],
        x: float,
        y: float,
        box: Floats,
    ) -> Pick | None:
        """Return the object at a pixel or within three pixels of it; None if there is none."""
        self.buffers.keep_only(scene.actors)
        return self.late.pick_pass.pick(scene, view_of(camera, size, box), options, size, (x, y))

    def draw_outlines(
        self,
        outlined: Sequence[Outlined],
        scene: Scene,
        camera: Camera,
        options: DisplayOptions,
        target: Target,
        box: Floats,
    ) -> None:
        """Draw only outlines, with straight alpha; see ``draw`` for the parameters."""
        self._set_state(target)
        self.background_pass.draw(target, "transparent")
        view = view_of(camera, target.size, box)
        self.late.outline_pass.draw(outlined, scene, view, options, target, is_layer=True)

    def prepare(self, scene: Scene) -> None:
        """Upload a scene's buffers in advance, so that a failure leaves the previous scene."""
        # Whatever was uploaded before a failure is freed.
        with self.buffers.guard():
            options = DisplayOptions()
            prepare_meshes(self.buffers, self.buffers.line_up(scene.actors, options), options)
            for actor in scene.actors:
                if actor.figure.mesh is not None:
                    self.buffers.mesh(actor.figure)
                if actor.figure.skeleton is not None:
                    self.buffers.skeleton(actor)

    def _update(
        self,
        scene: Scene,
        lineup: Lineup,
        view: View,
        options: DisplayOptions,
        selected: tuple[int, int],
    ) -> Meshes:
        """Skin changed meshes, and upload other changed data."""
        meshes = update_meshes(self.buffers, lineup, options)
        if options.shading == "scalar" and meshes.singles:
            index, joint = selected
            whose = scene.actors[index] if 0 <= index < len(scene.actors) else None
            figures = [actor.figure for actor in scene.actors if actor.figure.mesh is not None]
            values = [(actor, mesh.scalars) for actor, mesh in meshes.singles]
            self.scalars.update(values, options, (whose, joint), figures)
        update_skeletons(self.buffers, lineup, options)
        for actor in lineup.points:
            points = self.buffers.points_of(actor)
            points.update(actor, actor.placement, view, options)
        return meshes

    def _draw_translucent(self, meshes: Meshes, view: View, options: DisplayOptions) -> None:
        """Draw translucent actors over everything opaque, as a single layer."""
        # Where they overlap, only the nearest surface is visible, so the poses of a motion stay
        # legible. Depth decides what that is, so they need no order.
        if not meshes:
            return

        def draw() -> None:
            for blended in (False, True):
                self._draw_layer(meshes, view, options, blended)

        draw_nearest(self.context, draw)
        for actor, mesh in meshes.singles:
            place, opacity = placement_of(actor, options), options.opacity * actor.opacity
            self.mesh_pass.draw_lines(mesh, place, view, options, opacity)

    def _draw_layer(
        self, meshes: Meshes, view: View, options: DisplayOptions, blended: bool
    ) -> None:
        for actor, mesh in meshes.singles:
            if mesh.mesh.is_blended or not blended:
                placement, opacity = placement_of(actor, options), options.opacity * actor.opacity
                self.mesh_pass.draw(mesh, placement, view, options, actor.color, blended, opacity)
        for _, instances in meshes.instanced:
            if instances.mesh.is_blended or not blended:
                draw_instances(self.programs, instances, view, options, blended)

    def _set_state(self, target: Target) -> None:
        """Bind a target with the state that all passes expect."""
        target.framebuffer.use()
        context = self.context
        context.viewport = (0, 0, *target.size)
        context.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND)
        context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        context.depth_func = "<"

    def _draw_joint_group(
        self,
        group: Group,
        view: View,
        options: DisplayOptions,
        chosen: Actor | None,
        joint: int,
        overlays: bool = False,
    ) -> None:
        # Over skins, all of them are a single layer: only the nearest joints are visible.
        skeleton = self.buffers.joint_group(group)
        numbers = [number for number, actor in enumerate(group.actors) if actor is chosen]
        if joint >= 0 and numbers:
            joint += numbers[0] * skeleton.n_joints
        selected = joint if numbers else -1
        opacity = skeleton.opacity(options) if overlays else 1.0
        how = view, options, selected, opacity
        self.joint_pass.draw(skeleton, skeleton.placement, *how, overlays=overlays)

    def _draw_skeleton(
        self,
        actor: Actor,
        view: View,
        options: DisplayOptions,
        selected: int,
        opacity: float,
        overlays: bool = False,
    ) -> None:
        skeleton, placement = self.buffers.skeleton(actor), placement_of(actor, options)
        how = selected, opacity * options.opacity * actor.opacity, actor.color, overlays
        self.joint_pass.draw(skeleton, placement, view, options, *how)

    def release(self) -> None:
        """Free everything except the programs."""
        self.buffers.keep_only([])
        passes = (
            *(self.mesh_pass, self.joint_pass, self.background_pass, self.ground_pass),
            *(self.late, self.lighting),
        )
        for item in passes:
            item.release()
