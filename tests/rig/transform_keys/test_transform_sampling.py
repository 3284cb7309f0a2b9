"""Values of keyed transforms, compared with closed forms and the formulas of glTF."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rig.animated import HALF, about, channel, clip_of, plain_value

from viewer.errors import RigError
from viewer.rig.geometry.rotation import quaternion_to_matrix
from viewer.rig.motion.transform_clip import TransformClip, is_regular, key_rate, sample_transforms

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
