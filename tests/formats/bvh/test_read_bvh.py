"""The BVH reader: all rotation orders, positions on any joint, quirks, and estimates."""

import itertools
import math

import numpy as np
import pytest
from builders import axis_turn
from formats.bvh_text import GOOD, one_joint, read
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from rigs.retargeting.trotting import animal
from rigs.retargeting.two_people import figure_of

from viewer.formats import Source, detect
from viewer.formats.bvh import guess_up
from viewer.loading import MotionSettings, load
from viewer.rigs.motion.evaluation import frames_of, world_frames
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.motion.timing import Timing


def about(axis: int, degrees: float) -> np.ndarray:
    return axis_turn(axis, math.radians(degrees))


def worlds(motion: SkeletonMotion) -> np.ndarray:
    clip = motion.clip
    times = np.arange(clip.n_rows) / clip.timing.frame_rate
    return world_frames(motion.figure, frames_of(motion.figure, clip, times))


def test_reads_every_part():
    motion, warnings = read(GOOD)
    skeleton = motion.figure.skeleton
    assert warnings == []
    assert (motion.figure.name, motion.figure.unit, motion.figure.up) == ("a", "m", "y")
    assert skeleton.names == ("Hips", "LeftUpLeg", "LeftFoot", "Head")
    np.testing.assert_array_equal(skeleton.parents, [-1, 0, 1, 0])
    offsets = [[0, 0, 0], [0.1, 0, 0], [0, -0.9, 0], [0, 0.6, 0]]
    np.testing.assert_array_equal(skeleton.rest_translations, offsets)
    assert motion.clip.timing.frame_rate == 30.0
    assert motion.clip.timing.rows.tolist() == [0, 1]
    assert ("frames", "2 at 30 fps") in motion.figure.facts


@pytest.mark.parametrize("part", (1, 7, 40))
@pytest.mark.parametrize("breaks", ("\n", "\r\n", "\r", " "))
def test_frames_are_read_in_parts_of_any_length(monkeypatch, part, breaks):
    """The numbers of a part need not fill its last frame."""
    monkeypatch.setattr("viewer.formats.bvh.motion.PART", part)
    head, rows = GOOD.split("Frame Time: 0.0333333\n")
    numbers = rows.split()
    for step in (4, 15, len(numbers)):
        lines = [" ".join(numbers[at : at + step]) for at in range(0, len(numbers), step)]
        motion, warnings = read(f"{head}Frame Time: 0.0333333\n{breaks.join(lines)}\n")
        assert warnings == []
        np.testing.assert_array_equal(worlds(motion), worlds(read(GOOD)[0]))


def test_joint_positions_follow_the_channels():
    motion, _ = read(GOOD)
    places = worlds(motion)[..., :3, 3]
    # In frame 0, the thigh rotates by 90 degrees about z, so the foot, 0.9 below, is 0.9 to the
    # right.
    np.testing.assert_allclose(
        places[0], [[0, 1, 0], [0.1, 1, 0], [1, 1, 0], [0, 1.6, 0]], atol=1e-15
    )
    turn = about(2, 10) @ about(0, 20) @ about(1, 30)
    root = np.array([1.0, 2.0, 3.0])
    leg = root + turn @ [0.1, 0, 0]
    expected = [root, leg, leg + turn @ [0, -0.9, 0], root + turn @ [0, 0.6, 0]]
    np.testing.assert_allclose(places[1], expected, atol=1e-14)


@pytest.mark.parametrize("order", [*itertools.permutations("XYZ"), "ZXZ", "XY", "Y", "XYZX", ""])
def test_rotation_channels_multiply_from_left_to_right(order):
    angles = [10.0, -130.0, 75.0, 33.0][: len(order)]
    channels = " ".join(f"{axis}rotation" for axis in order) or "Xposition"
    motion, _ = read(one_joint(channels, " ".join(map(str, angles)) or "0"))
    expected = np.eye(3)
    for axis, angle in zip(order, angles, strict=True):
        expected = expected @ about("XYZ".index(axis), angle)
    np.testing.assert_allclose(worlds(motion)[0, 0, :3, :3], expected, atol=1e-14)


@pytest.mark.slow
@given(st.permutations(["Xposition", "Zposition", "Yposition", "Zrotation", "Xrotation"]))
def test_channels_may_be_in_any_order(channels):
    values = {"Xposition": 1.0, "Yposition": 2.0, "Zposition": 3.0, "Zrotation": 50, "Xrotation": 7}
    motion, _ = read(one_joint(" ".join(channels), " ".join(str(values[c]) for c in channels)))
    turn = np.eye(3)
    for channel in channels:
        if channel.endswith("rotation"):
            turn = turn @ about("XYZ".index(channel[0]), values[channel])
    world = worlds(motion)[0, 0]
    np.testing.assert_allclose(world[:3, 3], [1, 2, 3], atol=1e-15)
    np.testing.assert_allclose(world[:3, :3], turn, atol=1e-14)


def test_position_channels_replace_the_offset_of_any_joint_one_axis_at_a_time():
    text = GOOD.replace(
        "OFFSET 0.0 0.6 0.0\n\t\tCHANNELS 3", "OFFSET 0.0 0.6 0.0\n\t\tCHANNELS 4 Yposition"
    )
    text = text.replace("90 0 0 0 90 0 0 0 90", "90 0 0 0 90 0 0.75 0 0 90").replace(
        "0 0 0 0 0 0 0 0 0\n", "0 0 0 0 0 0 0.5 0 0 0\n"
    )
    motion, warnings = read(text)
    assert warnings == []
    np.testing.assert_allclose(motion.clip.translations[:, 3], [[0, 0.15, 0], [0, -0.1, 0]])
    np.testing.assert_allclose(worlds(motion)[0, 3, :3, 3], [0, 1.75, 0])


@pytest.mark.parametrize("zero", ["0", "-0.000001"])
def test_zero_position_channels_below_the_root_keep_the_offset(zero):
    six = "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
    text = GOOD.replace("CHANNELS 3 Zrotation Xrotation Yrotation", six)
    body = text.split("MOTION")[0] + "MOTION Frames: 1 Frame Time: 0.1\n" + f"{zero} " * 24
    motion, warnings = read(body)
    assert warnings == [("F007.bvh-positions", None, {})]
    # The angles of the file are rounded, too.
    np.testing.assert_allclose(worlds(motion)[0, 2, :3, 3], [0.1, -0.9, 0], atol=1e-5)


def test_root_offset_is_replaced_by_position_channels():
    motion, _ = read(GOOD.replace("OFFSET 0.0 0.0 0.0", "OFFSET 5 6 7", 1))
    np.testing.assert_allclose(worlds(motion)[:, 0, :3, 3], [[0, 1, 0], [1, 2, 3]], atol=1e-15)


@pytest.mark.parametrize(
    "text",
    [
        GOOD.replace("\n", "\r\n"),
        GOOD.replace("\n", "\r"),
        GOOD.replace("\n", "\r\r\n"),
        " ".join(GOOD.split()),
        GOOD.replace("\t", "    ").replace(" ", "  \t "),
        GOOD.upper(),
        GOOD.lower(),
        GOOD.replace(" {", "{").replace("\n{", "{"),
        "\ufeff" + GOOD + "\x1a",
        GOOD.rstrip(),
        "\n\n" + GOOD.replace("\n", "\n\n"),
        GOOD.replace("Frames: ", "Frames:").replace("Time: ", "Time:"),
        GOOD.replace("Frames: 2\nFrame Time: 0.0333333", "Frame Time: 0.0333333\nFrames: 2"),
        GOOD.replace("End Site", "End Site tip").replace("\t\tOFFSET 0.0 0.6", "OFFSET 0 0.6"),
    ],
    ids=["crlf", "cr", "cr cr lf", "one line", "blanks", "capitals", "small", "glued", "bom",
         "no end", "empty lines", "glued numbers", "time first", "named end"],
)  # fmt: skip
def test_quirks_load_without_warnings(text):
    motion, warnings = read(text)
    assert warnings == []
    expected = worlds(read(GOOD)[0])
    np.testing.assert_array_equal(worlds(motion), expected)


def test_names_may_be_repeated_missing_or_contain_spaces():
    text = GOOD.replace("LeftUpLeg", "arm").replace("LeftFoot", "arm").replace("Head", "")
    motion, warnings = read(text.replace("Hips", "my  hips é"))
    assert motion.figure.skeleton.names == ("my  hips é", "arm", "arm", "")
    assert warnings == []


def test_a_name_that_continues_on_the_next_line_is_joined_by_a_space():
    assert read(GOOD.replace("Hips", "my\n hips"))[0].figure.skeleton.names[0] == "my hips"


@pytest.mark.parametrize("time, rate, key", [
    ("25", 25.0, "C017.bvh-rate"),
    ("29.97", 30000 / 1001, "C017.bvh-rate"),
    ("120.0", 120.0, "C017.bvh-rate"),
    ("33.3333", 30.0, "C017.bvh-milliseconds"),
    ("8.33333", 120.0, "C017.bvh-milliseconds"),
])  # fmt: skip
def test_rates_and_milliseconds_in_place_of_a_frame_time_are_understood(time, rate, key):
    motion, warnings = read(GOOD.replace("0.0333333", time))
    assert motion.clip.timing.frame_rate == pytest.approx(rate, rel=1e-12 if rate > 30 else 1e-4)
    assert warnings == [
        (key, None, {"found": time.encode(), "rate": motion.clip.timing.frame_rate})
    ]


@pytest.mark.parametrize(("time", "keys"), [("0.0005", []), ("0.00001", ["C017.bvh-fast"])])
def test_frame_times_of_no_camera_are_reported_and_kept(time, keys):
    motion, warnings = read(GOOD.replace("0.0333333", time))
    assert motion.clip.timing.frame_rate == pytest.approx(1.0 / float(time))
    assert [key for key, *_ in warnings] == keys


@pytest.mark.parametrize("time", ["1", "2.5", "10.000000000"])
def test_slow_frame_times_are_seconds(time):
    motion, warnings = read(GOOD.replace("0.0333333", time))
    assert (motion.clip.timing.frame_rate, warnings) == (pytest.approx(1.0 / float(time)), [])


def test_the_second_offset_of_soma_is_ignored_and_said():
    doubled = GOOD.replace("OFFSET 0.1 0.0 0.0", "OFFSET 0.1 0.0 0.0 7 8 9")
    doubled = doubled.replace("OFFSET 0.0 -0.9 0.0", "OFFSET 0.0 -0.9 0.0 7 8 9")
    motion, warnings = read(doubled)
    np.testing.assert_array_equal(motion.figure.skeleton.rest_translations[1:3],
                                  [[0.1, 0, 0], [0, -0.9, 0]])  # fmt: skip
    values = {"n": 2, "joint": "joint LeftUpLeg"}
    assert warnings == [("F006.bvh-offset", 8, values)]


@pytest.mark.parametrize("frames", ["", "MOTION\nFrames: 0\nFrame Time: 0.04\n"])
def test_the_offset_of_the_root_places_a_skeleton_without_frames(frames):
    text = GOOD.replace("OFFSET 0.0 0.0 0.0", "OFFSET 5 90 3", 1).partition("MOTION")[0]
    places = worlds(read(text + frames)[0])[..., :3, 3]
    np.testing.assert_allclose(places[0, :3], [[5, 90, 3], [5.1, 90, 3], [5.1, 89.1, 3]])


def test_several_roots_are_read():
    head, tail = GOOD.split("MOTION")
    second = "ROOT prop { OFFSET 1 0 0 CHANNELS 1 Xrotation }\n"
    lines = tail.strip().split("\n")
    rows = [f"{row} 45" for row in lines[2:]]
    motion, _ = read(head + second + "MOTION\n" + "\n".join([*lines[:2], *rows]))
    assert motion.figure.skeleton.parents.tolist() == [-1, 0, 1, 0, -1]
    np.testing.assert_allclose(worlds(motion)[0, 4, :3, 3], [1, 0, 0])
    np.testing.assert_allclose(worlds(motion)[1, 4, :3, :3], about(0, 45), atol=1e-15)


def test_joints_without_channels_stay_at_rest():
    three = "CHANNELS 3 Zrotation Xrotation Yrotation"
    leg, foot, head = (f"{offset}\n{tabs}{three}" for offset, tabs in (
        ("OFFSET 0.1 0.0 0.0", "\t\t"),
        ("OFFSET 0.0 -0.9 0.0", "\t\t\t"),
        ("OFFSET 0.0 0.6 0.0", "\t\t"),
    ))  # fmt: skip
    text = GOOD.replace(foot, "OFFSET 0.0 -0.9 0.0 CHANNELS 0").replace(head, "OFFSET 0 0.6 0")
    text = text.replace(leg, leg.replace("Zrotation", "Xrotation", 1))
    text = text.partition("0.0333333\n")[0] + "0.0333333\n" + "0 1 0 0 0 0 10 20 30\n" * 2
    motion, warnings = read(text)
    assert warnings == []
    np.testing.assert_array_equal(motion.clip.rotations[:, 2:], [[[0, 0, 0, 1]] * 2] * 2)
    np.testing.assert_allclose(
        worlds(motion)[1, 2, :3, :3], about(0, 10) @ about(0, 20) @ about(1, 30), atol=1e-15
    )


def test_end_sites_are_the_far_ends_of_boxes():
    skeleton = read(GOOD)[0].figure.skeleton
    boxes = skeleton.boxes
    assert skeleton.boxes_from_bones
    # With a single child, twice the centre of a box is the child's offset.
    np.testing.assert_allclose(boxes[3].sum(axis=0), [0, 0.2, 0], atol=1e-15)
    np.testing.assert_allclose(boxes[2].sum(axis=0), [0, 0, 0.2], atol=1e-15)
    np.testing.assert_allclose(boxes[1].sum(axis=0), [0, -0.9, 0], atol=1e-15)
    assert boxes[0, 0, 1] < 0.0 and boxes[0, 1, 1] == 0.6 and boxes[0, 1, 0] == 0.1
    assert (boxes[:, 1] > boxes[:, 0]).all()


def test_quaternions_keep_their_sign_from_frame_to_frame():
    angles = np.arange(0, 1500, 50)
    motion, _ = read(
        one_joint("Yrotation", "\n".join(str(a if a < 700 else a - 720) for a in angles))
    )
    rotations = motion.clip.rotations[:, 0]
    half = np.radians(angles) / 2
    expected = np.stack([0 * half, np.sin(half), 0 * half, np.cos(half)], axis=1)
    np.testing.assert_allclose(rotations, expected, atol=1e-13)


@pytest.mark.parametrize(
    ("written", "rate"),
    [
        ("0.0333333", 30.0),
        ("0.033333", 30.0),
        ("0.0333", 30.0),
        ("0.033", 30.0),
        ("0.03336667", 30000 / 1001),
        ("0.0333667", 30000 / 1001),
        ("0.0417083", 24000 / 1001),
        ("0.041667", 24.0),
        ("0.0083333", 120.0),
        ("0.00833333333333", 120.0),
        ("8.3333333e-3", 120.0),
        ("0.0166667", 60.0),
        ("0.05", 20.0),
        ("0.1", 10.0),
        ("1", 1.0),
        ("2", 0.5),
        ("0.027027", 37.0),
        ("0.034567", 1 / 0.034567),
    ],
)
def test_frame_rate_snaps_to_the_common_one_matching_the_frame_time(written, rate):
    motion, warnings = read(GOOD.replace("0.0333333", written))
    assert warnings == []
    assert motion.clip.timing.frame_rate == pytest.approx(rate, rel=1e-15)


def of_size(unit: str, size: str, inches: str = "") -> str:
    return f"{unit} assumed (skeleton {size} high{inches})"


@pytest.mark.parametrize(
    ("factor", "unit", "warnings"),
    [
        (1, "m", []),
        (100, "cm", [of_size("centimetres", "170")]),
        (1000, "mm", [of_size("millimetres", "1700")]),
        (40, "cm", [of_size("centimetres", "68", "; if in inches, 1.73 m")]),
        (10, "", ["unit unknown (skeleton 17 high)"]),
        (1e5, "", ["unit unknown (skeleton 170,000 high)"]),
    ],
)
def test_unit_is_guessed_from_the_height(factor, unit, warnings):
    text = one_joint("Xrotation", "0").replace("0 1.7 0", f"0 {1.7 * factor:g} 0")
    motion, found = read(text)
    assert (motion.figure.unit, found) == (unit, warnings)
    assert motion.figure.facts[0][0] == "unit"


def test_z_is_up_if_the_head_is_above_the_feet_along_z():
    text = GOOD.replace("0.0 -0.9 0.0", "0 0 -0.9").replace("0.0 0.6 0.0", "0.0 0.0 0.6")
    motion, warnings = read(text.replace("0.0 1.0 0.0 0 0 0", "0 0 1 0 0 0"))
    assert motion.figure.up == "z"
    assert warnings == ["z up assumed: the head is above the feet along z"]


def test_z_is_up_if_an_unnamed_skeleton_is_longest_along_z():
    motion, warnings = read(one_joint("Xrotation", "0").replace("0 1.7 0", "0 0.2 1.7"))
    assert motion.figure.up == "z"
    assert warnings == ["z up assumed: the rest skeleton is longest along z"]


def test_y_is_up_if_an_animal_that_is_longest_along_z_stands_on_its_legs():
    figure = figure_of(animal(length=0.8), "animal")
    points = np.array([place for _, place in animal(length=0.8).values()])
    assert np.ptp(points[:, 2]) > 2.0 * np.ptp(points[:, 1])
    timing = Timing(30.0, np.zeros(1, dtype=np.int32))
    still = SampledClip("", timing, figure.skeleton.rest_rotations[None])
    up, _, warnings, _ = guess_up(figure, still, points)
    assert (up, warnings) == ("y", ())


def test_the_axis_along_which_frames_are_upright_is_up():
    # The rest pose is along y, but rotated by 90 degrees about x in every frame, as in a z-up
    # world.
    rows = "0 0 1 0 90 0 0 0 0 0 0 0 0 0 0\n" * 2
    motion, warnings = read(GOOD.partition("0.0333333\n")[0] + "0.0333333\n" + rows)
    assert motion.figure.up == "z"
    assert warnings == [
        (
            "z up assumed: the skeleton is upright along z in the "
            "frames, although along +y in the rest pose"
        )
    ]


def test_skeleton_upside_down_at_rest_and_in_the_frames_hangs(tmp_path):
    """In the space of many cameras, y points down; such people stood on their heads."""
    text = GOOD.replace("0.0 -0.9 0.0", "0 0.9 0").replace("0.0 0.6 0.0", "0 -0.6 0")
    rows = "0 0 1 0 0 0 0 0 0 0 0 0 0 0 0\n" * 2
    text = text.partition("0.0333333\n")[0] + "0.0333333\n" + rows
    motion, warnings = read(text)
    assert motion.hangs and motion.figure.up == "y"
    assert warnings == [
        "-y up assumed: the skeleton is upright along -y at rest and in the frames, and is rotated "
        "upright"
    ]
    path = tmp_path / "a.bvh"
    path.write_text(text)
    for up, sign in (("", -1.0), ("y", 1.0), ("-y", -1.0)):
        (actor,) = load(path, motion=MotionSettings(up=up)).actors
        assert_allclose(actor.placement[1], [0, sign, 0, 0], atol=1e-12)


def test_skeleton_upside_down_in_the_frames_alone_is_mentioned():
    # The root is rotated by 180 degrees about x: a handstand, or the space of a camera.
    text = (
        GOOD.partition("0.0333333\n")[0] + "0.0333333\n" + "0 0 1 0 180 0 0 0 0 0 0 0 0 0 0\n" * 2
    )
    motion, warnings = read(text)
    assert motion.figure.up == "y" and not motion.hangs
    assert warnings == ["y up assumed, although the skeleton is upright along -y in the frames"]


def test_frames_are_named_as_the_evidence_if_the_rest_pose_has_another_axis():
    # The rest pose is along x, and rotated by 90 degrees about z in every frame.
    text = GOOD.replace("0.0 -0.9 0.0", "-0.9 0 0").replace("0.0 0.6 0.0", "0.6 0 0")
    rows = "0 0 1 90 0 0 0 0 0 0 0 0 0 0 0\n" * 2
    motion, warnings = read(text.partition("0.0333333\n")[0] + "0.0333333\n" + rows)
    assert ("up", "y, from the frames") in motion.figure.facts
    assert warnings == [
        (
            "y up assumed: the skeleton is upright along y in the "
            "frames, although along +x in the rest pose"
        )
    ]


def test_bvh_is_recognised_by_content():
    assert detect(Source("x.bvh", GOOD.encode())) == "bvh"
    assert detect(Source("x.txt", b"  hierarchy\nroot a{}")) == "bvh"


def test_deep_chain_loads_without_recursion():
    depth = 5000
    text = "HIERARCHY " + "".join(
        f"{'JOINT' if j else 'ROOT'} j{j} {{ OFFSET 0 0.001 0 CHANNELS 1 Xrotation "
        for j in range(depth)
    )
    text += "}" * depth + " MOTION Frames: 1 Frame Time: 0.1 " + "0 " * depth
    motion, _ = read(text)
    assert motion.figure.skeleton.n_joints == depth
    np.testing.assert_allclose(worlds(motion)[0, -1, :3, 3], [0, 5.0, 0], atol=1e-9)
