"""Hands of driven figures, kept at the body where those of the source are at theirs."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rigs.retargeting.hanging_arms import N, body, motion
from rigs.retargeting.rest_twins import NAMES, X, Y, Z, t_pose, worlds, written
from rigs.retargeting.two_people import places

from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.geometry.rotation import matrix_to_quaternion
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix as matrices
from viewer.rigs.mesh import Mesh
from viewer.rigs.motion.evaluation import frames_of, world_frames
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.retargeting.body_joints import Body
from viewer.rigs.retargeting.drive import Drive
from viewer.rigs.retargeting.driven_clip import driven_clip
from viewer.rigs.retargeting.driven_hands import hand_notes, keep_hands
from viewer.rigs.retargeting.joint_names import joint_meanings
from viewer.rigs.retargeting.person_skin import Person
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


def clapping():
    local = np.tile(np.eye(3), (N, len(NAMES), 1, 1))
    apart = 0.3 + 0.3 * np.cos(np.linspace(0.0, 4.0 * np.pi, N))
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        # Upper arms forwards and down, forearms inwards until the wrists meet.
        local[:, NAMES.index(f"{side}Arm")] = matrices(-sign * 1.3 * Y)
        inwards = -sign * (1.316 - apart)[:, None] * Y
        local[:, NAMES.index(f"{side}ForeArm")] = matrices(inwards)
    return written(t_pose(), worlds(local), np.zeros((N, 3)), rate=30.0)


def test_hands_that_clap_meet_in_a_figure_with_long_arms():
    source = clapping()
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


def raised(wrist):
    """Return a motion with both wrists at a place, (2,), beside and above the head."""
    # By the law of cosines for an upper arm of 28 cm and a forearm of 26.
    shoulder = np.array([18.0, 145.0])
    line = wrist - shoulder
    length = np.linalg.norm(line)
    cosine = (28.0**2 + length**2 - 26.0**2) / (2.0 * 28.0 * length)
    upper = np.arctan2(line[1], line[0]) - np.arccos(cosine)
    elbow = shoulder + 28.0 * np.array([np.cos(upper), np.sin(upper)])
    lower = np.arctan2(*(wrist - elbow)[::-1]) - upper
    local = np.tile(np.eye(3), (N, len(NAMES), 1, 1))
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        local[:, NAMES.index(f"{side}Arm")] = matrices(sign * upper * Z)
        local[:, NAMES.index(f"{side}ForeArm")] = matrices(sign * lower * Z)
    return written(t_pose(), worlds(local), np.zeros((N, 3)), rate=30.0)


def test_hands_on_the_crown_stay_there_in_a_figure_with_long_arms():
    # 41 cm above the shoulders.
    wrist = np.array([8.0, 186.0])
    length, source = np.linalg.norm(wrist - [18.0, 145.0]), raised(wrist)
    figure = body(arms=1.4)
    found, clip, _ = kept(figure, source)
    before, after = (places(figure, each)["LeftHand_"][:, :2] for each in (found.clip, clip))
    # Arms that are 1.4 times as long end 0.4 * 42 cm higher; 2.5 % of 137 cm are left.
    assert_allclose(np.linalg.norm(before - wrist, axis=1), 0.4 * length, atol=1e-6)
    assert np.linalg.norm(after - wrist, axis=1).max() < 0.0255 * HEIGHT


RADIUS = 36.0  # of a stout trunk
TIP = 2.0  # distance of the corners of a hand from its wrist


def tube(radius):
    """Return corners and faces of an open tube from the knees to the shoulders."""
    angle = np.arange(24) * 2.0 * np.pi / 24.0
    ring = radius * np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=1)
    i, ahead = np.arange(24), np.roll(np.arange(24), -1)
    faces = [[i, i + 24, ahead], [ahead, i + 24, ahead + 24]]
    corners = np.concatenate([ring + 50.0 * Y, ring + 145.0 * Y])
    return corners, np.concatenate([np.stack(each, axis=1) for each in faces])


def sheets(distance):
    """Return corners and faces of two squares beside the body, whose fronts face away from it."""
    square = np.array([[1.0, 50, -45], [1.0, 145, -45], [1.0, 145, 45], [1.0, 50, 45]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    corners = np.concatenate([square * [distance, 1, 1], square * [-distance, 1, 1]])
    return corners, np.concatenate([faces, faces[:, ::-1] + 4])


def octahedron(radius):
    """Return corners and faces."""
    signs = [(a, b, c) for a in (0, 3) for b in (1, 4) for c in (2, 5)]
    # Counter-clockwise from outside: an even number of negative corners keeps x, y, z in order.
    faces = [f if sum(k > 2 for k in f) % 2 == 0 else f[::-1] for f in signs]
    return radius * np.concatenate([np.eye(3), -np.eye(3)]), np.array(faces)


def clothed(corners, faces, joint="Hips_", figure=None):
    """Return a person with a skin at the hips or another joint, and octahedra as hands."""
    figure = figure or body(width=1.5)
    names, at = list(figure.skeleton.names), places_at_rest(figure)
    parts = [(joint, corners, faces)]
    for side in ("Left", "Right"):
        tips, signs = octahedron(TIP)
        parts.append((f"{side}Hand_", tips + at[f"{side}Hand_"], signs))
    counts = np.cumsum([0, *(len(points) for _, points, _ in parts)])
    positions = np.concatenate([points for _, points, _ in parts])
    triangles = [each + start for (_, _, each), start in zip(parts, counts, strict=False)]
    rows = [[(names.index(name), 1.0)] for name, points, _ in parts for _ in points]
    bind = np.tile(np.eye(4), (len(names), 1, 1))
    bind[:, :3, 3] = -np.array([at[name] for name in names])
    mesh = Mesh(positions, 0.0 * positions, np.concatenate(triangles).astype(np.int32))
    return replace(figure, mesh=mesh, skin=skin_from_lists(rows, bind))


def from_trunk(figure, clip, side):
    """Return the distances of a wrist from the axis of the trunk: (N,)."""
    return np.linalg.norm(places(figure, clip)[f"{side}Hand_"][:, [0, 2]], axis=1)


@pytest.mark.parametrize("is_shaped", [False, True])
def test_hands_at_the_trunk_are_moved_out_of_a_stout_one(is_shaped):
    # The trunk of a shaped body is thin at rest, and stout in the shape of the motion.
    stout = clothed(*tube(RADIUS))
    if is_shaped:
        thin = clothed(*tube(0.1)).mesh
        wider = BlendShapes(("wide",), (stout.mesh.positions - thin.positions)[None])
        stout = replace(stout, mesh=thin, blend_shapes=wider)
    source = motion(0.3, 0.1, down=1.6)
    found = retarget(source, stout, source_rest="auto")
    driven = replace(found.clip, shape_weights=np.ones((N, 1))) if is_shaped else found.clip
    clip, changes = keep_hands(found, driven, stout)
    for side in ("Left", "Right"):
        before, after = (RADIUS - from_trunk(stout, each, side) for each in (found.clip, clip))
        assert before.min() + TIP > 0.06 * HEIGHT and after.max() + TIP < 0.03 * HEIGHT
        feet = [places(stout, each)[f"{side}Foot_"] for each in (found.clip, clip)]
        assert_allclose(*feet, atol=1e-9)
    notes = [str(note) for note in hand_notes(changes, found, replace(stout, unit="cm"))]
    (text,) = [note for note in notes if "hands of" in note]
    assert f"moved by up to {10.0 * changes.moved:.0f} mm, as far from its skin as" in text
    assert "--hand-contact off disables this" in text


def comes_to_the_trunk(rate=30):
    """Forearms turn forwards by up to 1.2 radians, so that hands come to the trunk and leave it."""
    return motion(0.6, 0.6, down=1.6, rate=rate)


def test_hands_give_way_smoothly_as_they_come_to_the_trunk():
    source, stout = comes_to_the_trunk(), clothed(*tube(RADIUS))
    found = retarget(source, stout, source_rest="auto")
    clip, _ = keep_hands(found, found.clip, stout)
    # Without a skin, hands come to the places that they have in the source.
    placed, _ = keep_hands(found, found.clip, replace(stout, mesh=None, skin=None))
    ways = []
    for side in ("Left", "Right"):
        paths = [places(stout, each)[f"{side}Hand_"] for each in (found.clip, placed, clip)]
        ways.append(np.linalg.norm(paths[2] - paths[1], axis=1).max())
        shaken = np.linalg.norm(np.diff(paths[2] - paths[0], n=2, axis=0), axis=1)
        # 18 cm in 9 frames at constant acceleration and deceleration take 4 * 18 / 9^2 a frame.
        assert shaken.max() < 0.89
        # Those of the source are up to 6 cm in its trunk, of which 0.02 of the height are unsure.
        assert RADIUS - from_trunk(stout, placed, side).min() > 14.0
        assert RADIUS - from_trunk(stout, clip, side).min() < 0.02 * HEIGHT
    assert 11.0 < max(ways) < 18.0


@pytest.mark.parametrize(("radius", "rate"), [(6.0, 30), (9.0, 30), (9.0, 120), (12.0, 30)])
def test_hands_that_touch_the_trunk_come_to_the_skin_of_a_slim_one(radius, rate):
    source, slim = comes_to_the_trunk(rate), clothed(*tube(radius))
    touching = slice(26 * rate // 30, 34 * rate // 30)
    found = retarget(source, slim, source_rest="auto")
    clip, _ = keep_hands(found, found.clip, slim)
    for side in ("Left", "Right"):
        before, after = (from_trunk(slim, each, side)[touching] for each in (found.clip, clip))
        assert before.min() - radius > 0.09 * HEIGHT
        assert np.abs(after - radius).max() < 0.03 * HEIGHT


def test_hands_with_a_skin_clap_without_going_through_each_other():
    source, figure = clapping(), clothed(*tube(9.0), figure=body(arms=1.6))
    found = retarget(source, figure, source_rest="auto")
    clip, _ = keep_hands(found, found.clip, figure)
    theirs, before, after = (
        places(each, motion)[f"LeftHand{end}"][:, 0] - places(each, motion)[f"RightHand{end}"][:, 0]
        for each, motion, end in (
            (source.figure, source.clip, ""), (figure, found.clip, "_"), (figure, clip, "_"),
        )
    )  # fmt: skip
    met = theirs < 0.06 * HEIGHT
    # Wrists that are crossed by 11 cm come back. Hands touch where wrists are two octahedra apart.
    assert before[met].max() < -8.0
    assert np.abs(after[met] - 2.0 * TIP).max() < 0.03 * HEIGHT and after.min() > 0.0


def test_hands_on_the_crown_come_to_the_skin_of_a_head():
    source, figure = raised(np.array([8.0, 186.0])), body(arms=1.4)
    corners, faces = octahedron(radius := 22.0)
    head = places_at_rest(figure)["Head_"]
    figure = clothed(head + corners, faces, "Head_", figure)
    found = retarget(source, figure, source_rest="auto")
    clip, _ = keep_hands(found, found.clip, figure)
    for side in ("Left", "Right"):
        # The faces of an octahedron are |x| + |y| + |z| = r, at r / sqrt(3) from its middle; those
        # of a hand are as much nearer than its wrist.
        before, after = (
            (np.abs(where[f"{side}Hand_"] - where["Head_"]).sum(axis=1) - radius - TIP) / 3.0**0.5
            for where in (places(figure, each) for each in (found.clip, clip))
        )
        assert before.min() > 0.06 * HEIGHT and np.abs(after).max() < 0.03 * HEIGHT


def test_hand_touches_armour_that_stands_off_the_body():
    # A plate 3 cm thick before the left third of the trunk has an outer and an inner face. The left
    # hand comes to the outer one, the right hand to the trunk.
    trunk, faces = tube(6.0)
    plate = faces[np.isin(faces % 24, [*range(20, 24), *range(5)]).all(axis=1)]
    outer, inner = tube(14.0)[0], tube(11.0)[0]
    corners = np.concatenate([trunk, outer, inner])
    every = np.concatenate([faces, plate + 48, plate[:, ::-1] + 96])
    figure, source = clothed(corners, every), comes_to_the_trunk()
    found = retarget(source, figure, source_rest="auto")
    clip, _ = keep_hands(found, found.clip, figure)
    for side, radius in (("Left", 14.0), ("Right", 6.0)):
        touching = from_trunk(figure, clip, side)[26:34]
        assert np.abs(touching - radius).max() < 0.03 * HEIGHT


@pytest.mark.parametrize(("turn", "along", "across"), [(-1, 0.065, 0.052), (1, 0.05, 0.025)])
def test_thumb_is_the_first_part_of_a_hand_to_touch_a_thigh(turn, along, across):
    # A straight left arm hangs at x = 36 from 145 cm, with the wrist at 91 cm, beside a thigh at
    # x = 20 from 95 to 50 cm. Thumbs point forwards at rest; a quarter of a turn points them at the
    # thigh, or away from it.
    skeleton = body(width=2.0).require_skeleton()
    local = np.tile(np.eye(3), (1, len(NAMES), 1, 1))
    local[:, NAMES.index("LeftArm")] = matrices(-0.5 * np.pi * Z)
    local[:, NAMES.index("LeftHand")] = matrices(-turn * 0.5 * np.pi * X)
    clip = SampledClip("", Timing(30.0, np.zeros(1, dtype=np.int32)), matrix_to_quaternion(local))
    joints = {name: j for j, name in enumerate(joint_meanings(skeleton)) if name}
    rests = np.stack([skeleton.rest_translations, skeleton.rest_scales])
    tips = [joints["right_wrist"], joints["left_wrist"]]
    person = Person(Body(skeleton, clip, joints, rests, tips), tips)
    # The nearest point of the hand, 1.3 % of the height thick; the thigh, 8.2 % thick at the hip
    # and 4.5 % at the knee.
    part = (95.0 - 91.0 + along * HEIGHT) / 45.0
    thigh = 0.082 + part * (0.045 - 0.082)
    assert_allclose(person.hand[1], 16.0 / HEIGHT - across - thigh - 0.013, atol=1e-3)


def test_hands_of_long_arms_come_to_the_body_without_a_jerk():
    # Forearms fold by up to 2.4 radians, so that hands leave the thighs and come back within a few
    # frames. They are moved by 18 cm at the thighs, and by nothing where they are free.
    figure = body(arms=1.4)
    found, clip, changes = kept(figure, motion(1.2, 1.2, down=1.4))
    assert changes.after < 0.3 * changes.before
    paths = [places(figure, each)["LeftHand_"] for each in (found.clip, clip)]
    moved = paths[1] - paths[0]
    assert 17.0 < np.linalg.norm(moved, axis=1).max() < 19.0
    # At constant acceleration and deceleration, 18 cm in 5 frames take 4 * 18 / 5^2 a frame.
    assert np.linalg.norm(np.diff(moved, n=2, axis=0), axis=1).max() < 2.9


def shield():
    """Return a third of the tube around the trunk, on the left.

    From its middle, the gap between its ends spans 120 degrees, by the inscribed angle: the winding
    number there is 1/2 - 1/3, and less as its height is finite.
    """
    corners, faces = tube(RADIUS)
    return corners, faces[np.isin(faces % 24, [*range(20, 24), *range(5)]).all(axis=1)]


@pytest.mark.parametrize("sheet", [sheets(RADIUS), shield()])
def test_hands_stay_before_an_open_sheet(sheet):
    # A cape has no inside: the hands are behind its front, as they would be in a stout trunk.
    source, cape = motion(0.3, 0.1, down=1.6), clothed(*sheet)
    found = retarget(source, cape, source_rest="auto")
    _, changes = keep_hands(found, found.clip, cape)
    assert from_trunk(cape, found.clip, "Left").max() < RADIUS
    assert changes.before > 0.0 and changes.moved == 0.0


def test_hands_that_are_free_in_the_source_are_left_in_a_stout_body():
    # Arms 1.2 radians below the horizontal end over 36 cm from the trunk: 0.26 of the height.
    source, stout = motion(0.0, 0.0, down=1.2), clothed(*tube(60.0))
    found = retarget(source, stout, source_rest="auto")
    clip, changes = keep_hands(found, found.clip, stout)
    assert from_trunk(stout, found.clip, "Left").max() < 60.0
    assert changes is None and clip is found.clip


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
