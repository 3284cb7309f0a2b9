"""Motions that were baked from keys and controls to frames, as in BVH files of animators."""

from dataclasses import replace

import numpy as np
import pytest
from linting.sound import FRAMES, RATE, legs, make_skeleton, standing

import viewer
from viewer.linting import Finding, Subject, jitter, stretch
from viewer.linting import feet as feet_check
from viewer.linting._subject import track_of
from viewer.loading import bundled_body
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.quaternion import conjugate, multiply
from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor

_K = np.arange(FRAMES)


def moved(paths: dict[int, np.ndarray], names: tuple[str, ...] = ()) -> list[Finding]:
    """Check the feet of captured legs whose joints move by (F, 3), with others on the root."""
    figure = legs()
    skeleton = figure.skeleton
    if names:
        every = (*skeleton.names, *names)
        parents = [*skeleton.parents, *(0 for _ in names)]
        offsets = [*skeleton.rest_translations, *([0.0, 0.3, 0.0] for _ in names)]
        figure = replace(figure, skeleton=make_skeleton(every, parents, offsets))
    clip = standing(figure)
    places = np.zeros((FRAMES, figure.skeleton.n_joints, 3))
    for joint, path in paths.items():
        places[:, joint] = path
    actor = Actor(figure, clip=replace(clip, translations=places))
    return [*feet_check.check(Subject(actor))]


def along(axis: int, values: np.ndarray) -> np.ndarray:
    path = np.zeros((FRAMES, 3))
    path[:, axis] = values
    return path


SHIFTED = along(2, 0.5 * _K / RATE)


def levels(found: list[Finding]) -> list[tuple[str, str]]:
    return [(one.code, one.severity) for one in found]


def test_sliding_foot_of_a_capture_is_a_warning_and_that_of_controls_a_note():
    assert levels(moved({3: SHIFTED})) == [("C007", "warning")]
    assert levels(moved({3: SHIFTED}, ("arm.l", "arm.r"))) == [("C007", "warning")]
    for names in (("kneeIK.l", "kneeIK.r"), ("PoleTarget.L", "PoleTarget.R")):
        assert levels(moved({3: SHIFTED}, names)) == [("C007", "note")]
    # Skeletons of games have these in captures, too.
    names = ("ik_foot_root", "ik_foot_l", "ik_foot_r")
    assert levels(moved({3: SHIFTED}, names)) == [("C007", "warning")]


@pytest.mark.parametrize(("noise", "severity"), [(0.0, "note"), (0.002, "warning")])
def test_feet_held_exactly_under_a_moving_body_are_those_of_controls(noise, severity):
    # The body sways; the right foot stands, the left one is shifted. Noise of 2 mm at 30 fps is
    # far above the 0.003 sizes per second of a held foot, and far below those of sliding.
    sway = along(0, 0.1 * np.sin(2.0 * np.pi * _K / FRAMES))
    shaken = np.random.default_rng(0).normal(0.0, noise, (FRAMES, 3))
    found = moved({0: sway, 3: SHIFTED - sway, 6: shaken - sway})
    assert [one for one in levels(found) if one[0] == "C007"] == [("C007", severity)]


def in_other_axes(figure: Figure, rotations: np.ndarray) -> tuple[Figure, np.ndarray]:
    """Return the same skeleton and motion, with other axes for each joint and no rest rotations.

    With axes Q_j, joint j has the offset Q_p^-1 o_j from its parent p, and the rotation
    Q_p^-1 R_j Q_j; the joints move as before.
    """
    skeleton = figure.skeleton
    axes = unit(np.random.default_rng(1).normal(size=(skeleton.n_joints, 4)))
    above = np.where(skeleton.parents[:, None] >= 0, axes[skeleton.parents], [0.0, 0, 0, 1])
    turns = quaternion_to_matrix(above)
    offsets = np.einsum("jba,jb->ja", turns, skeleton.rest_translations)
    turned = multiply(multiply(conjugate(above), rotations), axes)
    identity = np.tile([0.0, 0, 0, 1], (skeleton.n_joints, 1))
    rested = replace(skeleton, rest_translations=offsets, rest_rotations=identity)
    return replace(figure, skeleton=rested), turned


def test_heels_are_known_if_the_rest_pose_does_not_stand():
    body = viewer.load(bundled_body()).actors[0].figure
    skeleton = body.skeleton
    figure = Figure("body", skeleton=skeleton, unit="m", up=body.up)
    # It stands with bent knees and elbows, so that their sides are seen.
    local = np.tile(skeleton.rest_rotations, (FRAMES, 1, 1))
    for name, axis, degrees in (
        ("left_hip", 0, -25), ("right_hip", 0, -25), ("left_knee", 0, 50), ("right_knee", 0, 50),
        ("left_ankle", 0, -25), ("right_ankle", 0, -25), ("left_elbow", 1, -40),
        ("right_elbow", 1, 40),
    ):  # fmt: skip
        turn = np.zeros(4)
        turn[[axis, 3]] = np.sin(np.radians(degrees / 2)), np.cos(np.radians(degrees / 2))
        joint = skeleton.names.index(name)
        local[:, joint] = multiply(local[:, joint], turn)
    other, turned = in_other_axes(figure, local)
    tracks = []
    for one, rotations in ((figure, local), (other, turned)):
        clip = SampledClip("still", Timing(RATE, _K), rotations)
        tracks.append(track_of(Subject(Actor(one, clip=clip), up=body.up)))
    np.testing.assert_allclose(tracks[1].positions, tracks[0].positions, atol=1e-9)
    # The slope of the feet at rest is estimated, within 30 mm at the heel.
    for one, expected in zip(tracks[1].paths, tracks[0].paths, strict=True):
        np.testing.assert_allclose(one.heel, expected.heel, atol=0.03)


def lengths_of(
    names: tuple[str, ...], moving: int, parents: tuple[int, ...] | None = None
) -> list[str]:
    """Check a chain of joints, of which one moves away from its parent to twice the distance."""
    count = len(names)
    offsets = [[0.0, 1.0, 0.0], *([0.2, 0.0, 0.0] for _ in names[1:])]
    skeleton = make_skeleton(names, [*(parents or range(-1, count - 1))], offsets)
    figure = Figure("chain", skeleton=skeleton)
    places = np.zeros((FRAMES, count, 3))
    places[20:30, moving, 0] = 0.2
    actor = Actor(figure, clip=replace(standing(figure), translations=places))
    return [one.code for one in stretch.check(Subject(actor))]


def test_slots_and_controls_beyond_the_body_are_no_bones():
    trunk, arm = ("Hips", "Spine", "Chest"), ("LeftArm", "LeftForeArm", "LeftHand")
    names = (*trunk, *arm, "slot", "control-roll", "prop")
    assert lengths_of(names, 5) == ["C022"]
    assert lengths_of(names, 7) == []
    # Without known names, every chain is one of bones.
    assert lengths_of(tuple("abcdefghi"), 7) == ["C022"]


def test_bones_of_a_hand_without_a_wrist_branch_off_at_the_elbow():
    trunk, arm = ("Hips", "Spine", "Chest"), ("LeftArm", "LeftForeArm")
    fingers = ("LeftHandIndex1", "LeftHandIndex2", "LeftHandMiddle1", "LeftHandMiddle2")
    parents = (-1, 0, 1, 2, 3, 4, 5, 4, 7)
    assert lengths_of((*trunk, *arm, *fingers), 5, parents) == ["C022"]
    # At the chest, an arm of two bones and a head have no bones of their own.
    parents = (-1, 0, 1, 2, 3, 2, 5, 2, 7)
    assert lengths_of((*trunk, *arm, *fingers), 5, parents) == []


def test_head_on_a_chest_with_shoulders_has_a_bone():
    names = ("Hips", "Spine", "Chest", "Head", "LeftArm", "LeftForeArm", "RightArm", "RightForeArm")
    assert lengths_of(names, 3, (-1, 0, 1, 2, 2, 4, 2, 6)) == ["C022"]


def test_quick_swing_of_a_capture_is_no_jitter():
    # A swing of 200 mm in six frames: fourth differences of 0.2 (2 - 2 cos 60°)^2 = 0.2 m, which
    # correlate by cos 60°; those of noise correlate by -0.8.
    figure = legs()
    places = np.zeros((FRAMES, 7, 3))
    places[:, 3, 2] = 0.2 * np.sin(2.0 * np.pi * _K / 6.0)
    swing = replace(standing(figure), translations=places)
    shaken = np.random.default_rng(0).normal(0.0, 0.02, places.shape)
    noisy = replace(standing(figure), translations=places * 0.0 + shaken)
    codes = [
        [one.code for one in jitter.check(Subject(Actor(figure, clip=clip)))]
        for clip in (swing, noisy)
    ]
    assert codes == [[], ["C014"]]
