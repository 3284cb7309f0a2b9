"""Hands of driven figures, kept at the body where those of the source are at theirs."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rigs.retargeting.hanging_arms import N, body, motion
from rigs.retargeting.rest_twins import NAMES, Y, t_pose, worlds, written
from rigs.retargeting.two_people import places

from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix as matrices
from viewer.rigs.mesh import Mesh
from viewer.rigs.motion.evaluation import frames_of, world_frames
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.retargeting.drive import Drive
from viewer.rigs.retargeting.driven_clip import driven_clip
from viewer.rigs.retargeting.driven_hands import hand_notes, keep_hands
from viewer.rigs.retargeting.retarget import retarget
from viewer.rigs.skin import skin_from_lists

ARM, ELBOW, HAND = ("LeftArm", "LeftForeArm", "LeftHand")
# The height from ankles to neck: thigh 45, shin with the ankle 2 behind it, and pelvis to neck.
REST = np.tile([0.0, 0.0, 0.0, 1.0], (len(NAMES), 1))
HEIGHT = 45.0 + np.hypot(42.0, 2.0) + 50.0


def kept(figure, source):
    found = retarget(source, figure, source_rest="auto")
    return found, *keep_hands(found, found.clip, figure)


def from_thigh(where, side="Left", suffix="_"):
    """Return the offset of a wrist from the nearest point of its thigh: (N, 3)."""
    wrist, hip, knee = (where[f"{side}{part}{suffix}"] for part in ("Hand", "UpLeg", "Leg"))
    bone = knee - hip
    part = np.einsum("na,na->n", wrist - hip, bone) / np.einsum("na,na->n", bone, bone)
    return wrist - hip - np.clip(part, 0.0, 1.0)[:, None] * bone


def test_hands_beside_the_thighs_stay_there_in_a_figure_with_wide_shoulders():
    source = motion(0.3, 0.2)
    figure = body(width=1.5)
    found, clip, changes = kept(figure, source)
    theirs = from_thigh(places(source.figure, source.clip), suffix="")
    near = np.linalg.norm(theirs, axis=1) < 0.13 * HEIGHT
    assert near.sum() > 10
    wrong = [
        np.linalg.norm(from_thigh(places(figure, each)) - theirs, axis=1)[near] / HEIGHT
        for each in (found.clip, clip)
    ]
    # The shoulders are 9 cm wider, the thighs 5, so that hands are 4 of 137 cm too far out; up to
    # 0.025 are left.
    assert wrong[0].max() > 0.028 and wrong[1].max() < 0.0255
    assert changes.after < changes.before
    bones = [(ARM, ELBOW), (ELBOW, HAND)]
    before, after = places(figure, found.clip), places(figure, clip)
    for start, end in bones:  # bones keep their lengths
        lengths = [np.linalg.norm(w[f"{end}_"] - w[f"{start}_"], axis=1) for w in (before, after)]
        assert_allclose(*lengths, atol=1e-9)


def test_size_and_place_of_the_whole_person_in_each_frame_change_nothing():
    source, figure = motion(0.3, 0.2), body(width=1.5)
    _, wanted, _ = kept(figure, source)
    sizes, way = np.linspace(1.0, 2.0, N), np.linspace(0.0, 1e6, 3 * N).reshape(N, 3)
    moved = replace(source.clip, figure_scales=sizes, figure_translations=way)
    _, clip, changes = kept(figure, replace(source, clip=moved))
    assert changes is not None
    assert_allclose(clip.rotations, wanted.rotations, atol=1e-9)


@pytest.mark.parametrize("height", [1.0, 0.02, 3.0])
def test_figure_with_the_proportions_of_the_source_is_unchanged(height):
    found, clip, changes = kept(body(height=height), motion(0.3, 0.2))
    assert changes is None and clip is found.clip


def test_hands_away_from_the_body_are_unchanged():
    local = np.tile(np.eye(3), (N, len(NAMES), 1, 1))
    local[:, NAMES.index("LeftForeArm")] = matrices(np.linspace(0.0, 0.5, N)[:, None] * -Y)
    source = written(t_pose(), worlds(local), np.zeros((N, 3)), rate=30.0)
    found, clip, changes = kept(body(arms=1.4, width=1.4), source)
    assert changes is None and clip is found.clip


def test_hands_that_clap_meet_in_a_figure_with_long_arms():
    local = np.tile(np.eye(3), (N, len(NAMES), 1, 1))
    apart = 0.3 + 0.3 * np.cos(np.linspace(0.0, 4.0 * np.pi, N))
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        # Upper arms forwards and down, forearms inwards until the wrists meet.
        local[:, NAMES.index(f"{side}Arm")] = matrices(-sign * 1.3 * Y)
        inwards = -sign * (1.316 - apart)[:, None] * Y
        local[:, NAMES.index(f"{side}ForeArm")] = matrices(inwards)
    source = written(t_pose(), worlds(local), np.zeros((N, 3)), rate=30.0)
    figure = body(arms=1.6)
    found, clip, _ = kept(figure, source)

    def between(where, suffix=""):
        return where[f"LeftHand{suffix}"] - where[f"RightHand{suffix}"]

    theirs = between(places(source.figure, source.clip))
    met = np.linalg.norm(theirs, axis=1) < 0.07 * HEIGHT
    assert met.any()
    wrong = [
        np.linalg.norm(between(places(figure, each), "_") - theirs, axis=1)[met].max() / HEIGHT
        for each in (found.clip, clip)
    ]
    # With arms of 45 and 42 cm, the wrists cross by 12 cm where those of the source are 6 apart.
    assert wrong[0] > 0.12 and wrong[1] < 0.0251


@pytest.mark.parametrize("is_shaped", [False, True])
def test_hands_stay_outside_of_a_stout_body(is_shaped):
    # A ring of vertices 22 cm around each thigh, all bound to the thigh; of a shaped body, at rest
    # 0.2 cm, and wider in the shape of the motion.
    figure = body(width=1.5)
    names = list(figure.skeleton.names)
    angle = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    ring = 22.0 * np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=1)
    sides = ("Left", "Right")
    positions = np.concatenate([ring + np.array([15.0 * s, 75.0, 0.0]) for s in (1, -1)])
    rows = [[(names.index(f"{side}UpLeg_"), 1.0)] for side in sides for _ in angle]
    bind = np.tile(np.eye(4), (len(names), 1, 1))
    mesh = Mesh(positions, 0.0 * positions, np.arange(24, dtype=np.int32).reshape(-1, 3))
    stout = replace(figure, mesh=mesh, skin=skin_from_lists(rows, bind))
    if is_shaped:
        thin = replace(mesh, positions=positions - 0.99 * np.concatenate([ring, ring]))
        wider = BlendShapes(("wide",), (positions - thin.positions)[None])
        stout = replace(stout, mesh=thin, blend_shapes=wider)
    source = motion(0.3, 0.2)
    found = retarget(source, stout, source_rest="auto")
    driven = replace(found.clip, shape_weights=np.ones((N, 1))) if is_shaped else found.clip
    clip, _ = keep_hands(found, driven, stout)
    before = np.linalg.norm(from_thigh(places(stout, found.clip)), axis=1)
    after = np.linalg.norm(from_thigh(places(stout, clip)), axis=1)
    # The trunk, which has no skin here, attracts hands by 0.4 cm; without the skin of the thighs,
    # they would be 2.4 cm nearer.
    assert (after >= np.minimum(before, 22.0) - 0.5).all()


def test_distance_that_short_arms_cannot_reach_is_reported():
    # The straight arms of 54 cm of the source end beside the thighs. Those of the figure are half
    # as long, from the same shoulders, so that 27 cm are missing in every frame.
    figure = body(arms=0.5)
    found, _, changes = kept(figure, motion(0.0, 0.0))
    assert_allclose((changes.least, changes.after), 27.0 / HEIGHT, rtol=1e-3)
    _, text = map(str, hand_notes(changes, found, figure))
    assert text.startswith("arms of other are too short") and "by 19.7 % of" in text


def with_hands(figure, reach):
    """Return a figure with soles at height 0, and fingers that end ``reach`` beyond the wrists."""
    names = list(figure.skeleton.names)
    points, rows = [], []
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        ball = places_at_rest(figure)[f"{side}ToeBase_"]
        wrist = places_at_rest(figure)[f"{side}Hand_"]
        for joint, tips in (
            ("ToeBase", ball * [1.0, 0.0, 1.0] + [[-2.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0, 0, 3.0]]),
            ("Hand", wrist + sign * np.array([[reach, 0, 0], [1.0, 1.0, 0], [1.0, 0, 1.0]])),
        ):
            points.append(tips)
            rows += [[(names.index(f"{side}{joint}_"), 1.0)]] * 3
    positions = np.concatenate(points)
    bind = np.tile(np.eye(4), (len(names), 1, 1))
    bind[:, :3, 3] = -np.array([places_at_rest(figure)[name] for name in names])
    mesh = Mesh(positions, 0.0 * positions, np.arange(12, dtype=np.int32).reshape(-1, 3))
    return replace(figure, mesh=mesh, skin=skin_from_lists(rows, bind))


def places_at_rest(figure):
    still = SampledClip("", Timing(30.0, np.zeros(1, dtype=np.int32)), REST[None])
    return {name: points[0] for name, points in places(figure, still).items()}


def lowest_fingers(figure, clip, reach):
    """Return the lowest height (N,) of fingers above the lowest sole; arms hang, so they do too."""
    times = np.arange(clip.n_rows) / clip.timing.frame_rate
    worlds = world_frames(figure, frames_of(figure, clip, times))
    names = figure.skeleton.names
    tips, soles = [], []
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        hand = worlds[:, names.index(f"{side}Hand_")]
        tips.append((hand @ [sign * reach, 0.0, 0.0, 1.0])[:, 1])
        soles.append(worlds[:, names.index(f"{side}ToeBase_")][:, 1, 3] - 1.0)
    return np.minimum(*tips) - np.minimum(*soles)


def test_fingers_of_long_arms_stay_above_the_ground():
    figure, source = with_hands(body(arms=3.0), 20.0), motion(0.3, 0.2, down=1.0)
    found, clip, changes = kept(figure, source)
    before, after = (lowest_fingers(figure, each, 20.0) for each in (found.clip, clip))
    # From shoulders at 145 cm, 1 radian below the horizontal, hang 3 times 28 cm, and, bent by 0.1
    # to 0.5 radians, 3 times 26 with fingers of 20.
    bends = np.array([0.1, 0.5])
    low = 145.0 - np.sin(1.0) * (3.0 * 28.0 + (3.0 * 26.0 + 20.0) * np.cos(bends))
    assert_allclose((before.min(), before.max()), low, atol=0.1)  # -7.7, 2.0
    assert_allclose(after, np.maximum(before, 0.0), atol=1e-6)
    assert_allclose(changes.lifted, -before.min())
    (text,) = map(str, hand_notes(changes, found, replace(figure, unit="cm")))
    assert text.startswith("hands of other lifted by up to 77.3 mm") and "--hand-contact" in text


def test_hands_that_sink_in_the_source_too_are_not_lifted():
    # Both people have the same long arms.
    long = body(arms=2.4)
    source = motion(0.0, 0.0)
    source = replace(source, figure=replace(long, name="long"))
    figure = with_hands(long, 20.0)
    found, clip, changes = kept(figure, source)
    assert lowest_fingers(figure, found.clip, 20.0).min() < -1.0
    assert changes is None and clip is found.clip


def test_hands_can_be_left_as_retargeted_and_are_reported():
    drive = Drive(motion(0.3, 0.2), "auto", plants_feet=False)
    figure = body(width=1.5)
    _, notes = driven_clip(drive, figure)
    (text,) = [str(note) for note in notes if note.key == "F007.hands-kept"]
    assert "they miss by 2." in text and "--hand-contact off disables this" in text
    clip, notes = driven_clip(replace(drive, keeps_hands=False), figure)
    assert not [note for note in notes if note.key == "F007.hands-kept"]
    plain = retarget(drive.motion, figure, source_rest="auto").clip
    assert_allclose(clip.rotations, plain.rotations, atol=1e-12)


def test_hands_that_only_come_near_the_body_are_reported_with_their_distance():
    # No wrist is within the distance that counts as touching, but some are moved.
    figure, source = body(width=1.5), motion(0.8, 0.02)
    theirs = from_thigh(places(source.figure, source.clip), suffix="")
    assert np.linalg.norm(theirs, axis=1).min() > 0.14 * HEIGHT
    _, _, changes = kept(figure, source)
    assert 0.025 < changes.after < changes.before < 0.06
