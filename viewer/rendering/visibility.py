"""Update of the buffers of what is drawn, before it is drawn."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.gpu.actor_buffers import ActorBuffers
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.lineup import Group, Lineup, placement_of, shows_mesh
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.instance_pass import InstanceBuffers
from viewer.rendering.view import View
from viewer.rigs.motion.instances import posed_worlds
from viewer.rigs.pose import Pose
from viewer.rigs.scene import Actor
from viewer.rigs.shape import shaped_skeleton


@dataclass(frozen=True, slots=True)
class Meshes:
    """The meshes of an image: those drawn individually, and those drawn as instances."""

    singles: list[tuple[Actor, PosedMesh]] = field(default_factory=list)
    instanced: list[tuple[Group, InstanceBuffers]] = field(default_factory=list)

    def __bool__(self) -> bool:
        return bool(self.singles or self.instanced)

    @property
    def uploaded(self) -> list[MeshBuffers]:
        """Uploaded meshes of the figures."""
        singles = [mesh.mesh for _, mesh in self.singles]
        return singles + [instances.mesh for _, instances in self.instanced]

    def opaque(self, options: DisplayOptions) -> Meshes:
        """Return the opaque meshes."""
        return Meshes(
            [one for one in self.singles if options.opacity * one[0].opacity == 1.0],
            [one for one in self.instanced if not one[0].crowd.is_translucent],
        )

    def translucent(self, options: DisplayOptions) -> Meshes:
        """Return the translucent meshes, without those of opacity 0 that are drawn individually."""
        return Meshes(
            [one for one in self.singles if 0.0 < options.opacity * one[0].opacity < 1.0],
            [one for one in self.instanced if one[0].crowd.is_translucent],
        )


def prepare_meshes(buffers: ActorBuffers, lineup: Lineup, options: DisplayOptions) -> Meshes:
    """Upload the buffers of a lineup's meshes, without skinning posed buffers."""
    meshes = Meshes()
    size = 0
    of_figure: dict[int, list[Group]] = {}
    for group in lineup.groups:
        of_figure.setdefault(id(group.actors[0].figure), []).append(group)
    for groups in of_figure.values():
        instanced = buffers.instanced(groups[0].actors[0].figure, len(groups))
        for group, instances in zip(groups, instanced, strict=True):
            size += len(group.rows) * instances.vertices.size
            instances.vertices.reserve(len(group.rows), buffers.shared_after(size))
            meshes.instanced.append((group, instances))
    for actor in lineup.alone:
        if shows_mesh(actor.figure, options):
            meshes.singles.append((actor, buffers.posed_mesh(actor)))
    return meshes


def update_meshes(buffers: ActorBuffers, lineup: Lineup, options: DisplayOptions) -> Meshes:
    """Skin changed meshes before drawing; a framebuffer must be bound."""
    meshes = prepare_meshes(buffers, lineup, options)
    for actor, mesh in meshes.singles:
        pose = None if options.show == "binding" else actor.own_pose
        mesh.hidden_parts = actor.hidden_parts
        mesh.update(pose, options.skinning)
    for group, instances in meshes.instanced:
        instances.update(group, options.skinning)
    return meshes


def update_skeletons(buffers: ActorBuffers, lineup: Lineup, options: DisplayOptions) -> None:
    """Upload the joint matrices of all drawn skeletons that moved, computed per figure."""
    groups: dict[tuple[int, bytes], list[tuple[Actor, Pose]]] = {}
    for joint_group in lineup.joint_groups:
        buffers.joint_group(joint_group).update_group(joint_group)
    for actor in lineup.skeletons_alone:
        pose = actor.own_pose
        if pose is not None and not buffers.skeleton(actor).is_current(pose, options):
            key = id(actor.figure), pose.shape_weights.tobytes()
            groups.setdefault(key, []).append((actor, pose))
    for group in groups.values():
        poses = [pose for _, pose in group]
        skeleton = shaped_skeleton(group[0][0].figure, poses[0].shape_weights)
        # Matrices are computed in one batch, and each pose caches its result.
        posed_worlds(skeleton, poses)
        for actor, pose in group:
            buffers.skeleton(actor).update(pose, options)


def far_first(meshes: Meshes, options: DisplayOptions, view: View) -> Meshes:
    """Return the same meshes, with those drawn individually sorted from farthest to nearest."""

    def depth(single: tuple[Actor, PosedMesh]) -> float:
        center = placement_of(single[0], options) @ np.append(single[1].center, 1.0)
        return float(view.matrix[2] @ center)

    return Meshes(sorted(meshes.singles, key=depth), meshes.instanced)
