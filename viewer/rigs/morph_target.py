"""Morph targets of ``.morph`` files, as blend shapes of a figure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import note
from viewer.errors import RigError
from viewer.phrases import counted
from viewer.rigs.arrays import Floats, Ints, freeze_fields
from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.figure import Figure
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.skin import Skin

MORPH_GROUP = "morph"
"""Group of blend shapes: weight 0 is the unchanged mesh, and weight 1 the target."""


@dataclass(frozen=True, slots=True, eq=False)
class MorphTarget:
    """Target positions of some vertices of a mesh, absolute rather than offsets."""

    name: str
    """Label of its slider."""
    vertices: Ints
    """(N,) int32. Indices into the mesh, without repetition."""
    positions: Floats
    """(N, 3). In the mesh's own space and unit."""
    normals: Floats | None = None
    """(N, 3) or None. Normals as stored; None if the normals of the mesh are unchanged."""

    def __post_init__(self) -> None:
        freeze_fields(self, np.int32, vertices=(None,))
        count = len(self.vertices)
        freeze_fields(self, positions=(count, 3), normals=(count, 3))
        if len(np.unique(self.vertices)) < count:
            raise RigError(f"morph {self.name}: a vertex is listed twice")


def with_morphs(figure: Figure, targets: Sequence[MorphTarget]) -> Figure:
    """Return a figure with a blend shape for each target: p = p0 + sum_k w_k (target_k - p0).

    Normals are computed with the same formula, before skinning. Joints do not move.
    """
    if not targets:
        return figure
    mesh, shapes = figure.mesh, figure.blend_shapes
    if mesh is None:
        raise _refusal(
            "F004.morph-mesh: morph {morph}: {figure} has no mesh to deform", targets[0], figure
        )
    if shapes is not None and shapes.normal_offsets is None:
        raise _refusal(
            "F004.morph-shapes: morph {morph}: {figure} already has blend shapes",
            targets[0],
            figure,
        )
    for target in targets:
        _check_vertices(target, figure, mesh.n_vertices)
    count = len(targets)
    offsets = np.zeros((2, count, mesh.n_vertices, 3))
    for row, target in enumerate(targets):
        offsets[0, row, target.vertices] = target.positions - mesh.positions[target.vertices]
        if target.normals is not None:
            offsets[1, row, target.vertices] = target.normals - mesh.normals[target.vertices]
    names, groups = tuple(target.name for target in targets), (MORPH_GROUP,) * count
    # New targets come last and have a weight of 0.
    rest = np.append(figure.rest_shape_weights, np.zeros(count))
    if shapes is not None and shapes.normal_offsets is not None:
        names, groups = shapes.names + names, shapes.groups + groups
        known = np.stack([shapes.direction_values(), shapes.normal_values()])
        offsets = np.concatenate([known, offsets], axis=1)
    # BlendShapes uses read-only arrays without copying them.
    offsets.flags.writeable = False
    rules = None if shapes is None else shapes.rules
    made = BlendShapes(names, offsets[0], groups, offsets[1], rest, rules)
    return replace(figure, blend_shapes=made)


def on_one_joint(figure: Figure) -> Figure:
    """Bind a mesh to one fixed joint: a pose, with its shape weights, needs a skeleton."""
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


def _check_vertices(target: MorphTarget, figure: Figure, count: int) -> None:
    """Raise RigError if a target refers to a vertex that the mesh does not have."""
    wrong = np.flatnonzero((target.vertices < 0) | (target.vertices >= count))
    if len(wrong):
        found = int(target.vertices[wrong[0]])
        raise _refusal(
            "F004.morph-vertex: morph {morph}: vertex index {found} is out of range for "
            "{figure}, which has {n}",
            target,
            figure,
            found=found,
            n=counted(count, "vertex"),
        )


def _refusal(key: str, target: MorphTarget, figure: Figure, **values: object) -> RigError:
    """Return the error for a target that does not match a figure."""
    return RigError(note(key, morph=target.name, figure=figure.name, **values))
