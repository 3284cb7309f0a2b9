"""The solid parts of a scene, drawn from any point of view without materials, and their bounds."""

from __future__ import annotations

import moderngl
import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.gpu.actor_buffers import ActorBuffers
from viewer.rendering.gpu.index_sets import MeshRun
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.joint_spheres import (
    Bounds,
    bounds_of,
    box_spheres,
    moved_spheres,
    skin_spheres,
    stretch_bounds,
)
from viewer.rendering.lineup import Lineup, placement_of, shows_mesh, shows_skeleton
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.instance_pass import draw_instance_shapes
from viewer.rendering.passes.joint_pass import draw_joints, joint_program, skeleton_size
from viewer.rendering.passes.late_passes import LatePasses
from viewer.rendering.passes.mesh_pass import MeshPass
from viewer.rendering.view import View
from viewer.rendering.visibility import Meshes
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.kinematics import posed_skeleton
from viewer.rigs.memo import Memo
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.scene import Actor
from viewer.rigs.shape import shaped, shaped_skeleton
from viewer.rigs.skeleton import Skeleton

_BONE = 0.075  # how far ends, axes and half-widths reach, relative to the skeleton's size at rest
_sizes: Memo[Figure, float] = Memo()


@dataclass(frozen=True, slots=True)
class Casters:
    """Shadow casters and occluders of one image; all their buffers are up to date."""

    programs: Programs
    mesh_pass: MeshPass
    late: LatePasses
    buffers: ActorBuffers
    """Programs and passes for drawing, and the drawn buffers."""
    meshes: Meshes
    """Surfaces."""
    lineup: Lineup
    """The drawn actors."""
    options: DisplayOptions
    threshold: float = 0.5
    """Actors with at most this opacity are omitted, 0 to 1. Averaged over passes with evenly spread
    thresholds, the strength of an actor's shadow equals its opacity. Blended materials cover a
    part of each pass's shadow map."""

    def draw(self, view: View, fragment: str) -> None:
        """Draw all shapes with a fragment shader that shows no colours."""
        options = self.options
        for actor, mesh in self.meshes.singles:
            if not self._blocks(actor):
                continue
            placement = placement_of(actor, options)
            self.mesh_pass.draw_shape(mesh, placement, view, options, fragment, self._prepare)
        for _, instances in self.meshes.instanced:
            if count := instances.count_above(self.threshold):
                how = view, options, fragment, self._prepare
                draw_instance_shapes(self.programs, instances, *how, count)
        # Over a skin, a skeleton is an overlay and casts no shadow.
        for group in self.lineup.joint_groups:
            if shows_mesh(group.actors[0].figure, options):
                continue
            skeleton = self.buffers.joint_group(group)
            program = joint_program(self.programs, skeleton, options, "", fragment)
            draw_joints(program, skeleton, skeleton.placement, view, options)
        for actor in self.lineup.skeletons_alone:
            if self._blocks(actor) and not shows_mesh(actor.figure, options):
                skeleton, placement = self.buffers.skeleton(actor), placement_of(actor, options)
                program = joint_program(self.programs, skeleton, options, "", fragment)
                draw_joints(program, skeleton, placement, view, options)
        for actor in self.lineup.points:
            if self._blocks(actor):
                points = self.buffers.points_of(actor)
                self.late.point_pass.draw_shapes(points, actor.placement, view, fragment)

    def state(self) -> list[object]:
        """Return what decides about the drawn shapes, apart from the options, to compare."""
        found: list[object] = [self.lineup]
        for group, instances in self.meshes.instanced:
            found += [group, instances, instances.n_updates, group.crowd.placement_version]
        for group in self.lineup.joint_groups:
            found += [group, group.crowd.version, group.crowd.placement_version]
        for _, mesh in self.meshes.singles:
            found += [mesh, mesh.n_updates]
        for actor in self.lineup.alone:
            pose = actor.own_pose
            found += [placement_of(actor, self.options).tobytes(), pose and pose.skinning_key]
        if self.lineup.points:
            found.append(object())  # their size depends on the camera: always different
        return found

    def _blocks(self, actor: Actor) -> bool:
        """Return whether an actor is opaque enough to block light in this pass."""
        return self.options.opacity * actor.opacity > self.threshold

    def _prepare(self, program: moderngl.Program, run: MeshRun) -> None:
        """Set the phase of the pattern by which blended surfaces block part of the light."""
        if run.surface.is_blended:
            set_uniforms(program, {"u_threshold": self.threshold})

    def largest_mesh(self) -> float:
        """Return the size of the largest mesh at rest, scene units; 0 without meshes."""
        sizes = [
            mesh_size(instances.mesh.figure) * instances.largest_scale
            for _, instances in self.meshes.instanced
        ]
        for group in self.lineup.joint_groups:
            if group.actors[0].figure.mesh is not None:
                scale = float(stretch_bounds(group.crowd.models[group.rows]).max())
                sizes.append(mesh_size(group.actors[0].figure) * scale)
        for actor in self.lineup.alone:
            if actor.figure.mesh is not None:
                scale = float(stretch_bounds(placement_of(actor, self.options)))
                sizes.append(mesh_size(actor.figure) * scale)
        return max(sizes, default=0.0)

    def bounds(self) -> list[Bounds]:
        """Return the bounds of all drawn actors, without those whose pose is not finite."""
        found = [instances.bounds() for _, instances in self.meshes.instanced]
        for group in self.lineup.joint_groups:
            figure, crowd = group.actors[0].figure, group.crowd
            skeleton = shaped_skeleton(figure, crowd.shape_weights)
            spheres = _joint_spheres(figure, skeleton, self.buffers.joint_group(group).worlds)
            found.append(bounds_of(moved_spheres(crowd.models[group.rows], spheres)))
        for actor in (*self.lineup.alone, *self.lineup.beside):
            found.append(bounds_of(spheres_of(actor, self.options)[None]))
        return [one for one in found if len(one.spheres)]


def mesh_size(figure: Figure) -> float:
    """Return the size of a figure's mesh at rest, figure units."""
    return _sizes.get(figure, None, lambda: box_size(bounding_box(figure.require_mesh().positions)))


def spheres_of(actor: Actor, options: DisplayOptions) -> Floats:
    """Return spheres, (N, 4) centre and radius in scene space, around an actor's drawn parts."""
    # They are computed from its joints alone.
    parts = []
    if shows_mesh(actor.figure, options):
        parts.append(_mesh_spheres(actor, options))
    if shows_skeleton(actor, options):
        pose = actor.pose
        skeleton = shaped_skeleton(actor.figure, pose.shape_weights)
        world = posed_skeleton(skeleton, pose).world[None]
        parts.append(_joint_spheres(actor.figure, skeleton, world)[0])
    placement = placement_of(actor, options)
    found = np.concatenate(parts or [np.zeros((0, 4))])
    if actor.points is not None:
        seen = actor.points[:, 3] > 0.0
        places = np.pad(actor.points[seen, :3], ((0, 0), (0, 1)))
        found = np.concatenate([found, places])
    centers = found[:, :3] @ placement[:3, :3].T + placement[:3, 3]
    return np.column_stack([centers, found[:, 3] * stretch_bounds(placement[None])])


def _mesh_spheres(actor: Actor, options: DisplayOptions) -> Floats:
    figure, pose = actor.figure, actor.own_pose
    if options.show == "binding" or pose is None or not figure.is_attached:
        return box_spheres(bounding_box(figure.require_mesh().positions))
    figure = shaped(figure, pose.shape_weights)
    palette = posed_skeleton(figure.require_skeleton(), pose).palette(figure.require_skin())
    return skin_spheres(figure, palette)


def _joint_spheres(figure: Figure, skeleton: Skeleton, world: Floats) -> Floats:
    """Return spheres (A, N, 4) around bones and joint boxes of world matrices (A, J, 4, 4)."""
    entries = np.moveaxis(world, (-1, -2, -3), (0, 1, 2))  # columns, rows, joints, poses
    places = entries[3, :3]
    bones = np.concatenate([places, np.full_like(places[:1], _BONE * skeleton_size(figure))])
    if skeleton.boxes is None:
        return bones.T
    middles, halves = skeleton.boxes.mean(axis=1), 0.5 * np.ptp(skeleton.boxes, axis=1)
    centers = np.einsum("kija,jk->ija", entries[:3, :3], middles) + places
    radii = np.linalg.norm(halves, axis=1)[:, None] * stretch_bounds(world).T
    return np.concatenate([bones, np.concatenate([centers, radii[None]])], axis=1).T
