"""Targets of ``.morph`` files: where some vertices of a mesh go, as blend shapes of a figure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from viewer.errors import RigError
from viewer.rig.arrays import Floats, Ints, frozen
from viewer.rig.blendshapes import BlendShapes
from viewer.rig.figure import Figure
from viewer.rig.skeleton import Skeleton
from viewer.rig.skin import Skin

__all__ = ["MORPH_GROUP", "MorphTarget", "on_one_joint", "with_morphs"]

MORPH_GROUP = "morph"
"""Of blend shapes whose weight 1 is a target reached, and 0 is the mesh as it is."""


@dataclass(frozen=True, slots=True, eq=False)
class MorphTarget:
    """Where some vertices of a mesh are, not how far they go.

    Attributes
    ----------
    name : str
        What its slider is called.
    vertices : (N,) int32
        Indices into the mesh, none twice.
    positions : (N, 3)
        In the mesh's own space and unit.
    normals : (N, 3) or None
        As stored; None leaves those of the mesh.
    """

    name: str
    vertices: Ints
    positions: Floats
    normals: Floats | None = None

    def __post_init__(self) -> None:
        vertices = frozen("vertices", self.vertices, (None,), np.int32)
        object.__setattr__(self, "vertices", vertices)
        shape = (len(vertices), 3)
        object.__setattr__(self, "positions", frozen("positions", self.positions, shape))
        if self.normals is not None:
            object.__setattr__(self, "normals", frozen("normals", self.normals, shape))
        if len(np.unique(vertices)) < len(vertices):
            raise RigError(f"morph {self.name}: a vertex is listed twice")


def with_morphs(figure: Figure, targets: Sequence[MorphTarget]) -> Figure:
    """Return a figure with a blend shape for each target: p = p0 + sum_k w_k (target_k - p0).

    Normals follow by the same formula, before skinning. Joints stay where they are.

    Parameters
    ----------
    figure : Figure
        With a mesh; its own blend shapes, if any, come first and must be morphs too.
    targets : sequence of MorphTarget
        Any number.

    Returns
    -------
    Figure
        The figure itself if there are no targets.

    Raises
    ------
    RigError
        If a vertex index lies outside the mesh, or the figure has no mesh, or shapes of another
        kind.
    """
    if not targets:
        return figure
    mesh, shapes = figure.mesh, figure.blend_shapes
    if mesh is None:
        raise RigError(f"morph {targets[0].name}: {figure.name} has no mesh to change")
    if shapes is not None and shapes.normal_offsets is None:
        raise RigError(f"morph {targets[0].name}: {figure.name} has shapes of its own")
    for target in targets:
        _check_vertices(target, figure.name, mesh.n_vertices)
    count = len(targets)
    offsets = np.zeros((2, count, mesh.n_vertices, 3))
    for row, target in enumerate(targets):
        offsets[0, row, target.vertices] = target.positions - mesh.positions[target.vertices]
        if target.normals is not None:
            offsets[1, row, target.vertices] = target.normals - mesh.normals[target.vertices]
    names, groups = tuple(target.name for target in targets), (MORPH_GROUP,) * count
    if shapes is not None and shapes.normal_offsets is not None:
        names, groups = shapes.names + names, shapes.groups + groups
        known = np.stack([shapes.direction_values(), shapes.normal_values()])
        offsets = np.concatenate([known, offsets], axis=1)
    offsets.flags.writeable = False  # so that nobody has to copy it
    return replace(figure, blend_shapes=BlendShapes(names, offsets[0], groups, offsets[1]))


def on_one_joint(figure: Figure) -> Figure:
    """Return a mesh without a skeleton on a single joint that never moves.

    Blend shapes have their weights in a pose, and poses are of skeletons. The mesh stays in its
    binding space.

    Parameters
    ----------
    figure : Figure
        With a mesh; its skin, which no skeleton moves, is replaced.
    """
    mesh = figure.require_mesh()
    empty = np.zeros(0, dtype=np.int32)
    skeleton = Skeleton(
        names=("binding",),
        parents=np.array([-1], dtype=np.int32),
        rest_translations=np.zeros((1, 3)),
        rest_rotations=np.array([[0.0, 0.0, 0.0, 1.0]]),
        rest_scales=np.ones((1, 3)),
        dof_joints=empty,
        dof_kinds=empty,
        rest_dofs=np.zeros(0),
        dof_limits=np.zeros((0, 2)),
    )
    skin = Skin(
        starts=np.arange(mesh.n_vertices + 1, dtype=np.int32),
        joints=np.zeros(mesh.n_vertices, dtype=np.int32),
        weights=np.ones(mesh.n_vertices),
        inverse_bind=np.eye(4)[None],
    )
    return replace(figure, skeleton=skeleton, skin=skin)


def _check_vertices(target: MorphTarget, figure_name: str, count: int) -> None:
    wrong = np.flatnonzero((target.vertices < 0) | (target.vertices >= count))
    if len(wrong):
        raise RigError(
            f"morph {target.name}: vertex index {target.vertices[wrong[0]]} is outside "
            f"{figure_name}, which has {count} vertices"
        )
