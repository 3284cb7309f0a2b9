"""Fit of the template's joints to the pose of the target."""

from dataclasses import replace

import numpy as np
import pytest
from autorig.rigged_shapes import arm, turn
from numpy.testing import assert_allclose

from viewer.autorig.alignment.icp import Triangles
from viewer.autorig.alignment.pose_fit import (
    AlignedTemplate,
    Pairs,
    fit_pose,
    solve_step,
    start_of,
)
from viewer.autorig.alignment.proportions import _sides, limbs_of, resized
from viewer.autorig.alignment.similarity import Similarity
from viewer.progress import receiving
from viewer.rigs.geometry.closest_point import Surface
from viewer.rigs.mesh import vertex_normals
from viewer.rigs.pose import joint_rotations, rest_pose
from viewer.rigs.skinning import deform

ROTATION = turn([0.2, 1, 0.3], 1.5)
START = Similarity(20.0, ROTATION, np.array([3.0, 4.0, 5.0]), np.ones(3))


def fitted(target_figure, target_pose, figure, scales=True):
    target = START.apply(deform(target_figure, target_pose)[0])
    side = Triangles(target, figure.mesh.triangles, 1500)
    pose = rest_pose(figure.skeleton)
    fractions = []
    with receiving(lambda done, total, unit, what: fractions.append(done / total)):
        found = fit_pose(figure, start_of(figure, pose, START), side, side, scales)
    assert fractions == sorted(fractions) and fractions[0] == 0.0
    assert (pose.dofs == rest_pose(figure.skeleton).dofs).all()
    aligned = found.similarity.apply(deform(found.figure, found.pose)[0])
    gaps = Surface(target, figure.mesh.triangles).closest(aligned).distances
    return found, gaps / (20.0 * 2.4)


def bent(figure, angle=0.7):
    pose = rest_pose(figure.skeleton)
    pose.dofs[6:] = 0.0, 0.0, angle
    return pose


def angle_between(a, b):
    return np.degrees(np.arccos(np.clip((np.trace(a.T @ b) - 1) / 2, -1, 1)))


def test_bent_joint_is_found():
    figure = arm()
    found, gaps = fitted(figure, bent(figure), figure)
    assert gaps.max() < 2e-3
    wanted = joint_rotations(figure.skeleton, bent(figure))[1]
    assert angle_between(joint_rotations(figure.skeleton, found.pose)[1], wanted) < 3.0
    assert_allclose(np.degrees(np.linalg.norm(found.rotated[1])), 40.1, atol=3.0)


def test_dofs_are_within_limits_and_quaternions_store_the_remainder():
    figure = arm(limit=0.2)
    free = arm()
    found, gaps = fitted(free, bent(free), figure)
    assert gaps.max() < 2e-3
    assert np.abs(found.pose.dofs[6:]).max() <= 0.2
    assert angle_between(np.eye(3), joint_rotations(figure.skeleton, found.pose)[1]) > 35.0


def test_longer_limb_is_found():
    figure = arm()
    longer = resized(figure, limbs_of(figure), np.array([1.0, 1.3]), np.ones(2))
    found, gaps = fitted(longer, bent(longer), figure)
    assert np.sqrt(np.mean(gaps**2)) < 2e-3
    # Overall scale and limb scales are ambiguous, so only their product is determined.
    along = found.grown[0]
    assert_allclose(along[1] - along[0], np.log(1.3), atol=0.08)


def test_known_size_is_kept():
    figure = arm()
    found, _ = fitted(figure, bent(figure, 0.3), figure, scales=False)
    assert_allclose(found.similarity.scale, 20.0, rtol=1e-6)
    assert np.abs(found.grown).max() < 1e-6


def test_too_few_pairs_do_not_change_the_template():
    figure = arm()
    far = START.apply(deform(figure)[0]) + 1000.0
    side = Triangles(far, figure.mesh.triangles, 500)
    pose = rest_pose(figure.skeleton)
    found = fit_pose(figure, start_of(figure, pose, START), side, side, True)
    assert found.similarity is START
    assert (found.pose.dofs == pose.dofs).all() and not found.rotated.any()


FIGURE = arm()
LIMBS = limbs_of(FIGURE)
PARENTS = FIGURE.skeleton.parents
X = FIGURE.mesh.positions
LAID = AlignedTemplate(
    X,
    vertex_normals(X, FIGURE.mesh.triangles),
    np.array([[0.0, 0, 0], [0, 1, 0]]),
    LIMBS.axes,
    LIMBS.sides,
)
SIZE = 2.4
NONE = np.zeros((2, 3)), np.zeros((3, 2))


def solved(targets, scales=True, before=NONE):
    every = np.arange(len(X))
    # Each vertex occurs three times with normals along x, y and z, which is equivalent to distances
    # of points.
    normals = np.repeat(np.eye(3), len(X), axis=0)
    pairs = Pairs(np.tile(every, 3), np.tile(targets, (3, 1)), normals, every, targets)
    return solve_step(LAID, LIMBS, PARENTS, pairs, SIZE, *before, scales)


def test_rotated_joint_is_found():
    turn = np.array([0.0, 0.0, 0.02])
    targets = X + LIMBS.fractions[:, 1:] * np.cross(turn, X - [0, 1, 0])
    step = solved(targets)
    assert_allclose(step.rotation_vectors, [[0, 0, 0], turn], atol=2e-4)
    assert_allclose(step.rotation, 0.0, atol=2e-4)
    assert_allclose(step.limb_growths, 0.0, atol=5e-4)


def test_overall_translation_and_scale_are_found():
    step = solved(X * 1.03 + [0.1, -0.2, 0.3])
    assert_allclose(step.growth, 0.03, atol=1e-3)
    middle = np.tile(X, (3, 1)).mean(axis=0)
    assert_allclose(step.shift, 0.03 * middle + [0.1, -0.2, 0.3], atol=1e-3)
    assert_allclose(step.rotation_vectors, 0.0, atol=1e-3)


def test_longer_limb_is_distinguished_from_overall_scale():
    fraction = LIMBS.fractions[:, 1]
    # The base is 5 % longer; its vertices stretch, and the tip moves with it.
    up = 0.05 * ((1 - fraction) * X[:, 1] + fraction)
    step = solved(X + up[:, None] * [0.0, 1.0, 0.0])
    along, *across = step.limb_growths + step.growth
    assert_allclose(along[0] - along[1], 0.05, atol=5e-3)
    assert_allclose(np.array(across)[:, 0], 0.0, atol=5e-3)


def test_wide_limb_is_distinguished_from_a_deep_one():
    # Axes and sides are along y and x, or nearly for the tip, so z is the third axis.
    assert_allclose(LIMBS.sides[0], [1, 0, 0], atol=1e-12)
    _, side, third = (lambda step: step.limb_growths + step.growth)(solved(X * [1.05, 1, 0.95]))
    assert_allclose(side, 0.05, atol=5e-3)
    assert_allclose(third, -0.05, atol=5e-3)


def test_known_scale_is_not_changed():
    step = solved(X * 1.03, scales=False)
    assert abs(step.growth) < 1e-8 and np.abs(step.limb_growths).max() < 1e-8


def test_steps_are_bounded():
    turn = np.array([0.0, 0.0, 2.0])
    step = solved(X + LIMBS.fractions[:, 1:] * np.cross(turn, X - [0, 1, 0]))
    assert_allclose(np.linalg.norm(step.rotation_vectors[1]), 0.3)
    step = solved(3.0 * X)
    assert step.growth == 0.2


def test_unsupported_rotations_of_earlier_iterations_decay():
    # The axis of the tip is y, and a rotation about it slides a round section along itself; there
    # is only one pair, which does not constrain the tip.
    pairs = Pairs(np.array([0]), X[:1], np.array([[0.0, 0, 1.0]]), np.array([0]), X[:1])
    rotated = np.array([[0.0, 0, 0], [0, 0.1, 0]])
    step = solve_step(LAID, LIMBS, PARENTS, pairs, SIZE, rotated, np.zeros((3, 2)), True)
    # The penalties are 3e-6 on the total rotation and 1e-5 on one step, so 0.1 * 3 / 13 is
    # reverted.
    assert step.rotation_vectors[1, 1] == pytest.approx(-0.1 * 3 / 13, rel=1e-6)


ONES = np.ones(2)


def test_limbs_point_to_the_next_joint_or_the_centre_of_the_children():
    figure = arm()
    limbs = limbs_of(figure)
    fraction = np.clip((figure.mesh.positions[:, 1] - 0.8) / 0.4, 0.0, 1.0)
    assert_allclose(limbs.weights, np.stack([1 - fraction, fraction], axis=1), atol=1e-12)
    assert_allclose(
        limbs.fractions, np.stack([np.ones_like(fraction), fraction], axis=1), atol=1e-12
    )
    assert_allclose(limbs.axes[0], [0, 1, 0], atol=1e-12)
    middle = (fraction @ figure.mesh.positions) / fraction.sum() - [0, 1, 0]
    assert_allclose(limbs.axes[1], middle / np.linalg.norm(middle), atol=1e-12)


def test_joint_without_vertices_has_no_axis():
    figure = arm()
    everything = replace(figure.skin, joints=np.zeros_like(figure.skin.joints))
    limbs = limbs_of(replace(figure, skin=everything))
    assert limbs.axes[1].tolist() == [0, 0, 0]
    still = resized(replace(figure, skin=everything), limbs, ONES, np.array([1.0, 5.0]))
    assert_allclose(still.mesh.positions, figure.mesh.positions, atol=1e-12)


def test_factors_of_one_have_no_effect():
    figure = arm()
    same = resized(figure, limbs_of(figure), ONES, ONES)
    assert_allclose(same.mesh.positions, figure.mesh.positions, atol=1e-12)
    assert_allclose(same.skin.inverse_bind, figure.skin.inverse_bind, atol=1e-12)
    assert_allclose(same.skeleton.rest_translations, figure.skeleton.rest_translations, atol=1e-12)


def test_longer_limb_moves_its_descendants():
    figure = arm()
    longer = resized(figure, limbs_of(figure), np.array([2.0, 1.0]), ONES)
    before, after = figure.mesh.positions, longer.mesh.positions
    low, high = before[:, 1] < 0.79, before[:, 1] > 1.21
    assert_allclose(after[low], before[low] * [1, 2, 1], atol=1e-12)
    assert_allclose(after[high], before[high] + [0, 1, 0], atol=1e-12)
    assert_allclose(longer.skeleton.rest_translations[1], [0, 2, 0], atol=1e-12)
    assert_allclose(longer.skin.inverse_bind[1, :3, 3], [0, -2, 0], atol=1e-12)
    # At rest the joints move no vertex, because binding and skeleton agree.
    assert_allclose(deform(longer, rest_pose(longer.skeleton))[0], after, atol=1e-12)


def test_girth_scale_keeps_the_length():
    figure = arm()
    thick = resized(figure, limbs_of(figure), ONES, np.array([3.0, 1.0]))
    low = figure.mesh.positions[:, 1] < 0.79
    assert_allclose(thick.mesh.positions[low], figure.mesh.positions[low] * [3, 1, 3], atol=1e-12)
    assert_allclose(thick.skeleton.rest_translations[1], [0, 1, 0], atol=1e-12)


def test_girths_differ_in_the_two_directions_across_a_limb():
    figure = arm()
    girths = np.array([3.0, 1.0]), np.array([0.5, 1.0])
    flat = resized(figure, limbs_of(figure), ONES, *girths)
    low = figure.mesh.positions[:, 1] < 0.79
    assert_allclose(flat.mesh.positions[low], figure.mesh.positions[low] * [3, 1, 0.5], atol=1e-12)
    assert_allclose(flat.skeleton.rest_translations[1], [0, 1, 0], atol=1e-12)


def test_sides_of_mirrored_limbs_are_mirrored():
    # Rounding makes x the axis most across one limb and z that of the other.
    axes = np.array([[0.1, 1.0, 0.1 + 1e-9], [-0.1 - 1e-9, 1.0, 0.1], [0.0, 0.0, 0.0]])
    axes[:2] /= np.linalg.norm(axes[:2], axis=1, keepdims=True)
    sides = _sides(axes, np.array([1, 0, 2]))
    assert_allclose(sides[0], sides[1] * np.sign(sides[0] * sides[1]), atol=1e-8)
    assert_allclose(np.einsum("ja,ja->j", sides, axes), 0.0, atol=1e-12)
    assert_allclose(np.linalg.norm(sides, axis=1), [1, 1, 0], atol=1e-12)


def test_offsets_follow_a_rotated_bind_pose():
    figure = arm()
    axes = turn([0, 0, 1], np.pi / 2)
    bind = np.linalg.inv(figure.skin.inverse_bind)
    bind[:, :3, :3] = axes
    skin = replace(figure.skin, inverse_bind=np.linalg.inv(bind))
    rotated = replace(figure, skin=skin)
    longer = resized(rotated, limbs_of(rotated), np.array([2.0, 1.0]), ONES)
    # One more unit along y is a unit along x in axes rotated by 90 degrees about z.
    assert_allclose(longer.skeleton.rest_translations[1], [1, 1, 0], atol=1e-12)
