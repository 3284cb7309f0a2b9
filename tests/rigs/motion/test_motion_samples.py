"""Motions at many times: arrays, paths, onion skins, joints and instances."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formats.synthetic_smpl import joint_parents, model
from formats.video_mocap.tool_files import matrices, scene_of, vertices, wham, wham_file
from numpy.testing import assert_allclose, assert_array_equal
from rendering.moving import MISSING, RATE, SPEED, moving_arm
from rigs.animated import about, channel, clip_of
from rigs.hand_made import skeleton

import viewer
from viewer.errors import RigError
from viewer.loading import bundled_body
from viewer.rigs.captures.points import PointClip, PointLayout
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.kinematics import skinning_matrices, world_matrices
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.motion.evaluation import Frames, world_frames
from viewer.rigs.motion.instances import placements, pose_arrays, worlds
from viewer.rigs.motion.motion_paths import motion_path, path_times, segments
from viewer.rigs.motion.onion import FAINTEST, onion
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.pose import Pose, joint_rotations, local_rotations, placement_matrix, rest_pose
from viewer.rigs.scene import Actor, Scene, pose_actors, still_pose
from viewer.rigs.shape import shaped
from viewer.rigs.skeleton import Skeleton, ball_skeleton

BALLS = [(joint, axis, 0.0) for joint in range(2) for axis in ("tx", "x", "y", "z")]
ONCE = Timing(30.0, [0])
TURN = channel(1, "rotation", [0.0], [about(0, 90.0)])


def curves() -> Clip:
    """Return a curve of the second joint's angle about x, DOF 5."""
    return Clip("curves", (Channel(5, [0.0], [0.25], (("flat", "flat"),)),), 0.0, 1.0)


def rest_frame() -> SampledClip:
    """Return one frame at rest without translations."""
    return SampledClip("frames", ONCE, np.tile([0.0, 0, 0, 1], (1, 2, 1)))


def actor(clip) -> Actor:
    """Return an actor of two ball joints, with 1 everywhere in its pose."""
    made = Actor(Figure("two", skeleton=skeleton([-1, 0], BALLS)), clip=clip)
    made.pose.dofs[:] = made.pose.translations[:] = made.pose.scales[:] = 1.0
    made.pose.figure_scale = 3.0
    return made


def test_frames_without_translations_put_joints_at_rest():
    moved = actor(rest_frame())
    pose_actors([moved], 0.0)
    assert not moved.pose.translations.any() and not moved.pose.dofs.any()
    assert moved.pose.figure_scale == 3.0 and (moved.pose.scales == 1.0).all()


def test_still_pose_resets_only_what_curves_set():
    found = still_pose(actor(curves()))
    assert_array_equal(found.dofs, [1, 1, 1, 1, 1, 0, 1, 1])
    assert (found.translations == 1.0).all()


def test_still_pose_resets_only_what_keys_of_transforms_set():
    found = still_pose(actor(clip_of(TURN, channel(0, "translation", [0.0], [[2.0, 0, 0]]))))
    # The first joint keeps its angles, the second one its translation.
    assert_array_equal(found.dofs, [0, 1, 1, 1, 1, 0, 0, 0])
    assert_array_equal(found.translations, [[0, 0, 0], [1, 1, 1]])


def test_still_pose_resets_all_joints_that_frames_set():
    found = still_pose(actor(rest_frame()))
    assert not found.dofs.any() and not found.translations.any()
    assert (found.scales == 1.0).all() and found.figure_scale == 3.0


@pytest.mark.parametrize(
    ("clip", "names"),
    [
        (curves(), ["joint_motion", "keyed"]),
        (clip_of(TURN), ["joint_motion", "keyed", "transforms"]),
        (rest_frame(), ["joint_motion", "captured"]),
        (PointClip("points", ONCE, np.zeros((1, 3, 4))), ["captured"]),
        (None, []),
    ],
)
def test_actor_names_its_motion_by_what_it_is(clip, names):
    made = actor(clip)
    every = ["joint_motion", "keyed", "captured", "transforms"]
    assert [name for name in every if getattr(made, name) is not None] == names
    assert all(getattr(made, name) is clip for name in names)
    assert made.moves_points == (names == ["captured"])


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Scene]:
    path: Path = wham_file(tmp_path_factory.mktemp("wham"))
    return {space: scene_of(path, "smpl", space) for space in ("world", "camera")}


def joints(row: int, pose: str, trans: str) -> Any:
    """Return the joints of the second person by the published equations."""
    found = wham()[4]
    turned = matrices(found[pose][row].reshape(24, 3))
    return vertices("smpl", model("smpl"), found["betas"][row], turned, found[trans][row])[1]


def test_arrays_have_all_frames_and_their_presence(scenes):
    motion = viewer.motion(scenes["world"].actors[1])
    assert (motion.name, motion.frame_rate) == ("wham_output 4", 30.0)
    assert motion.frames.tolist() == [*range(8)]
    assert np.flatnonzero(motion.present).tolist() == [3, 4, 6, 7]
    assert motion.joint_names[:2] == ("pelvis", "left_hip")
    assert_array_equal(motion.parents, joint_parents("smpl"))


def test_rotations_and_translations_are_those_of_the_file(scenes):
    motion = viewer.motion(scenes["world"].actors[1])
    found = wham()[4]
    for row, frame in enumerate((3, 4, 6, 7)):
        turned = quaternion_to_matrix(motion.rotations[frame])
        assert_allclose(turned, matrices(found["pose_world"][row].reshape(24, 3)), atol=1e-9)
        assert_allclose(motion.translations[frame], found["trans_world"][row], atol=1e-9)
        assert_allclose(motion.shape_weights[frame], found["betas"][row], atol=1e-9)


def test_joints_are_returned_in_the_space_of_the_file_and_upright(scenes):
    motion = viewer.motion(scenes["camera"].actors[1])
    wanted = joints(1, "pose", "trans")
    assert_allclose(motion.joints("figure")[4], wanted, atol=1e-6)
    assert_allclose(motion.joints()[4], wanted * [1, -1, -1], atol=1e-6)
    assert np.isnan(motion.joints()[5]).all()


def test_gaps_may_be_interpolated(scenes):
    motion = viewer.motion(scenes["world"].actors[1], interpolate=True)
    assert motion.present[5]
    assert_allclose(motion.translations[5], motion.translations[[4, 6]].mean(axis=0), atol=1e-9)


def test_unknown_spaces_are_refused(scenes):
    with pytest.raises(RigError, match='no space "camera"'):
        viewer.motion(scenes["world"].actors[0]).joints("camera")


STILL = [0.0, 0.0, 0.0, 1.0]
QUARTER = [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]  # about z


def two_joints() -> Figure:
    """Return two joints; joint 1 is at x = 2 from joint 0, which rotates about z."""
    return Figure("f", skeleton=skeleton([-1, 0], [(0, "z", 0.0)], offsets=[[0, 0, 0], [2, 0, 0]]))


def capture(rows=(0, 1), **parts) -> SampledClip:
    turns = np.array([[STILL, STILL], [QUARTER, STILL]])
    return SampledClip("c", Timing(10.0, rows), turns, **parts)


def test_joint_path_follows_the_rotation_of_its_parent():
    path = motion_path(two_joints(), capture(), [1, 0])
    assert path.times.tolist() == [0.0, 0.1]
    assert path.present.all()
    assert np.allclose(path.points, [[[2, 0, 0], [0, 0, 0]], [[0, 2, 0], [0, 0, 0]]], atol=1e-12)


def test_path_includes_placement_and_interpolates_between_frames():
    clip = capture(figure_translations=[[0, 0, 0], [0, 0, 3.0]], figure_scales=[1.0, 2.0])
    path = motion_path(two_joints(), clip, [1], times=[0.05, 0.1])
    half = np.sqrt(0.5)
    assert np.allclose(path.points[:, 0], [[3 * half, 3 * half, 1.5], [0, 4, 3]], atol=1e-12)


def test_base_pose_supplies_values_that_the_clip_lacks():
    figure = two_joints()
    base = figure_pose(figure)
    base.figure_translation[:] = 5.0, 0.0, 0.0
    path = motion_path(figure, capture(), [1], base=base)
    assert np.allclose(path.points[:, 0], [[7, 0, 0], [5, 2, 0]], atol=1e-12)


def test_gaps_split_the_path():
    path = motion_path(two_joints(), capture(rows=(0, 1, -1, 0, 1, 0)), [0, 1])
    assert path.present[:, 0].tolist() == [True, True, False, True, True, True]
    points, times, which = segments(path)
    assert which.tolist() == [0, 0, 0, 1, 1, 1]
    assert np.allclose(times, [[0.0, 0.1], [0.3, 0.4], [0.4, 0.5]] * 2)
    assert np.allclose(points[3], [[2, 0, 0], [0, 2, 0]], atol=1e-12)
    assert np.allclose(points[5], [[0, 2, 0], [2, 0, 0]], atol=1e-12)


def test_keyed_paths_are_sampled_at_60_hz():
    figure = two_joints()
    channel = Channel(0, np.array([1.0, 2.0]), np.array([0.0, np.pi]), (("linear", "linear"),) * 2)
    clip = Clip("k", (channel,), 1.0, 2.0)
    times = path_times(clip)
    assert len(times) == 61 and times[0] == 1.0 and times[-1] == 2.0
    path = motion_path(figure, clip, [1])
    angle = np.pi * (path.times - 1.0)
    wanted = 2.0 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    assert np.allclose(path.points[:, 0], wanted, atol=1e-12)


@pytest.mark.parametrize(("length", "count"), [(0.0, 1), (0.01, 2), (1e6, 20_000)])
def test_very_short_and_very_long_paths_have_few_points(length, count):
    assert len(path_times(Clip("k", (), 0.0, length))) == count


def test_capture_paths_have_a_point_per_frame():
    timing = Timing(25.0, [0, -1, 0], start=2.0)
    clip = SampledClip("c", timing, np.tile(STILL, (1, 2, 1)))
    assert path_times(clip) == pytest.approx([2.0, 2.04, 2.08])


def test_long_captures_have_the_same_path_in_chunks():
    count = 9000  # more frames than one batch
    angles = np.linspace(0.0, 20.0, count)
    turns = np.tile(STILL, (count, 2, 1))
    turns[:, 0, 2], turns[:, 0, 3] = np.sin(angles / 2), np.cos(angles / 2)
    clip = SampledClip("c", Timing(60.0, np.arange(count)), turns)
    path = motion_path(two_joints(), clip, [1])
    wanted = 2.0 * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    assert np.allclose(path.points[:, 0], wanted, atol=1e-12)


def points_clip() -> tuple[Figure, PointClip]:
    points = np.zeros((4, 2, 4))
    points[:, 0, 0] = np.arange(4)
    points[:, 1, 1] = np.arange(4)
    points[:, :, 3] = [[1.0, 0.5], [1.0, 0.05], [0.0, 0.5], [1.0, 0.5]]
    layout = PointLayout("two", ("a", "b"), np.zeros((0, 2)), [0, 0])
    return Figure("p", points=layout), PointClip("p", Timing(1.0, [0, 1, 2, 3, -1, 3]), points)


def test_captured_points_have_paths_where_detected():
    figure, clip = points_clip()
    path = motion_path(figure, clip, [1, 0], min_confidence=0.1)
    assert path.present[:, 0].tolist() == [True, False, True, True, False, True]
    assert path.present[:, 1].tolist() == [True, True, False, True, False, True]
    points, _, which = segments(path)
    assert which.tolist() == [0, 1]
    assert points.tolist() == [[[0, 2, 0], [0, 3, 0]], [[0, 0, 0], [1, 0, 0]]]
    # Undetected points are absent for any minimum confidence.
    assert motion_path(figure, clip, [0]).present[2, 0] == np.False_


def test_clip_without_frames_has_no_path():
    figure, _ = points_clip()
    clip = PointClip("p", Timing(1.0, [-1, -1]), np.zeros((0, 2, 4)))
    path = motion_path(figure, clip, [0])
    assert not path.present.any()
    assert [len(part) for part in segments(path)] == [0, 0, 0]


def test_motion_of_another_skeleton_is_refused():
    clip = SampledClip("c", Timing(1.0, [0]), np.tile(STILL, (1, 5, 1)))
    with pytest.raises(RigError) as caught:
        motion_path(two_joints(), clip, [0])
    assert str(caught.value) == "clip c has 5 joints, but figure f has 2"


def test_onion_has_poses_at_even_times_with_rising_opacity():
    scene = Scene([moving_arm(), Actor(moving_arm().figure)])
    still, *poses = onion(scene, 6).actors
    assert still.clip is None and still.opacity == 1.0
    # The six times in one second do not include frame 5, the only missing frame.
    places = [actor.pose.figure_translation[0] for actor in poses]
    np.testing.assert_allclose(places, SPEED * np.array([1.0, 0.8, 0.6, 0.4, 0.2, 0.0]), atol=1e-12)
    expected = np.linspace(1.0, FAINTEST, 6)
    np.testing.assert_allclose([actor.opacity for actor in poses], expected)
    assert scene.actors[0].clip is not None and scene.actors[0].opacity == 1.0


def test_onion_omits_absent_people_unless_gaps_are_interpolated():
    scene = Scene([moving_arm()])
    times = [0.0, MISSING / RATE, 1.0]
    opacities = [actor.opacity for actor in onion(scene, times).actors]
    assert opacities == pytest.approx([1.0, FAINTEST])
    assert len(onion(scene, times, interpolate=True).actors) == 3


def test_onion_without_motion_is_refused():
    with pytest.raises(RigError, match="nothing moves"):
        onion(Scene([Actor(moving_arm().figure)]), 4)
    with pytest.raises(RigError, match="expected at least one time"):
        onion(Scene([moving_arm()]), [])


PARENTS = np.array([-1, 0, 1, 0, -1, 4], dtype=np.int32)


@pytest.fixture
def frames():
    rng = np.random.default_rng(0)
    n_frames, n_joints = 7, len(PARENTS)
    return Frames(
        np.arange(n_frames) / 30.0,
        np.ones(n_frames, dtype=np.bool_),
        rng.normal(size=(n_frames, n_joints, 4)),  # not of unit length
        rng.normal(size=(n_frames, n_joints, 3)),
        np.ones((1, n_joints, 3)),
        np.zeros((1, 0)),
        rng.normal(size=(n_frames, 3)),
        rng.uniform(0.5, 2.0, n_frames),
    )


@pytest.fixture
def figure():
    places = np.arange(3.0 * len(PARENTS)).reshape(-1, 3)
    return Figure("a", skeleton=ball_skeleton(tuple("abcdef"), PARENTS, places))


def test_rotation_by_90_degrees_moves_the_child_to_the_side(figure, frames):
    half = np.sqrt(0.5)
    still = replace(
        frames,
        rotations=np.tile([0.0, 0.0, half, half], (7, 6, 1)),
        translations=np.zeros((7, 6, 3)),
        figure_scales=np.full(7, 2.0),
        figure_translations=np.tile([10.0, 0.0, 0.0], (7, 1)),
    )
    # The second joint is at (3, 3, 3) from the first, at (0, 1, 2): rotated about z to (-3, 3, 3).
    assert_allclose(world_frames(figure, still)[:, 1, :3, 3], np.tile([4.0, 8.0, 10.0], (7, 1)))


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
    arrays = pose_arrays(poses)
    rotations, found, places = (
        local_rotations(joints, arrays.rotations, arrays.dofs),
        worlds(joints, arrays),
        placements(poses),
    )
    assert found.shape == (7, 4, 4, 4)
    for row, pose in enumerate(poses):
        assert np.allclose(rotations[row], joint_rotations(joints, pose), atol=EXACT)
        assert np.allclose(found[row], world_matrices(joints, pose), atol=1e2 * EXACT)
        assert np.array_equal(places[row], placement_matrix(pose))
    assert np.array_equal(worlds(joints, pose_arrays(poses), rotations), found)


@pytest.mark.parametrize("rows", [[0, 2, 1, 3], [2, 5, 0, 4], [1, 2, 3], [6]])
def test_poses_are_taken_in_the_order_of_the_rows(rows):
    """Translucent actors are sorted by opacity, so rows need not ascend."""
    poses = random_poses(moving_skeleton(), 7)
    found = pose_arrays(poses).rows(np.array(rows))
    for pose, dofs, places in zip(
        [poses[k] for k in rows], found.dofs, found.translations, strict=True
    ):
        assert_array_equal(dofs, pose.dofs)
        assert_array_equal(places, pose.translations)


def test_skinning_matrices_depend_on_the_shape():
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
    found = skinning_matrices(worlds(body.skeleton, pose_arrays(poses)), body.skin.inverse_bind)
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
