"""Keys of transforms: sampled, edited and posed."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rigs.animated import (
    HALF,
    STACKED,
    about,
    animated_leg,
    bow,
    channel,
    clip_of,
    leg,
    plain_value,
    wave,
)

from viewer.errors import RigError
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.motion.evaluation import frames_between, frames_of, pose_of, world_frames
from viewer.rigs.motion.motion_paths import motion_path, path_times
from viewer.rigs.motion.onion import onion
from viewer.rigs.motion.sampled_animation import baked, frame_range, sample_animation, single_frame
from viewer.rigs.motion.transform_clip import TransformClip, is_regular, key_rate, sample_transforms
from viewer.rigs.pose import joint_rotations, local_matrices
from viewer.rigs.scene import Actor, Scene, pose_actors, scene_rate
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.transform_keys.edit import (
    add_transform_key,
    added_key,
    delete_transform_keys,
    key_transform_pose,
    move_transform_keys,
    set_clip_interpolation,
    set_transform_key,
    set_transform_slope,
    value_at,
    with_interpolation,
)
from viewer.rigs.transform_keys.euler_curves import row_values, rows_of

EXACT = 1e-14  # a few rounding errors of numbers near 1


def test_linear_rotations_have_constant_speed_along_the_shorter_arc():
    # The second key is negated, which is the same rotation: the arc is 90 degrees, not 270.
    keys = [about(2, 0.0), -np.array(about(2, 90.0)), about(2, 180.0)]
    found = sample_transforms(clip_of(channel(3, "rotation", [1.0, 2.0, 4.0], keys)),
                              np.array([1.0, 1.25, 1.5, 2.0, 3.0, 4.0]))  # fmt: skip
    angles = np.radians([0.0, 22.5, 45.0, 90.0, 135.0, 180.0])
    assert_array_equal(found.rotated, [3])
    turned = quaternion_to_matrix(found.rotations[:, 0])[:, :2, 0]
    assert_allclose(turned, np.stack([np.cos(angles), np.sin(angles)], axis=1), atol=EXACT)
    assert_allclose(np.linalg.norm(found.rotations, axis=-1), 1.0, atol=EXACT)


def test_long_quaternions_are_normalised_and_tiny_rotations_are_exact():
    tiny = 1e-8
    keys = 5.0 * np.array([[0.0, 0, 0, 1], [tiny / 2, 0, 0, 1]])
    found = sample_transforms(clip_of(channel(0, "rotation", [0.0, 1.0], keys)), [0.0, 0.25])
    assert_allclose(found.rotations[:, 0], [[0, 0, 0, 1], [tiny / 8, 0, 0, 1]], rtol=1e-9)


def test_steps_change_exactly_at_their_keys():
    found = sample_transforms(
        clip_of(channel(0, "translation", [0.1, 0.3], [[1.0, 0, 0], [2, 0, 0]], "step")),
        np.array([-1.0, 0.1, np.nextafter(0.3, 0.0), 0.3, 9.0]),
    )
    assert_array_equal(found.translations[:, 0, 0], [1.0, 1.0, 1.0, 2.0, 2.0])


def test_cubic_channels_follow_their_polynomial_and_its_slopes():
    # x(t) = t^3 - t on 0..2, of which keys and slopes are exact.
    times = np.array([0.0, 0.5, 2.0])
    values, slopes = times**3 - times, 3 * times**2 - 1
    three = np.stack([values, 2 * values, 0 * values], axis=1)
    tangents = np.repeat(np.stack([slopes, 2 * slopes, 0 * slopes], axis=1)[:, None], 2, axis=1)
    clip = clip_of(channel(0, "scale", times, three, "cubic", tangents))
    at = np.linspace(0.0, 2.0, 41)
    found = sample_transforms(clip, at).scales[:, 0]
    assert_allclose(found[:, 0], at**3 - at, atol=EXACT)
    assert_allclose(found[:, 1], 2 * (at**3 - at), atol=EXACT)
    assert_array_equal(sample_transforms(clip, times).scales[:, 0], three)


def test_cubic_rotations_are_normalised_after_interpolation():
    # With zero tangents, the middle is the mean of the keys: a rotation by 45 degrees with length
    # cos(22.5 deg).
    keys = [about(2, 0.0), about(2, 90.0)]
    clip = clip_of(channel(0, "rotation", [0.0, 1.0], keys, "cubic", np.zeros((2, 2, 4))))
    assert_allclose(sample_transforms(clip, [0.5]).rotations[0, 0], about(2, 45.0), atol=EXACT)
    # A spline from a quaternion to its negative passes through 0.
    keys = [[0.0, 0, 0, 1], [0, 0, 0, -1]]
    clip = clip_of(channel(0, "rotation", [0.0, 1.0], keys, "cubic", np.zeros((2, 2, 4))))
    assert_array_equal(sample_transforms(clip, [0.5]).rotations[0, 0], [0, 0, 0, 1])


def test_each_channel_keeps_its_end_values_outside_its_range():
    clip = clip_of(
        channel(0, "translation", [1.0], [[7.0, 8, 9]]),
        channel(1, "translation", [2.0, 3.0], [[0.0, 0, 0], [4, 0, 0]]),
        channel(1, "scale", [0.0, 2.0], [[1.0, 1, 1], [-3, 1, 1]]),
    )
    found = sample_transforms(clip, np.array([-5.0, 0.5, 2.5, 50.0]))
    assert_array_equal(found.translated, [0, 1])
    assert_array_equal(found.translations[:, 0], [[7.0, 8, 9]] * 4)
    assert_array_equal(found.translations[:, 1, 0], [0.0, 0.0, 2.0, 4.0])
    assert_array_equal(found.scales[:, 0, 0], [1.0, 0.0, -3.0, -3.0])
    assert found.rotations.shape == (4, 0, 4) and found.shape_weights.shape == (4, 0)


def random_clip(rng, interpolation: str | None = None) -> TransformClip:
    """Return channels of every kind; some share their times, most have different ranges."""
    shared, channels = np.sort(rng.uniform(0.0, 3.0, 9)), []
    for joint in range(6):
        for path, width in (("translation", 3), ("rotation", 4), ("scale", 3)):
            count = int(rng.integers(1, 12))
            times = shared if rng.random() < 0.4 else np.sort(rng.uniform(-1.0, 4.0, count))
            how = interpolation or str(rng.choice(["step", "linear", "cubic"]))
            shape = len(times), width
            slopes = rng.normal(size=(len(times), 2, width)) if how == "cubic" else None
            channels.append(channel(joint, path, times, rng.normal(size=shape), how, slopes))
    channels.append(channel(-1, "weights", shared, rng.normal(size=(9, 3)), "linear"))
    order = rng.permutation(len(channels))
    return clip_of(*[channels[index] for index in order])


@pytest.mark.parametrize("seed", range(3))
def test_all_channels_agree_with_the_formulas_of_gltf(seed):
    rng = np.random.default_rng(seed)
    clip = random_clip(rng)
    keys = np.concatenate([one.times for one in clip.channels])
    times = np.concatenate([rng.uniform(-2.0, 5.0, 40), keys])
    found = sample_transforms(clip, times)
    by_path = {
        "translation": (found.translated, found.translations),
        "rotation": (found.rotated, found.rotations),
        "scale": (found.scaled, found.scales),
    }
    for one in clip.channels:
        wanted = np.stack([plain_value(one, time) for time in times])
        if one.path == "weights":
            values = found.shape_weights[:, [found.weighted.tolist().index(s) for s in one.shapes]]
        else:
            joints, values = by_path[one.path]
            values = values[:, joints.tolist().index(one.joint)]
        if one.path == "rotation":
            cosines = np.abs(np.einsum("ta,ta->t", values, wanted))
            assert_allclose(cosines, 1.0, atol=1e-12)
        else:
            assert_allclose(values, wanted, atol=1e-12)
    # Evaluating one time at a time returns the same numbers as all times together.
    single = sample_transforms(clip, times[7:8])
    assert_array_equal(single.rotations[0], found.rotations[7])
    assert_array_equal(single.translations[0], found.translations[7])


def test_clip_without_channels_has_no_samples():
    found = sample_transforms(TransformClip("empty", (), 0.0, 1.0), [0.0, 1.0])
    assert found.rotations.shape == (2, 0, 4) and found.shape_weights.shape == (2, 0)


def test_zero_quaternion_is_not_a_rotation():
    with pytest.raises(RigError, match="key 1"):
        channel(0, "rotation", [0.0, 1.0], [[0.0, 0, HALF, HALF], [0, 0, 0, 0]])


@pytest.mark.parametrize(
    ("times", "rate"),
    [
        (np.arange(20) / 24.0, 24.0),
        (1.0 + np.arange(20) / 30.0, 30.0),
        (np.float32(np.arange(1000) / 60.0), 60.0),
        ([0.0, 1.0], 30.0),
        ([0.04, 0.08], 25.0),
        (np.float32(np.arange(524) / 120.0), 120.0),
        (0.5 + np.arange(90) / 90.0, 90.0),
        (1.0 / 60.0 + np.arange(90) / 30.0, 30.0),
        (np.float32(np.arange(2000) * 1001.0 / 120000.0), 120000.0 / 1001.0),
        (np.float32(1000.0 + np.arange(200) / 120.0), 120.0),
        (np.arange(200) / 83.3, 83.3),
        # Six frames between keys that are 0.2313 s apart.
        (np.arange(20) * 0.2313, 6.0 / 0.2313),
        (np.arange(20) / 30.0 + 0.01 * np.arange(20) ** 2, 30.0),
        ([0.0, 0.1, 0.10001, 1.0], 30.0),
    ],
)
def test_frame_rate_is_estimated_from_the_keys(times, rate):
    clip = clip_of(channel(0, "translation", times, np.zeros((len(times), 3))))
    assert key_rate(clip) == pytest.approx(rate, rel=1e-5)


@pytest.mark.parametrize(
    ("times", "rate", "regular"),
    [
        # The first usual rate whose frames hold these keys is 30.
        ([0.0, 1.0, 1.5], 24.0, True),
        # A motion recorded at 30 per second in a scene of 24; two keys there are as regular.
        (np.arange(31) / 30.0, 30.0, True),
        ([0.0, 0.1, 1.0], 24.0, False),
        ([0.0, 0.1, 0.2345], 24.0, False),
    ],
)
def test_stated_rate_counts_frames_unless_most_frames_of_another_rate_have_keys(
    times, rate, regular
):
    moved = channel(0, "translation", times, np.zeros((len(times), 3)))
    clip = replace(clip_of(moved), stated_rate=24.0)
    assert (key_rate(clip), is_regular(clip)) == (rate, regular)


def test_keys_added_by_a_reader_do_not_count_as_frames():
    own = np.arange(10) / 30.0
    times = np.append(own, 5.5 / 30.0)
    moved = channel(0, "translation", np.sort(times), np.zeros((11, 3)))
    assert key_rate(clip_of(moved)) == 60.0
    assert key_rate(clip_of(replace(moved, key_times=own))) == 30.0


def test_keys_at_irregular_times_are_recognised():
    regular, odd = np.arange(9) / 120.0, np.array([0.0, 0.1, 0.2345])
    clips = [
        clip_of(channel(0, "translation", at, np.zeros((len(at), 3)))) for at in (regular, odd)
    ]
    assert [is_regular(clip) for clip in clips] == [True, False]


def test_end_of_the_range_tells_the_rate_of_a_held_pose():
    """A program at 24 frames per second holds one key for a frame."""
    held = channel(0, "translation", [0.0], np.zeros((1, 3)))
    assert key_rate(replace(clip_of(held), end=1.0 / 24.0)) == 24.0
    # An end between frames tells nothing.
    walk = channel(0, "translation", np.arange(20) / 24.0, np.zeros((20, 3)))
    assert key_rate(replace(clip_of(walk), end=0.9)) == 24.0


SKELETON = leg().require_skeleton()
GAP = 1e-3
EDITED = 1e-12


def row_of(clip, path: str, joint: int, component: int) -> int:
    rows = rows_of(clip, SKELETON)
    return next(
        index
        for index, row in enumerate(rows)
        if (row.path, row.joint, row.component) == (path, joint, component)
    )


def test_curves_are_shown_for_keyed_components_and_all_rotations():
    rows = rows_of(wave(), SKELETON)
    assert [(row.path, row.joint, row.channel) for row in rows[::3]] == [
        ("translation", 0, 0), ("rotation", 0, 1), ("rotation", 1, 2), ("scale", 1, 3),
        ("rotation", 2, -1), ("weights", -1, 4),
    ]  # fmt: skip
    times = np.array([0.5, 1.0, 2.5])
    chosen = [row_of(wave(), "rotation", 0, 2), row_of(wave(), "rotation", 1, 0),
              row_of(wave(), "scale", 1, 1), len(rows) - 2]  # fmt: skip
    # The rest rotation of the knee is 90 degrees about x; its first key is at 0, the second at -60.
    wanted = [[0.0, 0, 1, 0], [np.pi / 4, -np.pi / 3, 1.5, 0.5], [np.pi / 2, -np.pi / 3, 3, 1]]
    assert_allclose(row_values(wave(), SKELETON, chosen, times), wanted, atol=EDITED)


def test_moved_keys_stop_at_neighbours_in_all_components():
    clip, row = wave(), row_of(wave(), "translation", 0, 1)
    moved = move_transform_keys(clip, SKELETON, [(row, 1)], 0.25, 0.5, GAP)
    assert_array_equal(moved.channels[0].times, [0.5, 1.25, 2.0])
    assert_array_equal(moved.channels[0].values[1], [1.0, 0.5, 0.0])
    far = move_transform_keys(clip, SKELETON, [(row, 1), (row + 1, 1)], 9.0, 0.0, GAP)
    assert_allclose(far.channels[0].times, [0.5, 2.0 - GAP, 2.0], atol=EDITED)
    assert_array_equal(clip.channels[0].times, [0.5, 1.0, 2.0])
    placed = set_transform_key(clip, SKELETON, (row, 2), time=0.1, value=7.0)
    assert (
        placed.channels[0].times[2] == pytest.approx(1.001) and placed.channels[0].values[2, 1] == 7
    )


def test_angles_of_a_rotation_key_are_relative_to_rest():
    clip, row = wave(), row_of(wave(), "rotation", 1, 1)
    found = (
        set_transform_key(clip, SKELETON, (row, 0), value=np.radians(20.0)).channels[2].values[0]
    )
    wanted = quaternion_to_matrix(np.array(about(0, 90.0))) @ quaternion_to_matrix(
        np.array(about(1, 20.0))
    )
    assert_allclose(quaternion_to_matrix(found), wanted, atol=EDITED)
    # Beyond 90 degrees the rotation has different angles, so the middle angle stops at 90.
    steep = set_transform_key(clip, SKELETON, (row, 0), value=2.0)
    assert row_values(steep, SKELETON, [row], np.array([0.5]))[0, 0] == pytest.approx(np.pi / 2)


def cubic_turn():
    rng = np.random.default_rng(4)
    keys = [about(0, 0.0), about(1, 60.0), about(2, 100.0)]
    slopes = rng.normal(0.0, 0.3, (3, 2, 4))
    return clip_of(channel(1, "rotation", [0.0, 1.0, 3.0], keys, "cubic", slopes))


@pytest.mark.parametrize("clip", [wave(), cubic_turn(), bow()])
def test_added_key_keeps_the_shape_of_every_curve(clip):
    times = np.linspace(0.0, 3.0, 61)
    before = sample_transforms(clip, times)
    for index, row in enumerate(rows_of(clip, SKELETON)):
        if row.channel >= 0 and row.component == 0:
            clip = add_transform_key(clip, rows_of(clip, SKELETON)[index], 0.77)
    after = sample_transforms(clip, times)
    for name in ("rotations", "translations", "scales", "shape_weights"):
        found, wanted = getattr(after, name), getattr(before, name)
        if name == "rotations":
            found, wanted = quaternion_to_matrix(found), quaternion_to_matrix(wanted)
        assert_allclose(found, wanted, atol=EDITED, err_msg=name)
    assert all(0.77 in one.times for one in clip.channels)


def test_key_at_a_time_rounded_to_single_precision_is_changed_and_not_duplicated():
    third = float(np.float32(1.0 / 3.0))
    one = channel(0, "scale", [0.0, third], np.ones((2, 3)))
    changed, key = added_key(one, 1.0 / 3.0, np.array([2.0, 2, 2]))
    assert key == 1 and len(changed.times) == 2 and changed.values[1, 0] == 2.0


def test_keys_are_deleted_in_all_components_and_empty_channels_removed():
    clip = wave()
    row = row_of(clip, "translation", 0, 2)
    assert len(delete_transform_keys(clip, SKELETON, [(row, 0)]).channels[0].times) == 2
    gone = delete_transform_keys(clip, SKELETON, [(row, key) for key in range(3)])
    assert [one.path for one in gone.channels] == ["rotation", "rotation", "scale", "weights"]


def test_interpolation_changes_only_values_between_keys():
    clip = set_clip_interpolation(wave(), [0, 1], "step")
    assert_array_equal(value_at(clip.channels[0], 0.99), [0.0, 0, 0])
    curved = with_interpolation(channel(0, "scale", [0.0, 1, 3], [[0.0] * 3, [1] * 3, [3] * 3]),
                                "cubic")  # fmt: skip
    # The slope at the middle key is that between its neighbours; the ends are flat.
    assert_array_equal(curved.tangents[:, 0, 0], [0.0, 1.0, 0.0])
    keys = [about(2, 0.0), -np.array(about(2, 40.0)), about(2, 80.0)]
    turn = with_interpolation(channel(0, "rotation", [0.0, 1, 2], keys), "cubic")
    angle = 2 * np.arctan2(*value_at(turn, 1.5)[[2, 3]])
    assert np.radians(40.0) < angle < np.radians(80.0)


def test_slopes_of_cubic_keys_are_per_second():
    row = rows_of(wave(), SKELETON)[row_of(wave(), "translation", 0, 0)]
    clip = set_transform_slope(wave(), row, 1, 1, 5.0)
    step = 1e-6
    rise = value_at(clip.channels[0], 1.0 + step) - value_at(clip.channels[0], 1.0)
    assert rise[0] / step == pytest.approx(5.0, rel=1e-4)


@pytest.mark.parametrize("only_changed", [False, True])
def test_keyed_pose_is_reproduced_at_its_time(only_changed):
    figure, clip = leg(), wave()
    actor = Actor(figure, clip=clip)
    pose_actors([actor], 1.25)
    actor.pose.dofs[7] = 0.4  # the foot, which has no channel
    actor.pose.dofs[0] += 0.2
    actor.pose.translations[1, 0] += 0.5
    actor.pose.shape_weights[0] = 0.9
    wanted = actor.pose.copy()
    keyed = key_transform_pose(clip, figure, actor.pose, 1.25, only_changed)
    counts = [len(one.times) for one in keyed.channels]
    # The channels for the translation of the knee and the rotation of the foot are new.
    assert counts == ([3, 3, 2, 2, 3, 1, 1] if only_changed else [4, 3, 3, 3, 3, 1, 1])
    again = Actor(figure, clip=keyed)
    pose_actors([again], 1.25)
    for name in ("dofs", "translations", "scales", "shape_weights"):
        assert_allclose(getattr(again.pose, name), getattr(wanted, name), atol=EDITED)


def test_changed_cubic_rotation_rotates_its_spline():
    clip = cubic_turn()
    row = row_of(clip, "rotation", 1, 0)
    before = row_values(clip, SKELETON, [row, row + 1, row + 2], np.array([1.0]))[0]
    turned = set_transform_key(clip, SKELETON, (row, 1), value=before[0] + 0.5)
    turn = turned.channels[0].values[1]
    assert np.linalg.norm(turn) == pytest.approx(1.0)
    sizes = [np.linalg.norm(one.channels[0].tangents[1], axis=1) for one in (clip, turned)]
    assert_allclose(*sizes, atol=EDITED)


def test_edits_keep_the_interpolation_of_every_channel():
    clip, figure = wave(), leg()
    modes = ["cubic", "linear", "step", "linear", "linear"]
    rows = [row_of(clip, path, joint, 0) for path, joint in
            (("translation", 0), ("rotation", 0), ("rotation", 1), ("scale", 1))]  # fmt: skip
    edited = clip
    for row in rows:
        edited = move_transform_keys(edited, SKELETON, [(row, 1)], 0.01, 0.1, GAP)
        edited = set_transform_key(edited, SKELETON, (row, 0), value=0.2)
        edited = add_transform_key(edited, rows_of(edited, SKELETON)[row], 0.8)
        edited = delete_transform_keys(edited, SKELETON, [(row, 1)])
    actor = Actor(figure, clip=edited)
    pose_actors([actor], 0.9)
    edited = key_transform_pose(edited, figure, actor.pose, 0.9, False)
    assert [one.interpolation for one in edited.channels[: len(modes)]] == modes
    assert [one.tangents is not None for one in edited.channels[: len(modes)]] == [
        mode == "cubic" for mode in modes
    ]


POSED = 1e-13  # a few products of numbers near 1
TIMES = np.array([0.0, 0.5, 0.8, 1.0, 1.7, 2.2, 9.0])


def plain_local(figure: Figure, clip, time: float) -> np.ndarray:
    """Return local matrices T R S from the keys: (J, 4, 4)."""
    skeleton = figure.require_skeleton()
    parts = {
        "translation": skeleton.rest_translations.copy(),
        "rotation": skeleton.rest_rotations.copy(),
        "scale": skeleton.rest_scales.copy(),
    }
    for one in clip.channels:
        if one.path != "weights":
            parts[one.path][one.joint] = plain_value(one, time)
    local = np.tile(np.eye(4), (skeleton.n_joints, 1, 1))
    local[:, :3, :3] = quaternion_to_matrix(parts["rotation"]) * parts["scale"][:, None, :]
    local[:, :3, 3] = parts["translation"]
    return local


@pytest.mark.parametrize("time", TIMES)
def test_pose_has_the_transforms_of_the_keys(time):
    actor = Actor(leg(), clip=wave(), offset=-0.25)
    pose_actors([actor], time - 0.25)
    skeleton = actor.figure.require_skeleton()
    assert_allclose(
        local_matrices(skeleton, actor.pose), plain_local(actor.figure, wave(), time), atol=POSED
    )
    assert_allclose(actor.pose.shape_weights, plain_value(wave().channels[4], time), atol=POSED)
    # The DOFs contain the whole rotation, so that sliders show it; the quaternions are the
    # identity.
    assert_array_equal(actor.pose.rotations, skeleton.rest_rotations)


def test_euler_angles_in_gimbal_lock_reproduce_the_exact_rotation():
    lock = [about(1, 90.0), about(1, -90.0), (np.array(about(1, 90.0)) + about(0, 90.0)) / 2]
    clip = clip_of(channel(1, "rotation", [0.0, 1.0, 2.0], lock))
    actor = Actor(leg(), clip=clip)
    for time in (0.0, 1.0, 2.0, 1e-9):
        pose_actors([actor], time)
        found = joint_rotations(actor.figure.skeleton, actor.pose)[1]
        wanted = quaternion_to_matrix(plain_value(clip.channels[0], time))
        assert_allclose(found, wanted, atol=POSED)


def test_joints_without_channels_keep_their_pose():
    actor = Actor(leg(), clip=clip_of(channel(1, "rotation", [0.0, 1.0], [about(2, 0.0)] * 2)))
    actor.pose.dofs[6:] = 0.3
    actor.pose.translations[2] = 1.0, 2.0, 3.0
    actor.pose.scales[2], actor.pose.shape_weights[1] = 4.0, 0.5
    before = actor.pose.copy()
    pose_actors([actor], 0.5)
    for name in ("translations", "scales", "shape_weights"):
        assert_array_equal(getattr(actor.pose, name), getattr(before, name))
    assert_array_equal(actor.pose.dofs[6:], before.dofs[6:])
    frames = frames_of(actor.figure, actor.clip, TIMES, actor.pose)
    assert_allclose(
        world_frames(actor.figure, frames)[3],
        world_matrices(actor.figure.skeleton, actor.pose),
        atol=POSED,
    )


def test_translation_dofs_receive_the_offset_within_their_limits():
    skeleton = leg().require_skeleton()
    slides = Skeleton(
        skeleton.names, skeleton.parents, skeleton.rest_translations, skeleton.rest_rotations,
        np.ones((3, 3)), [1, 1, 2], [1, 1, 0], np.zeros(3), [[-1.0, 1], [-9, 9], [-9, 9]],
    )  # fmt: skip
    clip = clip_of(
        channel(1, "translation", [0.0, 1.0], [STACKED[1], [5.0, 7, 0]]),
        channel(2, "translation", [0.0], [[3.0, 1, 0]]),
    )
    actor = Actor(Figure("slides", skeleton=slides), clip=clip)
    pose_actors([actor], 1.0)
    assert_array_equal(actor.pose.dofs, [1.0, 0.0, 3.0])
    assert_array_equal(actor.pose.translations, [[0.0, 0, 0], [5, 5, 0], [0, 0, 0]])
    places = local_matrices(slides, actor.pose)[:, :3, 3]
    assert_array_equal(places, [[0.0, 0, 0], [5, 7, 0], [3, 1, 0]])


def test_frames_equal_the_poses_and_store_repeated_rows_once():
    figure, clip = leg(), wave()
    frames = frames_of(figure, clip, TIMES)
    assert frames.scales.shape == (len(TIMES), 3, 3) and frames.shape_weights.shape[0] == len(TIMES)
    worlds = world_frames(figure, frames)
    for row, time in enumerate(TIMES):
        actor = Actor(figure, clip=clip)
        pose_actors([actor], time)
        again = pose_of(figure, frames, row)
        assert_allclose(worlds[row], world_matrices(figure.skeleton, actor.pose), atol=POSED)
        assert_allclose(worlds[row], world_matrices(figure.skeleton, again), atol=POSED)
        assert_allclose(again.shape_weights, actor.pose.shape_weights, atol=POSED)
    part = frames_between(frames, slice(2, 4))
    assert_allclose(world_frames(figure, part), worlds[2:4], atol=POSED)
    still = frames_of(figure, clip_of(clip.channels[1]), TIMES)
    assert len(still.scales) == len(still.shape_weights) == 1


def test_actors_of_one_clip_are_posed_together():
    figure, clip = leg(), wave()
    skeleton = figure.require_skeleton()
    hinged = replace(
        skeleton,
        dof_joints=skeleton.dof_joints[:-1],
        dof_kinds=skeleton.dof_kinds[:-1],
        rest_dofs=skeleton.rest_dofs[:-1],
        dof_limits=skeleton.dof_limits[:-1],
    )
    turning = clip_of(
        *clip.channels, channel(2, "rotation", [0.0, 3.0], [about(0, 0), about(1, 80)])
    )
    for one in (figure, replace(figure, skeleton=hinged)):
        together = [Actor(one, clip=turning, offset=0.3 * number) for number in range(4)]
        alone = [actor.copy() for actor in together]
        pose_actors(together, 1.9)
        for actor, other in zip(together, alone, strict=True):
            pose_actors([other], 1.9)
            for name in ("dofs", "translations", "rotations", "scales", "shape_weights"):
                assert_allclose(getattr(actor.pose, name), getattr(other.pose, name), atol=POSED)


def test_frames_of_an_animation_have_the_rate_of_its_keys():
    figure = animated_leg()
    bow = figure.animations[1].clip()
    actor = Actor(figure, clip=bow)
    assert scene_rate([actor]) == 24.0 and scene_rate([actor, Actor(figure, clip=wave())]) == 30.0
    animation = sample_animation(actor)
    assert animation.frame_rate == 24.0 and animation.first_frame == 0
    assert_allclose(animation.frames.times, np.arange(6) / 24.0, atol=POSED)
    assert frame_range(bow, 24.0, (0, 99)) == (0, 6)
    assert sample_animation(Actor(figure, clip=wave())).frames.times[0] == 0.5


def test_baked_frames_have_the_same_poses():
    figure, clip = leg(), wave()
    sampled = baked(figure, clip)
    times = clip.start + np.arange(sampled.timing.n_frames) / 30.0
    assert sampled.timing.frame_rate == 30.0 and sampled.timing.n_frames == 61
    assert_allclose(
        world_frames(figure, frames_of(figure, sampled, times)),
        world_frames(figure, frames_of(figure, clip, times)),
        atol=POSED,
    )
    actor = Actor(figure, clip=sampled)
    pose_actors([actor], 1.5)
    assert_allclose(
        local_matrices(figure.skeleton, actor.pose), plain_local(figure, clip, 1.5), atol=POSED
    )


def test_single_frames_keep_scales_of_joints():
    actor = Actor(leg(), clip=wave())
    pose_actors([actor], 1.2)
    frame = single_frame(actor)
    assert frame.figure is actor.figure
    found = world_frames(frame.figure, frame.frames)[0]
    assert_allclose(found, world_matrices(actor.figure.skeleton, actor.pose), atol=POSED)


def test_motion_paths_and_onion_skins_follow_the_clip():
    figure, clip = leg(), wave()
    assert_allclose(path_times(clip)[[0, -1]], [0.5, 2.5])
    path = motion_path(figure, clip, [0, 2], np.array([0.5, 2.0]))
    assert_array_equal(path.points[:, 0], [[0.0, 0, 0], [1, 2, 0]])
    ghosts = onion(Scene([Actor(figure, clip=clip)]), 3).actors
    assert len(ghosts) == 3 and figure_pose(figure).scales[1, 2] == 1.0
    assert_allclose(ghosts[0].pose.scales[1], [1.0, 3.0, -1.0])
