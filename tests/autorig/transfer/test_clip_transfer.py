"""Transfer of a template's clips to the rigged figure."""

import numpy as np
import pytest
from autorig.rigged_shapes import arm
from numpy.testing import assert_allclose, assert_array_equal

from viewer.autorig.rigged import transfer_clip
from viewer.autorig.transfer import corrective_transfer
from viewer.autorig.transfer.corrective_transfer import transfer_correctives
from viewer.errors import RigError
from viewer.rigs.blendshapes import Correctives
from viewer.rigs.geometry.closest_point import SurfacePoints
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing

SKELETON = arm().skeleton  # DOFs 0 to 2 translate, the remaining DOFs rotate


def curve(target):
    tangents = (("flat", 3.0), (-1.0, "smooth"))
    return Channel(target, np.array([0.0, 1.0]), np.array([1.0, 2.0]), tangents)


def test_lengths_and_their_tangents_are_scaled_and_angles_are_not():
    clip = Clip("walk", (curve(1), curve(4)), 0.0, 1.0)
    found = transfer_clip(clip, SKELETON, 10.0, 2.0)
    moved, rotated = found.channels
    assert_allclose(moved.values, [20.0, 40.0])
    assert moved.tangents == (("flat", 60.0), (-20.0, "smooth"))
    assert rotated is clip.channels[1]
    assert (found.name, found.start, found.end) == ("walk", 0.0, 1.0)


def test_frames_keep_rotations_and_scale_translations():
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (2, 2, 1))
    clip = SampledClip(
        "run",
        Timing(30.0, np.array([0, 1])),
        rotations,
        translations=np.ones((2, 2, 3)),
        figure_translations=np.array([[1.0, 0, 0], [2, 0, 0]]),
        figure_scales=np.array([2.0, 3.0]),
        shape_weights=np.ones((1, 4)),
    )
    found = transfer_clip(clip, SKELETON, 10.0, 2.0)
    assert_array_equal(found.rotations, rotations)
    # Joints move inside the figure, and its scale of 2 is already part of the lengths.
    assert_allclose(found.translations, 20.0)
    assert_allclose(found.figure_translations, [[10.0, 0, 0], [20.0, 0, 0]])
    assert_allclose(found.figure_scales, [1.0, 1.5])
    assert found.shape_weights is None


def test_path_is_scaled_by_leg_length():
    clip = Clip("walk", (curve(1), curve(4)), 0.0, 1.0)
    found = transfer_clip(clip, SKELETON, 10.0, 2.0, path_scale=12.0)
    assert_allclose(found.channels[0].values, [24.0, 48.0])
    frames = SampledClip(
        "run",
        Timing(30.0, np.array([0])),
        np.tile([0.0, 0.0, 0.0, 1.0], (1, 2, 1)),
        translations=np.ones((1, 2, 3)),
        figure_translations=np.ones((1, 3)),
    )
    found = transfer_clip(frames, SKELETON, 10.0, 2.0, path_scale=12.0)
    assert_allclose(found.translations[0], [[24.0] * 3, [20.0] * 3])
    assert_allclose(found.figure_translations, 12.0)


def test_frames_without_translations_have_none_after_transfer():
    clip = SampledClip("turn", Timing(30.0, np.array([0])), np.ones((1, 2, 4)))
    found = transfer_clip(clip, SKELETON, 10.0)
    assert found.translations is None and found.figure_translations is None


def test_clips_of_other_skeletons_are_refused():
    three = SampledClip("x", Timing(30.0, np.array([0])), np.ones((1, 3, 4)))
    with pytest.raises(RigError) as problem:
        transfer_clip(three, SKELETON, 1.0)
    assert str(problem.value) == "clip x has 3 joints, but the figure has 2"
    with pytest.raises(RigError) as problem:
        transfer_clip(Clip("y", (curve(9),), 0.0, 1.0), SKELETON, 1.0)
    assert str(problem.value) == "a channel moves DOF 9, but the figure has 9 DOFs"


TRIANGLES = np.array([[0, 1, 2]])
OFFSETS = np.arange(81.0).reshape(9, 3, 3)


def points(barycentric):
    count = len(barycentric)
    return SurfacePoints(
        np.zeros(count, np.int32), barycentric, np.zeros((count, 3)), np.zeros(count)
    )


def strip(count):
    """Return a strip of triangles along x with two vertices per step."""
    positions = np.array([[x, y, 0.0] for x in range(count) for y in (0.0, 1.0)])
    first = 2 * np.arange(count - 1)
    triangles = np.concatenate(
        [np.stack([first, first + 2, first + 1], 1), np.stack([first + 1, first + 2, first + 3], 1)]
    )
    return positions, triangles


def test_offsets_are_interpolated_from_the_corners_and_scaled():
    barycentric = np.array([[1.0, 0, 0], [0, 0, 1], [0.5, 0.25, 0.25], [0, 1, 0]])
    positions, triangles = strip(2)
    found = transfer_correctives(
        Correctives(OFFSETS), points(barycentric), TRIANGLES, np.ones(4, bool), positions,
        triangles, 10.0,
    )  # fmt: skip
    expected = 10.0 * np.einsum("vk,pka->pva", barycentric, OFFSETS)
    assert_allclose(found.values(), expected, rtol=1e-14)


def test_offsets_fade_out_away_from_the_template():
    positions, triangles = strip(40)
    matched = positions[:, 0] < 20
    barycentric = np.tile([1.0, 0, 0], (80, 1))
    found = transfer_correctives(
        Correctives(np.ones((9, 3, 3))), points(barycentric), TRIANGLES, matched, positions,
        triangles, 1.0,
    )  # fmt: skip
    along = found.values()[0, ::2, 0]
    # Ten rounds extend by ten steps to both sides and decrease monotonically.
    assert_allclose(along[:9], 1.0, atol=1e-12)
    assert_allclose(along[31:], 0.0, atol=1e-12)
    assert (np.diff(along) <= 1e-12).all() and 0.3 < along[19] < 1.0 and 0.0 < along[21] < 0.7


def test_offsets_beyond_the_memory_limit_are_left_out(monkeypatch):
    monkeypatch.setattr(corrective_transfer, "MOST_NUMBERS", 9 * 4 * 3 - 1)
    positions, triangles = strip(2)
    found = transfer_correctives(
        Correctives(OFFSETS), points(np.tile([1.0, 0, 0], (4, 1))), TRIANGLES, np.ones(4, bool),
        positions, triangles, 1.0,
    )  # fmt: skip
    assert found is None
