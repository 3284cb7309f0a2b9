"""Feet of driven figures during jumps, while kneeling, on treadmills, and with tilted soles."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rigs.retargeting.rest_twins import NAMES, X, Y, t_pose, written
from rigs.retargeting.standing_motions import KNEELING, RATE, jump, kneel, treadmill
from rigs.retargeting.test_planted_feet import EXACT, OTHER, TOES, person
from rigs.retargeting.two_people import places
from rigs.retargeting.walking import stands, walk
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix as matrices
from viewer.rigs.motion.evaluation import frames_of, world_frames
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.retargeting.driven_feet import plant_feet
from viewer.rigs.retargeting.retarget import retarget

JOINTS = ("UpLeg", "Leg", "Foot")
SHORT = person(0.8, 1.1, 0.9, 1.2)


def axes_of(figure: Figure, clip: SampledClip) -> Floats:
    """Return the world rotations of all joints in every frame."""
    timing = clip.timing
    times = timing.start + np.arange(timing.n_frames) / timing.frame_rate
    return world_frames(figure, frames_of(figure, clip, times))[..., :3, :3]


def largest_angles(axes: Floats) -> Floats:
    """Return the largest angle by which each joint rotates between two frames, radians."""
    steps = np.einsum("fjba,fjbc->fjac", axes[:-1], axes[1:])
    return np.arccos(np.clip(0.5 * (np.trace(steps, axis1=2, axis2=3) - 1.0), -1.0, 1.0)).max(0)


def knee_angles(where: dict[str, Floats], side: str, tail: str) -> Floats:
    hip, knee, ankle = (where[f"{side}{part}{tail}"] for part in JOINTS)
    first, second = hip - knee, ankle - knee
    products = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    return np.arccos(np.einsum("fa,fa->f", first, second) / products)


def jerky_walk() -> tuple[Floats, Floats]:
    """Return a walk whose root jumps by up to 2 cm in single frames: while both feet stand, while
    one stands, and when a foot leaves the ground.
    """
    rotations, path = walk()
    for frame, offset in ((30, (0.8, -0.6, 0.0)), (55, (0.0, 0.9, 0.0)), (60, (0.5, 1.5, -1.2))):
        path[frame] += offset
    return rotations, path


MOTIONS = {"jump": lambda: jump()[:2], "kneel": kneel, "walk": walk, "jerky walk": jerky_walk}


@pytest.mark.parametrize("figure", [OTHER, SHORT], ids=["long", "short"])
@pytest.mark.parametrize("motion", ["jump", "kneel", "walk", "jerky walk"])
def test_no_joint_rotates_much_faster_and_no_knee_moves_suddenly(figure, motion):
    rotations, path = MOTIONS[motion]()
    source = written(t_pose(), rotations, path, rate=RATE)
    clip, changes = plant_feet(retarget(source, figure), figure)
    assert changes.is_better and changes.gap_after < (0.1 if "jerky" in motion else EXACT)
    # In the jump, the source's feet do not slide at all; half a millimetre is allowed.
    assert changes.after <= max(changes.source, 0.05)
    own, old = axes_of(figure, clip), axes_of(source.figure, source.clip)
    for side in ("Left", "Right"):
        mine = largest_angles(own[:, [figure.skeleton.names.index(f"{side}{p}_") for p in JOINTS]])
        theirs = largest_angles(old[:, [NAMES.index(f"{side}{part}") for part in JOINTS]])
        # If a joint of the source is exactly static, there is no angle to compare with.
        assert (mine <= 1.5 * np.maximum(theirs, np.radians(1.0))).all()
        knees = [
            np.abs(np.diff(knee_angles(places(*moving), side, tail), 2)).max()
            for moving, tail in (((figure, clip), "_"), ((source.figure, source.clip), ""))
        ]
        assert knees[0] <= 1.2 * knees[1]


def denser(rotations: Floats, path: Floats, count: int) -> tuple[Floats, Floats]:
    """Return a motion with ``count`` frames for each one, on smooth curves through its frames."""
    frames = np.arange(len(path))
    between = np.linspace(0.0, frames[-1], frames[-1] * count + 1)
    found = np.empty((len(between), *rotations.shape[1:]))
    for joint in range(rotations.shape[1]):
        curve = RotationSpline(frames, Rotation.from_matrix(rotations[:, joint]))
        found[:, joint] = curve(between).as_matrix()
    return found, CubicSpline(frames, path)(between)


@pytest.mark.parametrize("figure", [OTHER, SHORT], ids=["long", "short"])
def test_knees_are_as_calm_at_240_frames_per_second(figure):
    source = written(t_pose(), *denser(*kneel(), 4), rate=4.0 * RATE)
    clip, changes = plant_feet(retarget(source, figure), figure)
    assert changes.is_better and changes.after < changes.source
    for side in ("Left", "Right"):
        mine, theirs = (
            np.abs(np.diff(knee_angles(places(*moving), side, tail), 2)).max()
            for moving, tail in (((figure, clip), "_"), ((source.figure, source.clip), ""))
        )
        assert mine <= 1.2 * theirs


def test_feet_swing_as_high_at_240_frames_per_second():
    heights = []
    for count in (1, 4):
        source = written(t_pose(), *denser(*walk(), count), rate=count * RATE)
        clip, _ = plant_feet(retarget(source, SHORT), SHORT)
        where = places(SHORT, clip)
        heights.append([where[f"{side}Foot_"][::count, 1] for side in ("Left", "Right")])
    # 5 mm: contacts begin and end at other times, as there are more frames.
    assert_allclose(heights[1], heights[0], atol=0.5)


def test_jump_leaves_the_ground_and_lands_on_it():
    rotations, path, rise = jump()
    found = retarget(written(t_pose(), rotations, path, rate=RATE), OTHER)
    clip, changes = plant_feet(found, OTHER)
    assert changes.n_contacts == 4
    where = places(OTHER, clip)
    for name in TOES:
        height = where[name][:, 1]
        assert_allclose(height[rise < 0.02], 0.0, atol=0.1)  # cm
        # Flights are scaled by the ratio of the leg lengths, like the path of the hips.
        assert_allclose(height.max(), found.scale * rise.max(), rtol=0.15)


def test_ball_of_a_foot_that_points_down_is_on_the_ground():
    found = retarget(written(t_pose(), *kneel(), rate=RATE), OTHER)
    clip, changes = plant_feet(found, OTHER)
    assert changes.gap_before > 1.0  # cm
    ball = places(OTHER, clip)["RightToeBase_"][KNEELING]
    assert_allclose(ball[10:-10, 1], 0.0, atol=EXACT)
    assert_allclose(np.ptp(ball[10:-10], axis=0), 0.0, atol=EXACT)


def test_feet_on_a_treadmill_are_held_as_on_the_ground():
    motions = [written(t_pose(), *parts, rate=RATE) for parts in (walk(), treadmill())]
    found = [retarget(motion, OTHER) for motion in motions]
    (walked, first), (ran, second) = (plant_feet(each, OTHER) for each in found)
    assert first.ground_speed == 0.0
    assert_allclose(second.ground_speed, 60.0 * found[1].scale, rtol=1e-3)  # cm/s
    assert_allclose(ran.rotations, walked.rotations, atol=1e-3)
    assert (first.n_contacts, second.n_contacts) == (6, 6)


def test_sliding_person_is_not_on_a_treadmill():
    rotations, path = treadmill()
    path[:, 2] -= 1.0 * np.arange(len(path))  # the body moves with the feet
    _, changes = plant_feet(retarget(written(t_pose(), rotations, path, rate=RATE), OTHER), OTHER)
    assert changes.n_contacts == 0 and changes.ground_speed == 0.0


def test_soles_are_level_while_those_of_a_tilted_source_are_on_the_ground():
    rotations, path = walk()
    tilt = matrices(np.array([-0.12 * X + 0.05 * Y]))[0]  # the file's rest pose is inexact
    for side in ("Left", "Right"):
        for part in ("Foot", "ToeBase"):
            joint = NAMES.index(f"{side}{part}")
            rotations[:, joint] = tilt @ rotations[:, joint]
    found = retarget(written(t_pose(), rotations, path, rate=RATE), OTHER)
    clip, _ = plant_feet(found, OTHER)
    for side in ("Left", "Right"):
        flags = stands(side) & np.roll(stands(side), 12) & np.roll(stands(side), -12)
        joints = [OTHER.skeleton.names.index(f"{side}{part}_") for part in ("Foot", "ToeBase")]
        before, after = (axes_of(OTHER, each)[flags][:, joints] for each in (found.clip, clip))
        assert np.abs(before[..., 1, 1] - 1.0).max() > 5e-3
        assert_allclose(after[..., 1, 1], 1.0, atol=1e-9)


def test_noise_of_standing_feet_does_not_affect_the_knees():
    rotations, path = walk()
    noise = matrices(np.random.default_rng(3).normal(scale=0.02, size=(len(path), 3)))
    for side in ("Left", "Right"):
        for part in ("Foot", "ToeBase"):
            joint = NAMES.index(f"{side}{part}")
            rotations[:, joint] = noise @ rotations[:, joint]
    source = written(t_pose(), rotations, path, rate=4.0 * RATE)
    clip, _ = plant_feet(retarget(source, OTHER), OTHER)
    clean = replace(source, clip=written(t_pose(), *walk(), rate=4.0 * RATE).clip)
    smooth, _ = plant_feet(retarget(clean, OTHER), OTHER)
    peaks = [
        np.abs(np.diff(knee_angles(places(OTHER, each), "Left", "_"), 2)).max()
        for each in (clip, smooth)
    ]
    assert peaks[0] < 2.0 * peaks[1]


def test_feet_follow_a_sudden_jump_of_the_recording_instead_of_bending_the_knees():
    rotations, path = walk()
    jumped = path.copy()
    jumped[30] += [1.5, -1.0, 0.0]  # cm, for one frame; the left foot stands
    rate = 4.0 * RATE
    clips = [
        plant_feet(retarget(written(t_pose(), rotations, way, rate=rate), OTHER), OTHER)[0]
        for way in (path, jumped)
    ]
    calm, wild = (places(OTHER, clip) for clip in clips)
    moved = wild["LeftToeBase_"] - calm["LeftToeBase_"]
    assert moved[30, 0] > 0.75
    # The knee bends less than if the foot remained in place, and the sole remains near the ground:
    # 0.1 % of 174.
    assert np.abs(moved[30, 1]) < 0.174
    assert np.abs(np.delete(moved, range(25, 36), axis=0)).max() < 0.1
