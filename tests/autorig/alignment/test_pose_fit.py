"""Fit of the template's joints to the pose of the target."""

import numpy as np
from autorig.rigged_shapes import arm, turn
from numpy.testing import assert_allclose

from viewer.autorig.alignment.icp import Triangles
from viewer.autorig.alignment.pose_fit import fit_pose
from viewer.autorig.alignment.proportions import limbs_of, resized
from viewer.autorig.alignment.similarity import Similarity
from viewer.progress import receiving
from viewer.rig.geometry.closest_point import Surface
from viewer.rig.pose import joint_rotations, rest_pose
from viewer.rig.skinning import deform

ROTATION = turn([0.2, 1, 0.3], 1.5)
START = Similarity(20.0, ROTATION, np.array([3.0, 4.0, 5.0]), np.ones(3))


def fitted(target_figure, target_pose, figure, scales=True):
    target = START.apply(deform(target_figure, target_pose)[0])
    side = Triangles(target, figure.mesh.triangles, 1500)
    pose = rest_pose(figure.skeleton)
    fractions = []
    with receiving(lambda done, total, unit, what: fractions.append(done / total)):
        found = fit_pose(figure, pose, START, side, side, scales)
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
    found = fit_pose(figure, pose, START, side, side, True)
    assert found.similarity is START
    assert (found.pose.dofs == pose.dofs).all() and not found.rotated.any()
