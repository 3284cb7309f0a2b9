"""Visibility: which parts of a scene are drawn, and the update of their buffers before that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field

import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.gpu.actor_buffers import ActorBuffers
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.instance_pass import InstanceBuffers
from viewer.rendering.view import View
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.pose import Pose, placement_matrix
from viewer.rigs.scene import Actor
from viewer.rigs.shape import shaped_skeleton


@dataclass(frozen=True, slots=True)
class Meshes:
    """The meshes of an image: those drawn individually, and those drawn as instances."""

    singles: list[tuple[Actor, PosedMesh]] = field(default_factory=list)
    instanced: list[tuple[list[Actor], InstanceBuffers]] = field(default_factory=list)

    def __bool__(self) -> bool:
        return bool(self.singles or self.instanced)

    @property
    def uploaded(self) -> list[MeshBuffers]:
        """Uploaded meshes of the figures."""
        singles = [mesh.mesh for _, mesh in self.singles]
        return singles + [instances.mesh for _, instances in self.instanced]

    def opaque(self, options: DisplayOptions) -> list[tuple[Actor, PosedMesh]]:
        """Return the opaque meshes that are drawn individually."""
        return [one for one in self.singles if options.opacity * one[0].opacity == 1.0]


def prepare_meshes(
    buffers: ActorBuffers, actors: Sequence[Actor], options: DisplayOptions
) -> Meshes:
    """Upload the buffers of the actors' meshes, without skinning posed buffers."""
    meshes = Meshes()
    actors = [actor for actor in actors if shows_mesh(actor.figure, options)]
    of_figure: dict[int, list[list[Actor]]] = {}
    size = 0
    for group in buffers.groups(actors, options):
        of_figure.setdefault(id(group[0].figure), []).append(group)
    for groups in of_figure.values():
        instanced = buffers.instanced(groups[0][0].figure, len(groups))
        for group, instances in zip(groups, instanced, strict=True):
            size += len(group) * instances.vertices.size
            instances.vertices.reserve(len(group), buffers.shared_after(size))
            meshes.instanced.append((group, instances))
    together = {id(actor) for group, _ in meshes.instanced for actor in group}
    for actor in actors:
        if id(actor) not in together:
            meshes.singles.append((actor, buffers.posed_mesh(actor)))
    return meshes


def update_meshes(
    buffers: ActorBuffers, actors: Sequence[Actor], options: DisplayOptions
) -> Meshes:
    """Skin changed meshes before drawing; a framebuffer must be bound."""
    meshes = prepare_meshes(buffers, [actor for actor in actors if actor.is_drawn], options)
    for actor, mesh in meshes.singles:
        pose = None if options.show == "binding" else actor.pose
        mesh.hidden_parts = actor.hidden_parts
        mesh.update(pose, options.skinning)
    for group, instances in meshes.instanced:
        instances.update(group, options.skinning)
    return meshes


def update_skeletons(
    buffers: ActorBuffers, actors: Sequence[Actor], options: DisplayOptions
) -> None:
    """Upload the joint matrices of all drawn skeletons that moved, computed per figure."""
    groups: dict[tuple[int, bytes], list[tuple[Actor, Pose]]] = {}
    for actor in with_skeleton(actors, options):
        pose = actor.pose
        if pose is not None and not buffers.skeleton(actor).is_current(pose, options):
            key = id(actor.figure), pose.shape_weights.tobytes()
            groups.setdefault(key, []).append((actor, pose))
    for group in groups.values():
        from viewer.rigs.motion.instances import posed_worlds

        poses = [pose for _, pose in group]
        skeleton = shaped_skeleton(group[0][0].figure, poses[0].shape_weights)
        # Matrices are computed in one batch, and each pose caches its result.
        posed_worlds(skeleton, poses)
        for actor, pose in group:
            buffers.skeleton(actor).update(pose, options)


def shows_mesh(figure: Figure, options: DisplayOptions) -> bool:
    """Return whether a figure's surface is drawn."""
    return figure.mesh is not None and (options.show != "skeleton" or figure.skeleton is None)


def shows_skeleton(actor: Actor, options: DisplayOptions) -> bool:
    """Return whether an actor's joint boxes are drawn."""
    return bool(with_skeleton([actor], options))


def with_skeleton(actors: Sequence[Actor], options: DisplayOptions) -> list[Actor]:
    """Return the actors whose joint boxes are drawn."""
    # Among a thousand actors, the first condition is usually the last.
    wanted = options.show in ("skeleton", "both")
    return [
        actor
        for actor in actors
        if (wanted or actor.figure.mesh is None)
        and actor.is_drawn
        and actor.figure.skeleton is not None
    ]


def has_points(actor: Actor, options: DisplayOptions) -> bool:
    """Return whether an actor's captured points are drawn."""
    return bool(with_points([actor], options))


def with_points(actors: Sequence[Actor], options: DisplayOptions) -> list[Actor]:
    """Return the actors whose captured points are drawn."""
    if not options.captured_keypoints:
        return []
    return [
        actor
        for actor in actors
        if actor.points is not None and actor.is_drawn and actor.figure.points is not None
    ]


def with_markers(actors: Sequence[Actor], options: DisplayOptions) -> list[Actor]:
    """Return the actors with a figure whose keypoints are drawn."""
    if not options.keypoints or options.show == "binding":
        return []
    return [
        actor
        for actor in actors
        if actor.figure.keypoints is not None and actor.is_drawn and actor.pose is not None
    ]


def has_joint_marks(options: DisplayOptions) -> bool:
    """Return whether joint marks are drawn in addition to boxes."""
    wanted = options.joint_names or options.joint_axes or options.xray
    return wanted and options.show != "binding"


def placement_of(actor: Actor, options: DisplayOptions) -> Floats:
    """Return the matrix from figure to scene space: actor placement times pose placement."""
    if actor.pose is None or options.show == "binding":
        return actor.placement
    return actor.placement @ placement_matrix(actor.pose)


def far_first(meshes: Meshes, options: DisplayOptions, view: View) -> Meshes:
    """Return the same meshes, with those drawn individually sorted from farthest to nearest."""

    def depth(single: tuple[Actor, PosedMesh]) -> float:
        center = placement_of(single[0], options) @ np.append(single[1].center, 1.0)
        return float(view.matrix[2] @ center)

    return Meshes(sorted(meshes.singles, key=depth), meshes.instanced)
