"""Draws a scene into the bound framebuffer; the same for a window and a picture file."""

from __future__ import annotations

import moderngl

from viewer.rendering.camera import Camera
from viewer.rendering.ground_pass import GroundPass
from viewer.rendering.joint_pass import JointPass, SkeletonBuffers
from viewer.rendering.keypoint_pass import KeypointBuffers, KeypointPass
from viewer.rendering.mesh_buffers import MeshBuffers
from viewer.rendering.mesh_pass import MeshPass
from viewer.rendering.options import DisplayOptions
from viewer.rendering.program import Programs
from viewer.rendering.skin_pass import PosedMesh
from viewer.rendering.target import Target
from viewer.rendering.view import View, view_of
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.pose import placement_matrix
from viewer.rig.scalars import SCALARS
from viewer.rig.scene import Actor, Scene

__all__ = ["Renderer"]


class Renderer:
    """Owns everything that drawing needs: programs, passes, and what was uploaded.

    Parameters
    ----------
    context : moderngl.Context
        OpenGL 3.3 or newer.

    Attributes
    ----------
    notes : list of str
        What the driver could not do as asked, one line each.
    scalar_range : (float, float)
        Lowest and highest number of the scalar view drawn last, over all figures.
    """

    def __init__(self, context: moderngl.Context) -> None:
        self.context = context
        self.notes: list[str] = []
        self.scalar_range = 0.0, 0.0
        self.programs = Programs(context)
        self.mesh_pass = MeshPass(context, self.programs)
        self.joint_pass = JointPass(context, self.programs)
        self.keypoint_pass = KeypointPass(self.joint_pass)
        self.ground_pass = GroundPass(context, self.programs)
        self._meshes: dict[int, MeshBuffers] = {}
        self._posed: dict[int, tuple[Actor, PosedMesh]] = {}
        self._skeletons: dict[int, tuple[Actor, SkeletonBuffers]] = {}
        self._keypoints: dict[int, tuple[Actor, KeypointBuffers]] = {}

    def draw(
        self,
        scene: Scene,
        camera: Camera,
        options: DisplayOptions,
        target: Target,
        box: Floats,
        selected: tuple[int, int] = (0, -1),
    ) -> None:
        """Draw a scene.

        Parameters
        ----------
        scene : Scene
            Actors that are not visible are left out.
        camera : Camera
            The point of view.
        options : DisplayOptions
            What is shown and how.
        target : Target
            Drawn into, not yet resolved.
        box : (2, 3)
            What the grid lies under and the depth range covers, scene space: ``scene_box`` of
            the pose in which the scene was opened.
        selected : (int, int)
            An actor's index and a joint of it that is drawn in a highlight colour, -1 for none.
        """
        self._note_samples(target)
        self._forget_others(scene)
        target.framebuffer.use()
        view = view_of(camera, target.size, box)
        meshes = self._update(scene, options)
        self._prepare(target)
        self.ground_pass.draw_background(options.background)
        for actor, mesh in meshes:
            self._draw_mesh(actor, mesh, view, options)
        skeletons = [
            (actor, selected[1] if index == selected[0] else -1)
            for index, actor in enumerate(scene.actors)
            if _shows_skeleton(actor, options)
        ]
        for actor, joint in skeletons:
            if not _shows_mesh(actor.figure, options):
                self._draw_skeleton(actor, view, options, joint, 1.0)
        if options.grid:
            self.ground_pass.draw_grid(view, box, options.background)
        for actor, joint in skeletons:
            if _shows_mesh(actor.figure, options):
                self._draw_skeleton(actor, view, options, joint, options.skeleton_opacity)
        if options.keypoints and options.show != "binding":
            for actor in scene.actors:
                self._draw_keypoints(actor, view, options)

    def prepare(self, scene: Scene) -> None:
        """Upload what a scene needs, so that a refusal comes before the old scene is given up.

        Raises
        ------
        RenderError
            If the driver has no room for it.
        """
        for actor in scene.actors:
            if actor.figure.mesh is not None:
                self.posed_mesh(actor)
            if actor.figure.skeleton is not None:
                self._skeleton(actor)

    def _prepare(self, target: Target) -> None:
        context = self.context
        context.viewport = (0, 0, *target.size)
        target.framebuffer.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
        context.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND)
        context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        context.depth_func = "<"

    def _update(self, scene: Scene, options: DisplayOptions) -> list[tuple[Actor, PosedMesh]]:
        """Skin what changed, before anything is drawn."""
        meshes = []
        for actor in scene.actors:
            if actor.is_drawn and _shows_mesh(actor.figure, options):
                mesh = self.posed_mesh(actor)
                pose = None if options.show == "binding" else actor.pose
                mesh.update(pose, options.skinning)
                if options.shading == "scalar":
                    mesh.scalars.update(options.scalar, pose, options.skinning)
                meshes.append((actor, mesh))
        if options.shading == "scalar" and meshes:
            self._share_range(options.scalar, [mesh for _, mesh in meshes])
        return meshes

    def _share_range(self, name: str, meshes: list[PosedMesh]) -> None:
        """Let the same colour mean the same number on all figures."""
        ranges = [mesh.scalars.range for mesh in meshes]
        low, high = min(low for low, _ in ranges), max(high for _, high in ranges)
        self.scalar_range = low, high
        for mesh in meshes:
            mesh.scalars.shown = SCALARS[name].shown(low, high)

    def _draw_mesh(
        self, actor: Actor, mesh: PosedMesh, view: View, options: DisplayOptions
    ) -> None:
        if options.cull:
            self.context.enable(moderngl.CULL_FACE)
        placement = _placement(actor, options)
        self.mesh_pass.draw(mesh, placement, view, options)
        self.context.disable(moderngl.CULL_FACE)
        self.context.depth_func = "<="
        if options.wireframe:
            self.mesh_pass.draw_edges(mesh, placement, view, options)
        if options.normals and actor.figure.mesh is not None:
            size = box_size(bounding_box(actor.figure.mesh.positions))
            self.mesh_pass.draw_normals(mesh, placement, view, size)
        self.context.depth_func = "<"

    def _draw_skeleton(
        self,
        actor: Actor,
        view: View,
        options: DisplayOptions,
        selected: int,
        opacity: float,
    ) -> None:
        assert actor.pose is not None  # whoever has a skeleton has a pose
        skeleton = self._skeleton(actor)
        skeleton.update(actor.pose)
        placement = _placement(actor, options)
        self.joint_pass.draw(skeleton, placement, view, options, selected, opacity)

    def _draw_keypoints(self, actor: Actor, view: View, options: DisplayOptions) -> None:
        if actor.pose is None or actor.figure.keypoints is None or not actor.is_drawn:
            return
        if id(actor) not in self._keypoints:
            points = KeypointBuffers(self.context, actor.figure, self.joint_pass.cube)
            self._keypoints[id(actor)] = (actor, points)
        points = self._keypoints[id(actor)][1]
        points.update(actor.pose, options.skinning)
        # The markers' place is part of their positions.
        self.keypoint_pass.draw(points, actor.placement, view, options)

    def posed_mesh(self, actor: Actor) -> PosedMesh:
        """Return an actor's posed buffer, made on first use; the figure's mesh must exist."""
        if id(actor) not in self._posed:
            figure = actor.figure
            if id(figure) not in self._meshes:
                self._meshes[id(figure)] = MeshBuffers(self.context, figure, self.notes)
            mesh = PosedMesh(self.context, self.programs, self._meshes[id(figure)])
            self._posed[id(actor)] = (actor, mesh)
        return self._posed[id(actor)][1]

    def _skeleton(self, actor: Actor) -> SkeletonBuffers:
        if id(actor) not in self._skeletons:
            assert actor.figure.skeleton is not None  # the caller looked
            skeleton = SkeletonBuffers(self.context, actor.figure, self.joint_pass.cube)
            self._skeletons[id(actor)] = (actor, skeleton)
        return self._skeletons[id(actor)][1]

    def _note_samples(self, target: Target) -> None:
        note = f"{target.asked_samples} samples a pixel asked for, {target.samples or 1} drawn"
        if target.asked_samples > max(target.samples, 1) and note not in self.notes:
            self.notes.append(note)

    def _forget_others(self, scene: Scene) -> None:
        """Free what belongs to actors that left the scene."""
        present = {id(actor) for actor in scene.actors}
        for key in [key for key in self._posed if key not in present]:
            mesh = self._posed.pop(key)[1]
            self.mesh_pass.forget(mesh)
            mesh.release()
        for key in [key for key in self._skeletons if key not in present]:
            self._skeletons.pop(key)[1].release()
        for key in [key for key in self._keypoints if key not in present]:
            self._keypoints.pop(key)[1].release()
        figures = {id(actor.figure) for actor in scene.actors}
        for key in [key for key in self._meshes if key not in figures]:
            self._meshes.pop(key).release()

    def release(self) -> None:
        """Free everything."""
        self._forget_others(Scene([]))
        for item in (self.mesh_pass, self.joint_pass, self.ground_pass, self.programs):
            item.release()


def _shows_mesh(figure: Figure, options: DisplayOptions) -> bool:
    return figure.mesh is not None and (options.show != "skeleton" or figure.skeleton is None)


def _shows_skeleton(actor: Actor, options: DisplayOptions) -> bool:
    figure = actor.figure
    wanted = options.show in ("skeleton", "both") or figure.mesh is None
    return actor.is_drawn and figure.skeleton is not None and wanted


def _placement(actor: Actor, options: DisplayOptions) -> Floats:
    """Return where an actor stands: its placement, then that of its pose."""
    if actor.pose is None or options.show == "binding":
        return actor.placement
    return actor.placement @ placement_matrix(actor.pose)
