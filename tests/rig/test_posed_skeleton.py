"""World and skinning matrices of a pose: correctness, single computation, and invalidation."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import viewer
from viewer.rig import kinematics
from viewer.rig.kinematics import posed_skeleton, skinning_matrices, world_matrices
from viewer.rig.memo import NumberKey
from viewer.rig.motion.instances import posed_worlds
from viewer.rig.pose import pose_key, pose_of

ARRAYS = ("dofs", "translations", "rotations", "scales", "shape_weights")
ORDER = 1e-14  # rounding, because matrices of many poses are multiplied in a different order


@pytest.fixture
def actor():
    actor = viewer.load().actors[0]
    actor.pose.shape_weights = np.zeros(2)
    actor.pose.dofs[:] = np.linspace(-0.2, 0.2, len(actor.pose.dofs))
    return actor


@pytest.fixture
def runs(monkeypatch):
    """A counter of the runs of forward kinematics."""
    counted, run = [], kinematics.forward_kinematics

    def count(*args):
        counted.append(1)
        return run(*args)

    monkeypatch.setattr("viewer.rig.kinematics.forward_kinematics", count)
    return counted


def test_matrices_match_the_pose(actor):
    figure, pose = actor.figure, actor.pose
    posed, world = posed_skeleton(figure.skeleton, pose), world_matrices(figure.skeleton, pose)
    assert_array_equal(posed.world, world)
    assert_array_equal(
        posed.palette(figure.skin), skinning_matrices(world, figure.skin.inverse_bind)
    )


def test_kinematics_run_once_until_a_value_changes(actor, runs):
    skeleton, pose = actor.figure.skeleton, actor.pose
    first = posed_skeleton(skeleton, pose)
    assert posed_skeleton(skeleton, pose) is first and len(runs) == 1
    pose.figure_translation[0] += 1.0  # placement is applied after skinning
    pose.figure_scale = 2.0
    assert posed_skeleton(skeleton, pose) is first and len(runs) == 1


@pytest.mark.parametrize("name", ARRAYS)
def test_every_joint_value_invalidates_the_cache(actor, name):
    skeleton, pose = actor.figure.skeleton, actor.pose
    first, key = posed_skeleton(skeleton, pose), pose.skinning_key
    getattr(pose, name)[-1] += 0.25
    assert pose.skinning_key is not key and pose.skinning_key != key
    other = posed_skeleton(skeleton, pose)
    assert other is not first
    assert_array_equal(other.world, world_matrices(skeleton, pose))
    getattr(pose, name)[-1] -= 0.25
    assert_array_equal(posed_skeleton(skeleton, pose).world, first.world)


def test_different_skeleton_or_skin_has_separate_matrices(actor):
    figure, pose = actor.figure, actor.pose
    longer = replace(figure.skeleton, rest_translations=2.0 * figure.skeleton.rest_translations)
    first = posed_skeleton(figure.skeleton, pose)
    assert_array_equal(posed_skeleton(longer, pose).world, world_matrices(longer, pose))
    other = replace(figure.skin, inverse_bind=2.0 * figure.skin.inverse_bind)
    assert_array_equal(first.palette(other), 2.0 * first.palette(figure.skin))


def test_matrices_are_read_only(actor):
    posed = posed_skeleton(actor.figure.skeleton, actor.pose)
    for matrices in (posed.world, posed.palette(actor.figure.skin)):
        with pytest.raises(ValueError, match="read-only"):
            matrices[0] = 0.0


def test_copied_poses_have_separate_matrices(actor, runs):
    skeleton, pose = actor.figure.skeleton, actor.pose
    first, copy = posed_skeleton(skeleton, pose), pose.copy()
    copy.dofs[0] += 0.5
    assert posed_skeleton(skeleton, copy) is not first
    assert posed_skeleton(skeleton, pose) is first and len(runs) == 2


def test_poses_computed_together_cache_their_matrices(actor, runs):
    skeleton, poses = actor.figure.skeleton, [actor.pose.copy() for _ in range(3)]
    for row, pose in enumerate(poses):
        pose.dofs[:] *= row
    wanted = [world_matrices(skeleton, pose) for pose in poses]
    runs.clear()
    assert_allclose(posed_worlds(skeleton, poses), wanted, atol=ORDER)
    assert len(runs) == 1
    kept = [posed_skeleton(skeleton, pose) for pose in poses]
    assert_allclose([posed.world for posed in kept], wanted, atol=ORDER)
    assert len(runs) == 1
    poses[1].dofs[0] += 0.5
    wanted[1] = world_matrices(skeleton, poses[1])
    runs.clear()
    assert_allclose(posed_worlds(skeleton, poses), wanted, atol=ORDER)
    assert len(runs) == 1 and posed_skeleton(skeleton, poses[0]) is kept[0]


def test_pose_keys_record_and_restore_every_value(actor):
    pose, key = actor.pose, pose_key(actor.pose)
    again = pose_of(key)
    assert pose_key(again) == key
    for name in (*ARRAYS, "figure_translation"):
        assert_array_equal(getattr(again, name), getattr(pose, name))
        getattr(again, name)[-1] += 0.25
        assert pose_key(again) != key and pose_key(pose) == key
        again = pose_of(key)
    again.figure_scale = 2.0
    assert pose_key(again) != key


def test_keys_distinguish_array_layouts_and_sizes():
    square = np.arange(9.0).reshape(3, 3)
    key = NumberKey(square[:, ::2], np.zeros(0))
    assert key.updated(square[:, ::2], np.zeros(0)) is key
    assert key.updated(square[:, ::2].copy(), np.zeros(0)) is key
    for others in (square[:, 1::2], np.zeros(0)), (square[:, ::2],), (square[:, ::2], np.zeros(1)):
        assert key.updated(*others) == NumberKey(*others) != key
    assert key == NumberKey(square[:, ::2], np.zeros(0)) and key != NumberKey(square)
    assert hash(key) == hash(NumberKey(square[:, ::2], np.zeros(0))) and key != 1


def test_old_keys_keep_their_contents_after_an_update():
    first, second = np.arange(3.0), np.arange(2.0)
    key = NumberKey(first, second)
    second[1] = -0.0
    changed = key.updated(first, second)
    assert_array_equal(key.array(1), [0.0, 1.0])
    assert_array_equal(np.signbit(changed.array(1)), [False, True])
    second[1] = 1.0
    assert changed.updated(first, second) == key
