"""Keypoints of a posed figure, computed without skinning its whole mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.errors import RigError
from viewer.rigs.annotations import Keypoints, keypoint_positions
from viewer.rigs.arrays import Deferred, Floats, Ints, deferred
from viewer.rigs.blendshapes import BlendShapes, Correctives
from viewer.rigs.figure import Figure
from viewer.rigs.memo import Memo
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import Pose
from viewer.rigs.shape import shaped
from viewer.rigs.skin import Skin, skin_rows
from viewer.rigs.skinning import Skinning, deform, joint_matrices

_parts: Memo[Figure, tuple[Figure, Keypoints]] = Memo()


def posed_keypoints(figure: Figure, pose: Pose, skinning: Skinning | None = None) -> Floats:
    """Return the keypoints (N, 3) of a posed figure, figure space."""
    if figure.keypoints is None or figure.mesh is None:
        raise RigError(f"figure {figure.name} has no keypoints")
    part, keypoints = _parts.get(figure, None, lambda: _part(figure))
    # Joints are taken from the whole shaped figure, as the partial figure has no joint regressor.
    whole = shaped(figure, pose.shape_weights)
    part = replace(part, skeleton=whole.skeleton, skin=_with_binds(part.skin, whole.skin))
    vertices = deform(part, pose, skinning or Skinning())[0]
    return keypoint_positions(keypoints, vertices, joint_matrices(figure, pose)[:, :3, 3])


def _with_binds(skin: Skin | None, whole: Skin | None) -> Skin | None:
    return None if skin is None or whole is None else replace(skin, inverse_bind=whole.inverse_bind)


def _part(figure: Figure) -> tuple[Figure, Keypoints]:
    """Return a figure with the vertices that keypoints use, and the keypoints of that figure."""
    keypoints = figure.keypoints
    assert keypoints is not None  # checked by the caller
    vertices, index = np.unique(keypoints.vertices, return_inverse=True)
    part = some_vertices(figure, vertices.astype(np.int32))
    return part, replace(keypoints, vertices=index.reshape(-1, 3).astype(np.int32))


def some_vertices(figure: Figure, vertices: Ints) -> Figure:
    """Return a figure of a few vertices that deform like the whole, without joint regressor."""
    mesh = figure.require_mesh()
    shapes, correctives = figure.blend_shapes, figure.correctives
    return Figure(
        name=figure.name,
        mesh=Mesh(mesh.positions[vertices], mesh.normals[vertices], np.zeros((0, 3), np.int32)),
        skeleton=figure.skeleton,
        skin=None if figure.skin is None else skin_rows(figure.skin, vertices),
        blend_shapes=None
        if shapes is None
        else BlendShapes(shapes.names, _columns(shapes.offsets, vertices), shapes.groups),
        correctives=None
        if correctives is None
        else Correctives(_columns(correctives.offsets, vertices), correctives.feature),
    )


def _columns(offsets: Floats | Deferred, vertices: Ints) -> Deferred:
    shape = (offsets.shape[0], len(vertices), 3)
    return Deferred(shape, np.float64, lambda: deferred(offsets).columns(vertices))
