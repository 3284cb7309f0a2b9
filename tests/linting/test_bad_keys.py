"""Faults of single joints and frames in keyframed and captured motions, and sound motions."""

from collections.abc import Callable

import numpy as np
import pytest
from linting.sound import FRAMES, RATE, legs, make_skeleton

from viewer.linting import Finding, Subject, clips, frozen, hinges, jitter, pops, stretch
from viewer.linting._subject import ends_of
from viewer.rigs.figure import Figure
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.motion.transform_clip import TransformChannel, TransformClip
from viewer.rigs.retargeting.joint_names import joint_meanings
from viewer.rigs.scene import Actor

K = np.arange(FRAMES)
Change = Callable[[np.ndarray, np.ndarray, np.ndarray], None]
CHECKS = (pops, frozen, hinges, stretch, jitter)


def arm() -> Figure:
    """Return the skeleton of an arm along x whose elbow bends about z."""
    names = ("pelvis", "spine", "left_shoulder", "left_elbow", "left_wrist", "left_hand")
    offsets = [[0, 1, 0], [0, 0.5, 0], [0.2, 0, 0], [0.3, 0, 0], [0.3, 0, 0], [0.1, 0, 0]]
    return Figure("arm", skeleton=make_skeleton(names, [-1, 0, 1, 2, 3, 4], offsets), unit="m")


def about_z(degrees: np.ndarray) -> np.ndarray:
    """Return quaternions (F, 4) of rotations about z."""
    half = 0.5 * np.radians(degrees)
    return np.stack([0 * half, 0 * half, np.sin(half), np.cos(half)], axis=-1)


def waving() -> np.ndarray:
    """Return bends of the elbow in degrees: 40 +- 30 within 2 s, up to 3.2 a frame."""
    return 40.0 + 30.0 * np.sin(2.0 * np.pi * K / FRAMES)


def linted(change: Change, is_captured: bool) -> list[Finding]:
    """Check the waving arm, with changed bends (F,), local translations and scales (F, J, 3)."""
    figure = arm()
    skeleton, times = figure.skeleton, K / RATE
    bends, moves = waving(), np.tile(skeleton.rest_translations, (FRAMES, 1, 1))
    scales = np.ones(moves.shape)
    change(bends, moves, scales)
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, 6, 1))
    turns[:, 3] = about_z(bends)
    if is_captured:
        clip = SampledClip("x", Timing(RATE, K), turns, moves - skeleton.rest_translations)
    else:
        parts = (("rotation", turns), ("translation", moves), ("scale", scales))
        channels = [
            TransformChannel(joint, path, times, values[:, joint])
            for path, values in parts
            for joint in range(6)
        ]
        clip = TransformClip("x", tuple(channels), 0.0, float(times[-1]))
    subject = Subject(Actor(figure, clip=clip))
    return [found for check in CHECKS for found in check.check(subject)]


def pop(degrees: float) -> Change:
    def change(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
        bends[30] += degrees

    return change


def pop_for_two(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    bends[30:32] += 50.0


def pop_for_six(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    bends[30:36] += 20.0


def pop_at(frame: int) -> Change:
    def change(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
        bends[frame] += 50.0

    return change


def pop_in_a_twist(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    bends += 12.0 * K
    bends[30] += 24.0


def pop_of_a_quick_limb(n_frames: int) -> Change:
    """A swing of 25 degrees 2.5 times a second: steps of up to 13 degrees, differences d of 6.7."""
    middle = 30.0 + 0.5 * (n_frames - 1)

    def change(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
        bends[:] = 40.0 + 25.0 * np.sin(2.0 * np.pi * (K - middle) / 12.0)
        bends[30 : 30 + n_frames] += 15.0

    return change


def spike(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    moves[30, 0, 0] += 0.4


def freeze(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    bends[27:39] = bends[26]


def freeze_at_the_peak(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    """From the frame in which the arm turns back, when it is slow anyway."""
    bends[16:28] = bends[15]


def hyperextend(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    bends[20:30] = np.interp(K[20:30], [20, 25, 30], [70.0, -40.0, 50.0])


def lengthen(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    moves[10:20, 4] *= 1.5


def grow(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    scales[40:, 2] = 1.4


def be_large(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    scales[:, 2] = 1.4


def tremble(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    bends += np.random.default_rng(3).normal(0.0, 4.0, FRAMES)


# Each with its code, its joints, some values and its frames (None: any).
FAULTS = {
    "pop of 50 degrees": (pop(50.0), "C020.rotation", [3], {"size": "50°"}, [30]),
    "pop of 15 degrees": (pop(-15.0), "C020.rotation", [3], {"size": "15°"}, [30]),
    "pop of two frames": (pop_for_two, "C020.rotation", [3], {"size": "50°"}, [30, 31]),
    "pop of six frames": (pop_for_six, "C020.rotation", [3], {"size": "20°"}, [*range(30, 36)]),
    "pop at the end": (pop_at(57), "C020.rotation", [3], {"size": "50°"}, [57]),
    "pop of the last frame but one": (pop_at(58), "C020.rotation", [3], {}, [58]),
    "pop of the second frame": (pop_at(1), "C020.rotation", [3], {}, [1]),
    "pop of a fast joint": (pop_in_a_twist, "C020.rotation", [3], {"size": "24°"}, [30]),
    "pop of a quick limb": (pop_of_a_quick_limb(1), "C020.rotation", [3], {}, [30]),
    "pop of a quick limb for two frames": (
        pop_of_a_quick_limb(2), "C020.rotation", [3], {}, [30, 31]
    ),
    "spike": (spike, "C020.position", [0], {"size": "400 mm"}, [30]),
    "frozen": (freeze, "C021.frames", [], {"ranges": ["frames 27 to 38"]}, [*range(27, 39)]),
    "frozen at the peak": (
        *(freeze_at_the_peak, "C021.frames", []),
        *({"ranges": ["frames 16 to 27"]}, [*range(16, 28)]),
    ),
    "hyperextended": (hyperextend, "C024.hinge", [3], {"angle": pytest.approx(40.0)}, None),
    "stretched": (lengthen, "C022.bones", [4], {"ratio": "1.5"}, None),
    "scaled": (grow, "C023.scales", [2], {"ratio": "1.4"}, [*range(39, 60)]),
    "scaled throughout": (be_large, "C023.scales", [2], {"ratio": "1.4"}, [*range(60)]),
    "trembling": (tremble, "C014.rotation", [3], {"usual": "0.0°"}, None),
}  # fmt: skip


@pytest.mark.parametrize("is_captured", [False, True])
@pytest.mark.parametrize("name", FAULTS)
def test_fault_is_found_at_its_joint_and_frames(name, is_captured):
    change, key, joints, values, frames = FAULTS[name]
    if is_captured and name.startswith("scaled"):
        pytest.skip("captures have no scales")
    found = [one for one in linted(change, is_captured) if one.diagnostic.key == key]
    (one,) = found
    assert one.severity == "warning" and one.joints.tolist() == joints
    shown = {**one.diagnostic.values, **{k: str(v) for k, v in one.diagnostic.texts.items()}}
    for field, value in values.items():
        assert one.diagnostic.values.get(field, shown[field]) == value or shown[field] == value
    assert frames is None or sorted(one.frames.tolist()) == frames


@pytest.mark.parametrize(("first", "size"), [(30, 25), (1, 27), (FRAMES - 1, 27)])
@pytest.mark.parametrize(("steps", "codes"), [((0, 0), ["C020.turn"]), ((12, 0), [])])
def test_joint_that_turns_within_a_frame_is_found_unless_others_do(steps, codes, first, size):
    """The elbow is 25 degrees off from a frame on, while spine, shoulder and wrist move."""
    # Beyond the ends, the pose is held: second differences are (25 + 3.14, -25) degrees, as the
    # elbow moves by 3.14 a frame there; their projection onto the pattern (1, -1) is 26.6.
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, 6, 1))
    later = 1.0 * (first <= K)
    for joint, by in ((1, steps[0]), (2, steps[1]), (3, 25.0), (4, 0.0)):
        turns[:, joint] = about_z(waving() + by * later)
    clip = SampledClip("x", Timing(RATE, K), turns, np.zeros((FRAMES, 6, 3)))
    found = [*pops.check(Subject(Actor(arm(), clip=clip)))]
    assert [one.diagnostic.key for one in found] == codes
    for one in found:
        assert one.joints.tolist() == [3] and one.frames.tolist() == [first]
        assert f"rotates by {size}° within frame {first}" in one.message


@pytest.mark.parametrize(("other", "codes"), [(0.0, ["C020.rotation"]), (12.0, [])])
def test_pop_of_a_limb_that_is_as_quick_is_found_unless_others_have_one(other, codes):
    """A swing as above, 15 degrees off a frame after it turned back, while other joints move."""
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, 6, 1))
    off = 1.0 * (K == 30)
    for joint, by in ((1, other), (2, 0.0), (4, 0.0)):
        turns[:, joint] = about_z(waving() + by * off)
    turns[:, 3] = about_z(40.0 + 25.0 * np.cos(2.0 * np.pi * (K - 29.0) / 12.0) + 15.0 * off)
    clip = SampledClip("x", Timing(RATE, K), turns, np.zeros((FRAMES, 6, 3)))
    found = [*pops.check(Subject(Actor(arm(), clip=clip)))]
    about_elbow = [one for one in found if 3 in one.joints]
    assert [one.diagnostic.key for one in about_elbow] == codes


@pytest.mark.parametrize(("name", "n_found"), [("left_eye", 0), ("eyelid_l", 0), ("left_ear", 1)])
def test_eyes_and_lids_may_turn_for_a_few_frames(name, n_found):
    """A blink of three frames, by 40 degrees."""
    skeleton = make_skeleton(("pelvis", "head", name), [-1, 0, 1], [[0, 1, 0]] * 3)
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, 3, 1))
    turns[:, 1], turns[:, 2] = about_z(waving()), about_z(40.0 * ((K >= 30) & (K < 33)))
    figure = Figure("face", skeleton=skeleton, unit="m")
    actor = Actor(figure, clip=SampledClip("x", Timing(RATE, K), turns))
    assert len([*pops.check(Subject(actor))]) == n_found


@pytest.mark.parametrize(("rate", "n_found"), [(30.0, 1), (12.0, 0)])
def test_pop_of_a_slow_recording_must_be_larger(rate, n_found):
    """12 degrees are above 6 degrees for 1/30 s, but not above the 15 that 1/12 s leave to them."""
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, 6, 1))
    turns[:, 3] = about_z(waving() + 12.0 * (K == 30))
    actor = Actor(arm(), clip=SampledClip("x", Timing(rate, K), turns))
    assert len([*pops.check(Subject(actor))]) == n_found


def nothing(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    pass


def strike(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    """A blow: 60 degrees within two frames, which stops at once."""
    bends[:] = np.interp(K, [0, 30, 32, 59], [20.0, 10.0, 70.0, 72.0])


def strike_and_stop(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    """A blow that gets faster until it stops within a frame, as of a knight."""
    steps = np.zeros(FRAMES)
    steps[26:30] = 6.0, 12.0, 17.0, 41.0
    bends[:] = 10.0 + np.cumsum(steps)


def swing(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    """2.5 times a second, up to 13 degrees a frame."""
    bends[:] = 40.0 + 25.0 * np.sin(2.0 * np.pi * K / 12.0)


def hold(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    """A wave that slows down, rests for 12 frames, and speeds up again."""
    eased = np.concatenate([np.linspace(0.0, 0.5 * np.pi, 24), np.full(12, 0.5 * np.pi)])
    eased = np.concatenate([eased, np.linspace(0.5 * np.pi, np.pi, 24)])
    bends[:] = 20.0 + 40.0 * np.sin(eased)


def snap(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    """A pose that is held, and another one 90 degrees away, which settles."""
    eased = 20.0 * np.sin(np.linspace(0.0, 0.5 * np.pi, 24))
    bends[:] = np.concatenate([eased, np.full(12, 20.0), 110.0 + eased])


def flap(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    """Three beats a second, up to 15 degrees a frame."""
    bends[:] = 40.0 + 24.0 * np.sin(2.0 * np.pi * 3.0 * K / RATE)


def straighten(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    """An arm that is straight at times, to 8 degrees beyond."""
    bends[:] = 36.0 + 44.0 * np.sin(2.0 * np.pi * K / FRAMES)


def walk(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    moves[:, 0, 2] += 1.4 * K / RATE


def wave_on_twos(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    """2.5 times a second, up to 25 degrees from one drawing to the next; each is held."""
    bends[:] = 40.0 + 25.0 * np.sin(2.0 * np.pi * (K // 2 * 2) / 12.0)


def wave_on_threes(bends: np.ndarray, moves: np.ndarray, scales: np.ndarray) -> None:
    bends[:] = 40.0 + 25.0 * np.sin(2.0 * np.pi * (K // 3 * 3) / 15.0)


@pytest.mark.parametrize("is_captured", [False, True])
@pytest.mark.parametrize(
    "change",
    [
        *(nothing, strike, strike_and_stop, swing, hold, snap, flap, straighten, walk),
        *(wave_on_twos, wave_on_threes),
    ],
)
def test_sound_motion_has_no_finding(change, is_captured):
    assert linted(change, is_captured) == []


@pytest.mark.parametrize(("bend", "codes"), [(30.0, []), (-30.0, ["C024.hinge"])])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_knee_of_a_leg_that_is_straight_otherwise_bends_away_from_the_toes(bend, codes, side):
    """A leg along -y, whose toes point along z or -z, bends about x for ten frames."""
    names = ("pelvis", "left_hip", "left_knee", "left_ankle", "left_foot")
    offsets = [[0, 1, 0], [0.1, 0, 0], [0, -0.45, 0], [0, -0.45, 0], [0, 0, side * 0.15]]
    figure = Figure("leg", skeleton=make_skeleton(names, [-1, 0, 1, 2, 3], offsets), unit="m")
    half = 0.5 * np.radians(side * np.where((K >= 20) & (K < 30), bend, 0.0))
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, 5, 1))
    turns[:, 2, 0], turns[:, 2, 3] = np.sin(half), np.cos(half)
    actor = Actor(figure, clip=SampledClip("x", Timing(RATE, K), turns))
    assert [one.diagnostic.key for one in hinges.check(Subject(actor))] == codes


@pytest.mark.parametrize("gap", [1, 15])
def test_quick_swing_around_missing_frames_is_not_jitter(gap):
    """4.1 swings a second of up to 40 degrees, around another bend after the gap than before."""
    rows = np.arange(90)
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (90, 6, 1))
    turns[:, 3] = about_z(40.0 * np.sin(2.0 * np.pi * 4.1 * rows / RATE) + 120.0 * (rows > 44))
    rows[45 : 45 + gap] = -1
    actor = Actor(arm(), clip=SampledClip("x", Timing(RATE, rows), turns))
    assert "C014.rotation" not in [one.diagnostic.key for one in jitter.check(Subject(actor))]


def test_teleport_in_a_clip_of_keys_is_a_jump():
    """The pelvis of legs, below a root that stays, is 0.2 m aside from frame 30 on."""
    figure = legs()
    rest = figure.skeleton.rest_translations[0]
    path = rest + np.where(K < 30, 0.0, 0.2)[:, None] * [1.0, 0.0, 0.0]
    clip = TransformClip("x", (TransformChannel(0, "translation", K / RATE, path),), 0.0, 59 / RATE)
    (found,) = clips.check(Subject(Actor(figure, clip=clip)))
    assert found.diagnostic.key == "C003.joint" and found.frames.tolist() == [30]
    # 0.2 m in 1/30 s; the limit is 5 times the size of 0.922 m per second.
    assert "pelvis moves at 6 m/s" in found.message and "limit 4.61 m/s" in found.message


def test_body_that_shifts_within_a_frame_while_it_walks_is_found():
    """The pelvis is 0.1 m aside from frame 30 on, at 1.4 m/s."""
    figure = legs()
    path = np.tile(figure.skeleton.rest_translations[0], (FRAMES, 1))
    path += np.stack([0.1 * (K >= 30), 0.0 * K, 1.4 * K / RATE], axis=1)
    channels = (TransformChannel(0, "translation", K / RATE, path),)
    clip = TransformClip("x", channels, 0.0, 59 / RATE)
    (found,) = clips.check(Subject(Actor(figure, clip=clip)))
    assert found.diagnostic.key == "C003.step" and found.frames.tolist() == [30]
    assert "pelvis shifts by 100 mm" in found.message


def test_elbow_of_an_arm_without_a_wrist_is_checked():
    """Two fingers begin at the hand; for 9 frames, the elbow is 40 degrees beyond straight."""
    names = ("pelvis", "spine", "left_shoulder", "left_elbow", "left_index1", "left_middle1")
    offsets = [[0, 1, 0], [0, 0.5, 0], [0.2, 0, 0], [0.3, 0, 0], [0.3, 0, 0.02], [0.3, 0, -0.02]]
    figure = Figure("arm", skeleton=make_skeleton(names, [-1, 0, 1, 2, 3, 3], offsets), unit="m")
    bends = waving()
    bends[30:39] = -40.0
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, 6, 1))
    turns[:, 3] = about_z(bends)
    clip = SampledClip("x", Timing(RATE, K), turns, np.zeros((FRAMES, 6, 3)))
    (found,) = hinges.check(Subject(Actor(figure, clip=clip)))
    assert found.joints.tolist() == [3] and found.diagnostic.values["angle"] == pytest.approx(40.0)
    assert sorted(found.frames.tolist()) == [*range(30, 39)]


def test_arm_without_a_wrist_ends_in_the_joints_of_the_hand():
    names = ("Hips", "LeftArm", "LeftForeArm", "LeftForeArmTwist", "LeftHandIndex1", "Prop")
    limb = ("left_shoulder", "left_elbow", "left_wrist")
    for n_joints, expected in ((6, [4]), (4, [3]), (3, [])):
        parents = [-1, 0, 1, 2, 2, 2][:n_joints]
        skeleton = make_skeleton(names[:n_joints], parents, [[0.0, 1.0, 0.0]] * n_joints)
        assert ends_of(limb, joint_meanings(skeleton), skeleton) == expected


def test_ball_of_a_foot_is_no_end_of_a_shin():
    """Without an ankle, it makes a straight leg seem to be 15 degrees beyond: 0.08 at 0.3."""
    names = ("Hips", "LeftUpLeg", "LeftLeg", "LeftToeBase")
    offsets = [[0, 1, 0], [0.1, 0, 0], [0.3, 0, 0], [0.3, -0.08, 0]]
    bends = waving()
    bends[30:39] = 0.0
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, 4, 1))
    turns[:, 2] = about_z(bends)
    clip = SampledClip("x", Timing(RATE, K), turns, np.zeros((FRAMES, 4, 3)))
    for end, n_found in ((names[3], 0), ("LeftFoot", 1)):
        skeleton = make_skeleton((*names[:3], end), [-1, 0, 1, 2], offsets)
        figure = Figure("leg", skeleton=skeleton, unit="m")
        assert len([*hinges.check(Subject(Actor(figure, clip=clip)))]) == n_found
