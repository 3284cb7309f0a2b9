"""Figures moved as a whole: every pose moves with them; bound in a pose: that pose is at rest."""

from dataclasses import replace

import numpy as np
import pytest
from builders import quaternions, rotation
from numpy.testing import assert_allclose
from rigs.animated import leg

from viewer.loading import bundled_body, load
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.placed_figure import bound_in, placed
from viewer.rigs.skinning import deform, joint_matrices

ROUNDING = 1e-12


def with_dofs() -> Figure:
    """Return a leg whose knee has a translation DOF along y and a rotation DOF about z."""
    plain = leg()
    skeleton = replace(
        plain.skeleton,
        dof_joints=[1, 1],
        dof_kinds=[1, 5],
        rest_dofs=[0.25, 0.5],
        dof_limits=[[-1.0, 2.0], [-3.0, 3.0]],
    )
    return replace(plain, skeleton=skeleton)


def similarity(vector, scale: float, translation) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = scale * rotation(vector), translation
    return matrix


@pytest.mark.parametrize("vector", [(0.0, 0.0, 0.0), (0.3, -0.8, 1.1)])
@pytest.mark.parametrize("scale", [1.0, 2.5])
def test_every_pose_moves_with_a_figure(vector, scale):
    figure = with_dofs()
    matrix = similarity(vector, scale, [1.0, -2.0, 3.0])
    moved = placed(figure, matrix)
    pose, other = figure_pose(figure), figure_pose(moved)
    for each, factor in ((pose, 1.0), (other, scale)):
        each.dofs[:] = 0.75 * factor, -0.5
        each.rotations[2] = quaternions(np.array([[0.2, 0.4, -0.3]]))[0]
        each.shape_weights[:] = 0.5, -0.5
    positions, normals = deform(figure, pose)
    found, found_normals = deform(moved, other)
    assert_allclose(found, apply_transform(matrix, positions), atol=ROUNDING)
    assert_allclose(found_normals, normals @ rotation(vector).T, atol=ROUNDING)
    joints, same = (
        world_matrices(each.skeleton, held)[:, :3, 3]
        for each, held in ((figure, pose), (moved, other))
    )
    assert_allclose(same, apply_transform(matrix, joints), atol=ROUNDING)
    assert_allclose(moved.skeleton.rest_dofs, [0.25 * scale, 0.5], atol=ROUNDING)
    assert_allclose(moved.skeleton.dof_limits, [[-scale, 2.0 * scale], [-3.0, 3.0]], atol=ROUNDING)


def test_figure_bound_in_a_pose_is_there_at_rest_and_moves_on_from_it():
    figure = with_dofs()
    pose = figure_pose(figure)
    pose.dofs[:] = 1.5, -0.7
    pose.rotations[0] = quaternions(np.array([[0.5, 0.1, 0.9]]))[0]
    pose.figure_scale, pose.figure_translation = 2.0, np.array([5.0, 0.0, -1.0])
    bound = bound_in(figure, pose)
    assert bound.blend_shapes is None
    rest = figure_pose(bound)
    assert_allclose(deform(bound, rest)[0], deform(figure, pose)[0], atol=ROUNDING)
    # Nothing moves a vertex at rest.
    worlds = world_matrices(bound.skeleton, rest)
    assert_allclose(worlds @ bound.skin.inverse_bind, np.tile(np.eye(4), (3, 1, 1)), atol=ROUNDING)
    assert_allclose(deform(bound, rest)[0], bound.mesh.positions, atol=ROUNDING)
    # Each vertex follows one joint, so in any other pose it is where it would have been.
    for each, factor in ((pose, 1.0), (rest, 2.0)):
        each.dofs[:] = -0.5 * factor, 1.25
        each.rotations[2] = quaternions(np.array([[0.0, -0.6, 0.2]]))[0]
    assert_allclose(deform(bound, rest)[0], deform(figure, pose)[0], atol=ROUNDING)


def test_bound_figure_has_the_joints_of_its_shape():
    figure = replace(load(bundled_body()).actors[0].figure, correctives=None)
    pose = figure_pose(figure)
    pose.shape_weights[:2] = 2.0, -1.0
    pose.rotations[3] = quaternions(np.array([[0.4, 0.1, 0.0]]))[0]
    places = joint_matrices(figure, pose)[:, :3, 3]
    assert np.abs(places - joint_matrices(figure, figure_pose(figure))[:, :3, 3]).max() > 0.1
    bound = bound_in(figure, pose)
    rest = figure_pose(bound)
    assert_allclose(joint_matrices(bound, rest)[:, :3, 3], places, atol=ROUNDING)
    assert_allclose(deform(bound, rest)[0], deform(figure, pose)[0], atol=ROUNDING)
