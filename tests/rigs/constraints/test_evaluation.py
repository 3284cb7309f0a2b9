"""Constraints, compared with hand calculations and between all ways of posing."""

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from viewer.rigs.constraints.constraint import Constraint
from viewer.rigs.constraints.evaluation import constrained
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.quaternion import multiply, rotation_vector_to_quaternion
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.motion.evaluation import frames_of, still_frames, world_frames
from viewer.rigs.motion.instances import pose_arrays, worlds
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.pose import rest_pose
from viewer.rigs.skeleton import Skeleton, ball_skeleton

PARENTS = np.array([-1, 0, 1, 1], dtype=np.int32)
PLACES = np.array([[0.0, 1, 0], [0, 2, 0], [1, 2, 0], [0, 2, 2]])
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def about(axis: tuple[float, float, float], degrees: float) -> np.ndarray:
    return rotation_vector_to_quaternion(np.radians(degrees) * np.array(axis))


def skeleton(*constraints: Constraint) -> Skeleton:
    """Return four joints: hips, spine, and on the spine the arm at +x and the twist at +z."""
    names = ("hips", "spine", "arm", "twist")
    return replace(ball_skeleton(names, PARENTS, PLACES), constraints=constraints)


def evaluated(rig: Skeleton, **rotations: np.ndarray) -> np.ndarray:
    """Return the rotation of the last joint for given rotations of named joints."""
    local = rig.rest_rotations.copy()
    for name, rotation in rotations.items():
        local[rig.names.index(name)] = rotation
    return constrained(rig, local, rig.rest_translations, rig.rest_scales)[3]


def assert_same_rotation(found: np.ndarray, expected: np.ndarray) -> None:
    assert_allclose(found * np.sign(found @ expected), expected, atol=1e-12)


def test_rotation_constraint_copies_the_rotation_relative_to_rest():
    rig = skeleton(Constraint(3, 2, "rotation", weight=0.5))
    assert_same_rotation(evaluated(rig, arm=about(Z, 90)), about(Z, 45))
    rests = rig.rest_rotations.copy()
    rests[2], rests[3] = about(X, 90), about(Y, 30)
    rig = replace(rig, rest_rotations=rests)
    # The source rotates by 80 degrees about its own z.
    found = evaluated(rig, arm=multiply(about(X, 90), about(Z, 80)))
    assert_same_rotation(found, multiply(about(Y, 30), about(Z, 40)))


def test_roll_constraint_copies_the_rotation_about_an_axis():
    rig = skeleton(Constraint(3, 2, "roll", X))
    swung = multiply(about(Z, 40), about(X, 60))
    assert_same_rotation(evaluated(rig, arm=swung), about(X, 60))
    assert_same_rotation(evaluated(rig, arm=about(Z, 180)), about(X, 0))
    # The joint's x axis is the source's z axis.
    rests = rig.rest_rotations.copy()
    rests[3] = about(Y, -90)
    found = evaluated(replace(rig, rest_rotations=rests), arm=about(Z, 50))
    assert_same_rotation(found, multiply(about(Y, -90), about(X, 50)))


def test_aim_constraint_points_an_axis_at_the_source():
    # The twist joint is at (0, 2, 2), the arm at (1, 2, 0).
    rig = skeleton(Constraint(3, 2, "aim", (0.0, 0.0, -1.0)))
    angle = np.degrees(np.arctan2(1.0, 2.0))
    assert_same_rotation(evaluated(rig), about(Y, -angle))
    # Ancestors move both.
    assert_same_rotation(evaluated(rig, hips=about(Z, 70), spine=about(X, 20)), about(Y, -angle))
    half = skeleton(Constraint(3, 2, "aim", (0.0, 0.0, -1.0), 0.5))
    assert_same_rotation(evaluated(half), about(Y, -angle / 2))
    # A half rotation about any perpendicular axis is valid.
    behind = skeleton(Constraint(3, 1, "aim", Z))
    found = evaluated(behind)
    assert_allclose([found[2], found[3]], 0.0, atol=1e-12)


def test_poses_frames_and_instances_agree_and_ignore_own_rotation_of_the_joint():
    rig = skeleton(Constraint(2, 0, "rotation"), Constraint(3, 2, "aim", Y, 0.7))
    figure, rng = Figure("rig", skeleton=rig), np.random.default_rng(1)
    poses = [rest_pose(rig) for _ in range(3)]
    for pose in poses:
        pose.dofs[:] = rng.uniform(-1.5, 1.5, rig.n_dofs)
        pose.scales[:] = rng.uniform(0.8, 1.2, (1, 1))
    expected = np.stack([world_matrices(rig, pose) for pose in poses])
    assert_allclose(worlds(rig, pose_arrays(poses)), expected, atol=1e-12)
    assert_allclose(world_frames(figure, still_frames(figure, poses[1])), expected[1:2], atol=1e-12)
    free = replace(rig, constraints=())
    assert np.abs(world_matrices(free, poses[0]) - expected[0]).max() > 0.1
    rotations = rng.normal(size=(5, 4, 4))
    rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
    clip = SampledClip("walk", Timing(30.0, np.arange(5)), rotations)
    frames = frames_of(figure, clip, np.arange(5) / 30.0)
    assert_same_rotation(frames.rotations[2, 2], rotations[2, 0])
    # Exporters write the rotations of the frames, in which the constraints are already applied.
    bare = world_frames(replace(figure, skeleton=free), frames)
    assert_allclose(world_frames(figure, frames), bare, atol=1e-12)
