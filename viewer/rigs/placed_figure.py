"""Figures moved as a whole, or bound in another pose: mesh, joints and bindings together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.rigs.arrays import Floats
from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.quaternion import multiply
from viewer.rigs.geometry.rotation import matrix_to_quaternion
from viewer.rigs.geometry.transform import apply_transform, mean_scale
from viewer.rigs.joint_edits import at_rest, rest_worlds
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import Pose, placement_matrix
from viewer.rigs.shape import shaped
from viewer.rigs.skeleton import FIRST_ROTATION, Skeleton, scaled_skeleton
from viewer.rigs.skin import Skin
from viewer.rigs.skinning import deform

_ROUNDING = 1e-12  # difference from the identity of a matrix that does not rotate


def placed(figure: Figure, matrix: Floats) -> Figure:
    """Return a figure whose mesh, joints, bindings and blend shapes are moved by (4, 4).

    The matrix translates, rotates and scales by one factor. DOFs stay, in the new unit; those of a
    root still translate it along the axes of the scene. Pose correctives and springs stay as they
    are.
    """
    scale = mean_scale(matrix)
    rotation = matrix[:3, :3] / scale
    mesh, skeleton, skin, shapes = figure.mesh, figure.skeleton, figure.skin, figure.blend_shapes
    return replace(
        figure,
        mesh=None if mesh is None else _moved_mesh(mesh, matrix, rotation),
        skeleton=None if skeleton is None else _moved_joints(skeleton, matrix, rotation, scale),
        skin=None if skin is None else _moved_bindings(skin, matrix, scale),
        blend_shapes=None if shapes is None else _moved_shapes(shapes, rotation, scale),
    )


def _moved_mesh(mesh: Mesh, matrix: Floats, rotation: Floats) -> Mesh:
    positions = apply_transform(matrix, mesh.positions)
    return replace(mesh, positions=positions, normals=mesh.normals @ rotation.T)


def _moved_joints(skeleton: Skeleton, matrix: Floats, rotation: Floats, scale: float) -> Skeleton:
    # Joints keep their own scales: all lengths between them are in the new unit.
    longer, roots = scaled_skeleton(skeleton, scale), skeleton.parents < 0
    places, turns = longer.rest_translations.copy(), longer.rest_rotations.copy()
    places[roots] = apply_transform(matrix, skeleton.rest_translations[roots])
    if np.abs(rotation - np.eye(3)).max() > _ROUNDING:
        turns[roots] = multiply(matrix_to_quaternion(rotation), turns[roots])
    lengths = np.where(skeleton.dof_kinds < FIRST_ROTATION, scale, 1.0)
    return replace(
        longer,
        rest_translations=places,
        rest_rotations=turns,
        rest_dofs=skeleton.rest_dofs * lengths,
        dof_limits=skeleton.dof_limits * lengths[:, None],
    )


def _moved_bindings(skin: Skin, matrix: Floats, scale: float) -> Skin:
    # Joints W move to M W S^-1, where S scales, as their own scales stay. A vertex v moves to M v,
    # and with it its image: M W B v = (M W S^-1) (S B M^-1) (M v).
    bound = np.diag([scale, scale, scale, 1.0]) @ skin.inverse_bind @ np.linalg.inv(matrix)
    return replace(skin, inverse_bind=bound)


def _moved_shapes(shapes: BlendShapes, rotation: Floats, scale: float) -> BlendShapes:
    normals = None if shapes.normal_offsets is None else shapes.normal_values() @ rotation.T
    offsets = shapes.direction_values() @ (scale * rotation).T
    return replace(shapes, offsets=offsets, normal_offsets=normals)


def bound_in(figure: Figure, pose: Pose) -> Figure:
    """Return a rigged figure that at rest is what it is in a pose, bound there.

    Its joints keep their axes. Blend shapes are applied; pose correctives are left out.
    """
    place = placement_matrix(pose)
    inner = pose.copy()
    inner.figure_scale, inner.figure_translation = 1.0, np.zeros(3)
    inner.shape_weights = np.zeros(0)
    figure = replace(shaped(figure, pose.shape_weights), correctives=None, blend_shapes=None)
    mesh = figure.require_mesh()
    positions, normals = deform(figure, inner)
    posed = replace(
        figure,
        mesh=replace(mesh, positions=positions, normals=normals),
        skeleton=at_rest(figure.require_skeleton(), inner),
    )
    rested = placed(posed, place)
    inverse = np.asarray(np.linalg.inv(rest_worlds(rested)), dtype=np.float64)
    return replace(rested, skin=replace(rested.require_skin(), inverse_bind=inverse))
