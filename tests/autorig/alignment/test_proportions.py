"""Limb length and girth, and their effect on vertices, joints and bind pose."""

from dataclasses import replace

import numpy as np
from autorig.rigged_shapes import arm, turn
from numpy.testing import assert_allclose

from viewer.autorig.alignment.proportions import limbs_of, resized
from viewer.rig.pose import rest_pose
from viewer.rig.skinning import deform

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
