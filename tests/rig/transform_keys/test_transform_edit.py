"""Edits of keyed transforms. Curves before and after are compared with closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rig.animated import about, bow, channel, clip_of, leg, wave

from viewer.rig.geometry.rotation import quaternion_to_matrix
from viewer.rig.motion.evaluation import pose_actors
from viewer.rig.motion.transform_clip import sample_transforms
from viewer.rig.scene import Actor
from viewer.rig.transform_keys.edit import (
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
from viewer.rig.transform_keys.euler_curves import row_values, rows_of

SKELETON = leg().require_skeleton()
GAP = 1e-3
EXACT = 1e-12


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
    assert_allclose(row_values(wave(), SKELETON, chosen, times), wanted, atol=EXACT)


def test_moved_keys_stop_at_neighbours_in_all_components():
    clip, row = wave(), row_of(wave(), "translation", 0, 1)
    moved = move_transform_keys(clip, SKELETON, [(row, 1)], 0.25, 0.5, GAP)
    assert_array_equal(moved.channels[0].times, [0.5, 1.25, 2.0])
    assert_array_equal(moved.channels[0].values[1], [1.0, 0.5, 0.0])
    far = move_transform_keys(clip, SKELETON, [(row, 1), (row + 1, 1)], 9.0, 0.0, GAP)
    assert_allclose(far.channels[0].times, [0.5, 2.0 - GAP, 2.0], atol=EXACT)
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
    assert_allclose(quaternion_to_matrix(found), wanted, atol=EXACT)
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
        assert_allclose(found, wanted, atol=EXACT, err_msg=name)
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
        assert_allclose(getattr(again.pose, name), getattr(wanted, name), atol=EXACT)


def test_changed_cubic_rotation_rotates_its_spline():
    clip = cubic_turn()
    row = row_of(clip, "rotation", 1, 0)
    before = row_values(clip, SKELETON, [row, row + 1, row + 2], np.array([1.0]))[0]
    turned = set_transform_key(clip, SKELETON, (row, 1), value=before[0] + 0.5)
    turn = turned.channels[0].values[1]
    assert np.linalg.norm(turn) == pytest.approx(1.0)
    sizes = [np.linalg.norm(one.channels[0].tangents[1], axis=1) for one in (clip, turned)]
    assert_allclose(*sizes, atol=EXACT)


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
