"""Changes of a figure's rest mesh that its joints and inverse bind matrices follow."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from viewer.arguments import check_type
from viewer.rigs.arrays import Floats, Ints, frozen
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.memo import Memo
from viewer.rigs.mesh import Mesh, vertex_normals
from viewer.rigs.pose import Pose, joint_rotations, zero_pose
from viewer.rigs.skeleton import Skeleton

if TYPE_CHECKING:
    from viewer.rigs.blendshapes import Correctives
    from viewer.rigs.skin import Skin

_shaped: Memo[Figure, Figure] = Memo(kept=32)  # maximum number of shapes in use at a time


def shaped(figure: Figure, weights: ArrayLike) -> Figure:
    """Return the figure with its blend shapes applied: mesh, normals, joints and bindings.

    The last few results are cached, as several passes and panels need the same result.

    Parameters
    ----------
    figure
        Figure with or without blend shapes.
    weights : (N,)
        N <= S; missing weights are 0.

    Returns
    -------
    Figure
        The figure itself if all weights are 0.

    Raises
    ------
    RigError
        If there are more weights than blend shapes.
    FormatError
        If the offsets are read by this call and the file is invalid.
    """
    check_type("figure", figure, Figure)
    weights = frozen("weights", weights, (None,))
    mesh, shapes = figure.mesh, figure.blend_shapes
    if shapes is None or mesh is None or not weights.any():
        return figure

    def make() -> Figure:
        offsets = shapes.normal_displacement(weights)
        normals = None if offsets is None else mesh.normals + offsets
        moved = with_rest_mesh(figure, mesh.positions + shapes.displacement(weights), normals)
        joints = None if shapes.space is None else shapes.space.joint_displacement(weights)
        return moved if joints is None else _with_joints(moved, rest_joints(figure), joints)

    return _shaped.get(figure, weights.tobytes(), make)


def shaped_skeleton(figure: Figure, weights: Floats) -> Skeleton:
    """Return the skeleton of ``shaped(figure, weights)``, without shaping the mesh if possible.

    Morph targets of glTF and FBX files leave the joints in place, and their sums over large meshes
    are expensive.
    """
    return (shaped(figure, weights) if _moves_joints(figure) else figure).require_skeleton()


def shaped_skin(figure: Figure, weights: Floats) -> Skin:
    """Return the skin of ``shaped(figure, weights)``; see ``shaped_skeleton``."""
    return (shaped(figure, weights) if _moves_joints(figure) else figure).require_skin()


def _moves_joints(figure: Figure) -> bool:
    """Return whether blend shapes may move the rest joints."""
    shapes = figure.blend_shapes
    return figure.joint_regressor is not None or (shapes is not None and shapes.space is not None)


def _with_joints(figure: Figure, joints: Floats, shifts: Floats) -> Figure:
    """Return a figure whose rest joints (J, 3) are moved by shifts (J, 3)."""
    skeleton, skin = figure.require_skeleton(), figure.skin
    return replace(
        figure,
        skeleton=_moved_skeleton(skeleton, joints + shifts),
        skin=None if skin is None else _moved_skin(skin, shifts),
    )


def with_rest_mesh(
    figure: Figure, positions: ArrayLike, normals: ArrayLike | None = None
) -> Figure:
    """Return the figure with a new rest mesh and the joints regressed from it.

    Without a joint regressor, the joints keep their positions. Rest rotations never change.

    Parameters
    ----------
    figure
        Figure with a mesh.
    positions : (V, 3)
        New rest vertices, figure units.
    normals : (V, 3), optional
        New rest normals; computed from the new surface if omitted.

    Returns
    -------
    Figure
        Figure with new normals, rest translations and inverse bind matrices.
    """
    from viewer.rigs.blendshapes import regress_joints

    check_type("figure", figure, Figure)
    mesh, skeleton, skin = figure.require_mesh(), figure.skeleton, figure.skin
    positions = frozen("positions", positions, (mesh.n_vertices, 3))
    normals = vertex_normals(positions, mesh.triangles) if normals is None else normals
    new_mesh = replace(mesh, positions=positions, normals=np.asarray(normals))
    if figure.joint_regressor is None or skeleton is None:
        return replace(figure, mesh=new_mesh)
    old, new = rest_joints(figure), regress_joints(figure.joint_regressor, positions)
    return replace(
        figure,
        mesh=new_mesh,
        skeleton=_moved_skeleton(skeleton, new),
        skin=None if skin is None else _moved_skin(skin, new - old),
    )


def _moved_skeleton(skeleton: Skeleton, joints: Floats) -> Skeleton:
    posing = None if skeleton.posing is None else skeleton.posing.with_joints(joints)
    moved = moved_rest_translations(skeleton, joints)
    return replace(skeleton, rest_translations=moved, posing=posing)


def moved_rest_translations(skeleton: Skeleton, joints: Floats) -> Floats:
    """Return rest translations (..., J, 3) for joints at new positions with the same axes."""
    linear = world_matrices(skeleton, zero_pose(skeleton))[:, :3, :3]
    parents = skeleton.parents
    has_parent = parents >= 0
    above = parents[has_parent]
    translations = joints.copy()
    offsets = joints[..., has_parent, :] - joints[..., above, :]
    # A linear system is solved, as the transpose is not the inverse if rest transforms scale.
    translations[..., has_parent, :] = np.linalg.solve(linear[above], offsets[..., None])[..., 0]
    return translations


def _moved_skin(skin: Skin, shifts: Floats) -> Skin:
    return replace(skin, inverse_bind=skin.inverse_bind @ translation_matrix(-shifts))


def joint_shifts(figure: Figure, weights: Floats) -> Floats:
    """Return how far shapes (F, S) move the rest joints, J(beta) - J(0): (F, J, 3)."""
    shapes = figure.blend_shapes
    if shapes is None or shapes.space is None:
        directions = joint_directions(figure)
        weights = weights[:, : len(directions)]
        return np.einsum("fs,sjc->fjc", weights, directions[: weights.shape[1]])
    found = np.zeros((len(weights), figure.require_skeleton().n_joints, 3))
    rows, row_of = np.unique(weights, axis=0, return_inverse=True)
    for index, row in enumerate(rows):
        moved = shapes.space.joint_displacement(row)
        if moved is not None:
            found[row_of.reshape(-1) == index] = moved
    return found


def rest_joints(figure: Figure) -> Floats:
    """Return the joint positions with all DOFs at 0: (J, 3), figure units."""
    skeleton = figure.require_skeleton()
    return world_matrices(skeleton, zero_pose(skeleton))[:, :3, 3]


_directions: Memo[Figure, Floats] = Memo()


def joint_directions(figure: Figure) -> Floats:
    """Return the offsets D (S, J, 3) of the rest joints: J(beta) = J(0) + sum_s beta_s D_s."""
    from viewer.rigs.blendshapes import regress_joints

    regressor, shapes, mesh = figure.joint_regressor, figure.blend_shapes, figure.mesh
    directions = np.zeros((figure.n_shapes, figure.require_skeleton().n_joints, 3))
    if regressor is None or shapes is None or mesh is None:
        return directions

    # Only displacements are regressed, so that constants have no effect.
    linear = replace(regressor, bias=None)

    def make() -> Floats:
        one, still = np.zeros(figure.n_shapes), np.zeros_like(mesh.positions)
        for row in range(figure.n_shapes):
            one[:] = 0.0
            one[row] = 1.0
            directions[row] = regress_joints(linear, still + shapes.displacement(one))
        return directions

    return _directions.get(figure, (), make)


def pose_weights(correctives: Correctives, skeleton: Skeleton, pose: Pose) -> Floats:
    """Return the weights (P,) of a figure's correctives in a pose, one per row."""
    from viewer.rigs.blendshapes import corrective_weights

    if correctives.feature is None:
        return corrective_weights(joint_rotations(skeleton, pose))
    return correctives.feature.weights(skeleton, pose)


def rest_positions(
    figure: Figure, mesh: Mesh, pose: Pose, correct: bool = True, vertices: Ints | None = None
) -> Floats:
    """Return vertices (N, 3), by default all, before skinning: at rest plus pose correctives."""
    rest = mesh.positions if vertices is None else mesh.positions[vertices]
    if not correct or figure.correctives is None or figure.skeleton is None:
        return rest
    weights = pose_weights(figure.correctives, figure.skeleton, pose)
    if not weights.any():
        return rest
    if vertices is None:
        return rest + figure.correctives.displacement(weights)
    return rest + figure.correctives.of_vertices(vertices, weights)
