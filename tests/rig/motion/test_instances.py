"""Batched posing of many actors, compared with posing them one by one."""

import numpy as np
import pytest
from rig.hand_made import skeleton

import viewer
from viewer.loading import bundled_body
from viewer.rig.captures.points import PointClip, PointLayout
from viewer.rig.figure import Figure
from viewer.rig.kinematics import skinning_matrices, world_matrices
from viewer.rig.motion.clip import Channel, Clip
from viewer.rig.motion.evaluation import pose_actors
from viewer.rig.motion.instances import local_rotations, palettes, placements, worlds
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing
from viewer.rig.pose import Pose, joint_rotations, placement_matrix, rest_pose
from viewer.rig.scene import Actor, figure_pose
from viewer.rig.shape import shaped
from viewer.rig.skeleton import Skeleton

EXACT = 1e-13  # the same products, summed in a different order


def moving_skeleton() -> Skeleton:
    """Return two roots with unordered DOFs of all kinds, limits, and a joint without DOFs."""
    dofs = [(0, "tx", 0.3), (0, "z", 0.1), (0, "x", 0.0), (1, "y", 0.2, -0.5, 0.5)]
    dofs += [(2, "tz", 0.0), (2, "tz", 0.1), (2, "x", 0.4), (2, "y", -0.3), (2, "z", 0.0)]
    return skeleton([-1, 0, 1, -1], dofs, offsets=np.arange(12.0).reshape(4, 3))


def random_poses(joints: Skeleton, count: int) -> list[Pose]:
    rng = np.random.default_rng(0)
    poses = []
    for _ in range(count):
        pose = rest_pose(joints)
        pose.dofs[:] = rng.normal(size=joints.n_dofs)
        pose.translations[:] = rng.normal(size=(joints.n_joints, 3))
        pose.rotations[:] = rng.normal(size=(joints.n_joints, 4))
        pose.scales[:] = rng.uniform(0.5, 2.0, (joints.n_joints, 3))
        pose.figure_scale = float(rng.uniform(0.5, 2.0))
        pose.figure_translation[:] = rng.normal(size=3)
        poses.append(pose)
    return poses


def test_batched_matrices_match_each_pose():
    joints = moving_skeleton()
    poses = random_poses(joints, 7)
    rotations, found, places = (
        local_rotations(joints, poses),
        worlds(joints, poses),
        placements(poses),
    )
    assert found.shape == (7, 4, 4, 4)
    for row, pose in enumerate(poses):
        assert np.allclose(rotations[row], joint_rotations(joints, pose), atol=EXACT)
        assert np.allclose(found[row], world_matrices(joints, pose), atol=1e2 * EXACT)
        assert np.array_equal(places[row], placement_matrix(pose))
    assert np.array_equal(worlds(joints, poses, rotations), found)


def test_palettes_depend_on_the_shape():
    figure = viewer.load(bundled_body()).actors[0].figure
    poses = []
    rng = np.random.default_rng(1)
    for _ in range(3):
        pose = figure_pose(figure)
        pose.shape_weights[:2] = 1.0, -2.0
        pose.dofs[:] = rng.normal(0.0, 0.3, len(pose.dofs))
        poses.append(pose)
    body = shaped(figure, poses[0].shape_weights)
    assert body is not figure
    found = palettes(figure, poses)
    for row, pose in enumerate(poses):
        wanted = skinning_matrices(world_matrices(body.skeleton, pose), body.skin.inverse_bind)
        assert np.allclose(found[row], wanted, atol=1e2 * EXACT)


def same(first: Actor, second: Actor) -> None:
    assert first.is_present == second.is_present
    for name in ("dofs", "translations", "rotations", "scales", "shape_weights"):
        found, wanted = getattr(first.pose, name), getattr(second.pose, name)
        assert np.allclose(found, wanted, atol=EXACT), name
    assert first.pose.figure_scale == second.pose.figure_scale
    assert np.array_equal(first.pose.figure_translation, second.pose.figure_translation)


def both_ways(make, time: float, interpolate: bool = False) -> list[Actor]:
    """Pose actors together, compare them with actors posed one by one, and return them."""
    together, alone = make(), make()
    pose_actors(together, time, interpolate)
    for first, second in zip(together, alone, strict=True):
        pose_actors([second], time, interpolate)
        same(first, second)
    return together


def keyed(joints: Skeleton) -> Clip:
    channels = tuple(
        Channel(dof, np.array([0.0, 1.0]), np.array([0.1 * dof, 1.0]), (("smooth", "smooth"),) * 2)
        for dof in range(0, joints.n_dofs, 2)
    )
    return Clip("keyed", channels, 0.0, 1.0)


@pytest.mark.parametrize("time", [-0.5, 0.0, 0.4, 2.0])
def test_actors_with_keyed_curves_are_posed_together(time):
    joints = moving_skeleton()
    figure, clip = Figure("f", skeleton=joints), keyed(joints)
    actors = both_ways(
        lambda: [Actor(figure, clip=clip, offset=0.1 * number) for number in range(5)], time
    )
    # The angle of joint 1 is limited to half a radian, and neighbouring actors differ in time.
    assert max(actor.pose.dofs[3] for actor in actors) <= 0.5
    if time == 0.4:
        assert len({actor.pose.dofs[2] for actor in actors}) > 1


def captured(n_joints: int, rows=(0, 1, -1, 2), **parts) -> SampledClip:
    rng = np.random.default_rng(2)
    turns = rng.normal(size=(3, n_joints, 4))
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    return SampledClip("captured", Timing(2.0, rows, holds=False), turns, **parts)


@pytest.mark.parametrize("interpolate", [False, True])
@pytest.mark.parametrize("time", [-1.0, 0.0, 0.3, 0.5, 1.2, 1.5, 3.0])
@pytest.mark.parametrize("kind", ["balls", "others"])
def test_actors_with_frames_are_posed_together(kind, time, interpolate):
    rng = np.random.default_rng(3)
    if kind == "balls":
        dofs = [(joint, axis, 0.0) for joint in range(3) for axis in "xyz"]
        joints = skeleton([-1, 0, 1], [*dofs, (0, "tx", 0.2, 0.1, 1.0)])
    else:
        joints = moving_skeleton()
    count = joints.n_joints
    clip = captured(
        count,
        translations=rng.normal(size=(3, count, 3)),
        figure_translations=rng.normal(size=(3, 3)),
        figure_scales=rng.uniform(0.5, 2.0, 3),
    )
    figure = Figure("f", skeleton=joints)
    actors = both_ways(
        lambda: [Actor(figure, clip=clip, offset=0.25 * number) for number in range(6)],
        time,
        interpolate,
    )
    if time == 1.2 and not interpolate:  # some actors are in the gap
        assert {actor.is_present for actor in actors} == {True, False}


def test_actors_with_different_motions_are_all_posed():
    joints = moving_skeleton()
    first, second = Figure("a", skeleton=joints), Figure("b", skeleton=joints)
    layout = PointLayout("one", ("p",), np.zeros((0, 2)), [0])
    dot = Actor(
        Figure("dot", points=layout),
        clip=PointClip("dot", Timing(1.0, [0, 1]), [[[0, 0, 0, 1.0]], [[2.0, 0, 0, 1.0]]]),
    )
    clip, still = keyed(joints), Actor(first)
    before = still.pose.dofs.copy()
    actors = [
        Actor(first, clip=clip),
        dot,
        still,
        Actor(second, clip=clip),
        Actor(first, clip=clip),
    ]
    pose_actors(actors, 0.5)
    assert dot.points[0].tolist() == [1.0, 0.0, 0.0, 1.0]
    assert np.array_equal(still.pose.dofs, before)
    for actor in (actors[0], actors[3], actors[4]):
        assert actor.pose.dofs[0] == pytest.approx(0.5)
    pose_actors([], 0.0)
