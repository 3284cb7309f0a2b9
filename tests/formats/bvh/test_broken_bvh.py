"""Broken ``.bvh`` files with their messages, and thousands of mutations."""

import random
import re
import tracemalloc

import numpy as np
import pytest
from faults import Fault, refusal_of
from formats.bvh_text import GOOD, one_joint, read
from formats.test_mutations import mutate

from viewer.errors import FormatError, ViewerError
from viewer.formats import Source, bvh
from viewer.rigs.motion.evaluation import frames_of, world_frames


def refusal(text: str) -> Fault:
    return refusal_of(lambda: read(text))


FRAMES = GOOD.partition("0.0333333\n")[2]


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("", ("F002.bvh-start", 1, {"found": None, "looks": "an empty file"})),
        (" \n", ("F002.bvh-start", 1, {"found": None, "looks": "only white space"})),
        ("\nROOT a", ("F002.bvh-start", 2, {"found": b"ROOT", "looks": None})),
        ("HIERARCHY", ("F002.bvh-no-root", 1, {"found": None})),
        ("HIERARCHY MOTION", ("F002.bvh-no-root", 1, {"found": b"MOTION"})),
        ("HIERARCHY\nJOINT a {", ("F002.bvh-root", 2, {"found": b"JOINT"})),
        ("HIERARCHY\nROOT a\n", ("F002.opening", 2, {"item": "joint a", "found": None})),
        (
            GOOD.replace("LeftUpLeg\n\t{", "LeftUpLeg\n\t"),
            ("F002.opening", 8, {"item": "joint LeftUpLeg", "found": b"OFFSET"}),
        ),
        (
            GOOD.replace("OFFSET 0.1 0.0 0.0", "OFFSET 0.1 up 0.0"),
            ("F002.number", 8, {"item": "OFFSET of joint LeftUpLeg", "found": b"up"}),
        ),
        (
            GOOD.replace("OFFSET 0.1 0.0 0.0", "OFFSET 0.1 nan 0.0"),
            ("F003.number", 8, {"item": "OFFSET of joint LeftUpLeg", "found": b"nan"}),
        ),
        (
            GOOD.replace("OFFSET 0.1 0.0 0.0", "OFFSET 0,1 0 0"),
            ("F002.number", 8, {"item": "OFFSET of joint LeftUpLeg", "found": b"0,1"}),
        ),
        (
            GOOD.replace("OFFSET 0.1 0.0 0.0", "OFFSET 0.1 0.0"),
            ("F002.width", 8, {"item": "OFFSET of joint LeftUpLeg", "expected": 3, "found": 2}),
        ),
        (
            GOOD.replace("OFFSET 0.1 0.0 0.0", "OFFSET 0.1 0.0 0.0 5"),
            ("F002.more", 8, {"item": "OFFSET of joint LeftUpLeg", "expected": 3, "found": b"5"}),
        ),
        (
            GOOD.replace("OFFSET 0.1 0.0 0.0", "OFFSET 1 2 3\nOFFSET 4 5 6"),
            ("F002.bvh-offset-again", 9, {"found": b"OFFSET", "joint": "joint LeftUpLeg"}),
        ),
        (
            GOOD.replace("OFFSET 0.0 0.2 0.0", "OFFSET 0.0 1e999 0.0"),
            ("F003.too-large", 26, {"item": "OFFSET of End Site of joint Head", "found": b"1e999"}),
        ),
        (
            GOOD.replace("CHANNELS 6", "CHANNELS 5"),
            (
                "F002.bvh-channel-count",
                5,
                {"item": "CHANNELS of joint Hips", "expected": 5, "found": 6},
            ),
        ),
        (
            GOOD.replace("CHANNELS 6", "CHANNELS 99999999999"),
            (
                "F002.bvh-channel-count",
                5,
                {"item": "CHANNELS of joint Hips", "expected": 99999999999, "found": 6},
            ),
        ),
        (
            GOOD.replace("CHANNELS 6", "CHANNELS -6"),
            ("F002.count", 5, {"found": b"-6", "item": "CHANNELS of joint Hips"}),
        ),
        (
            GOOD.replace("CHANNELS 6", "CHANNELS 2.5"),
            ("F002.count", 5, {"found": b"2.5", "item": "CHANNELS of joint Hips"}),
        ),
        (
            GOOD.replace("Zposition", "Wposition"),
            ("F002.bvh-channel", 5, {"found": b"Wposition", "item": "CHANNELS of joint Hips"}),
        ),
        (
            GOOD.replace("Zposition", "xposition"),
            (
                "F002.bvh-position-again",
                5,
                {"found": b"xposition", "item": "CHANNELS of joint Hips"},
            ),
        ),
        (
            GOOD.replace("\tCHANNELS 6", "\tCHANNELS 1 Xrotation\n\tCHANNELS 6"),
            ("F002.bvh-channels-again", 6, {"found": b"CHANNELS", "joint": "joint Hips"}),
        ),
        (
            GOOD.replace("\tOFFSET 0.1", "\tCENTER 0.1"),
            ("F002.bvh-item", 8, {"found": b"CENTER", "joint": "joint LeftUpLeg"}),
        ),
        (
            GOOD.replace("OFFSET 0.0 0.2 0.0", "JOINT x { }"),
            ("F002.bvh-end-item", 26, {"found": b"JOINT", "joint": "End Site of joint Head"}),
        ),
        (
            GOOD.replace("}\nMOTION", "MOTION"),
            ("F002.joint-open", 29, {"found": b"MOTION", "joint": "joint Hips", "line": 2}),
        ),
        (
            GOOD.partition("\t\tJOINT LeftFoot")[0],
            ("F002.joint-open", 9, {"found": None, "joint": "joint LeftUpLeg", "line": 6}),
        ),
        (
            GOOD.replace("Frames: 2", "Frames: two"),
            ("F002.count", 31, {"item": "Frames", "found": b"two"}),
        ),
        (
            GOOD.replace("Frames: 2", "Frames: -1"),
            ("F002.count", 31, {"item": "Frames", "found": b"-1"}),
        ),
        (
            GOOD.partition(" 2\nFrame Time")[0],
            ("F002.count", 31, {"item": "Frames", "found": None}),
        ),
        (GOOD.replace("0.0333333", "nan"), ("F002.bvh-seconds", 32, {"found": b"nan"})),
        (GOOD.replace("0.0333333", "-0.1"), ("F002.bvh-seconds", 32, {"found": b"-0.1"})),
        (
            GOOD.replace("0.0 1.0 0.0 0", "0.0 1.0 0.0 0;"),
            ("F002.number", 33, {"item": "frame 0", "found": b"0;"}),
        ),
        (
            GOOD.replace("0.0 1.0 0.0 0 0 0", "0.0 1.0 0.0 0 0"),
            ("F002.bvh-row", 33, {"frame": 0, "expected": 15, "found": 14}),
        ),
        (
            GOOD.replace("10 20 30", "10 20 30 40"),
            ("F002.bvh-row", 34, {"frame": 1, "expected": 15, "found": 16}),
        ),
        (
            re.sub(r" 0\n", "\n", GOOD).replace(" 90\n", "\n"),
            ("F002.bvh-row", 33, {"frame": 0, "expected": 15, "found": 14}),
        ),
        (
            GOOD.replace("Frames: 2", "Frames: 30").replace(FRAMES, ""),
            ("F002.bvh-no-frame", 32, {"expected": "30 frames", "rest": None}),
        ),
        (
            GOOD.replace("Frames: 2", "Frames: 30").replace(FRAMES, "1 2 3\n"),
            (
                "F002.bvh-no-frame",
                33,
                {"expected": "30 frames", "rest": "3 of 15 numbers for the next"},
            ),
        ),
    ],
)
def test_malformed_files_are_refused_with_their_line(text, fault):
    assert refusal(text) == fault


@pytest.mark.parametrize(
    ("text", "count", "warnings"),
    [
        (
            GOOD.replace("Frames: 2", "Frames: 1"),
            2,
            [("F007.bvh-frames", 34, {"expected": "1 frame", "found": 2, "rest": None})],
        ),
        (
            GOOD.replace("Frames: 2", "Frames: 99999999999"),
            2,
            [("F007.bvh-frames", 34, {"expected": "99999999999 frames", "found": 2, "rest": None})],
        ),
        (
            GOOD.rstrip()[:-8],
            1,
            [
                (
                    "F007.bvh-frames",
                    34,
                    {"expected": "2 frames", "found": 1, "rest": "11 of 15 numbers for the next"},
                )
            ],
        ),
        (
            " ".join(GOOD.split()[:-4]),
            1,
            [
                (
                    "F007.bvh-frames",
                    1,
                    {"expected": "2 frames", "found": 1, "rest": "11 of 15 numbers for the next"},
                )
            ],
        ),
        (GOOD.replace("Frames: 2\n", ""), 2, [("F007.bvh-no-count", 31, {})]),
        (
            GOOD.replace("Frame Time: 0.0333333\n", ""),
            2,
            [("F007.bvh-no-time", None, {"rate": 30.0})],
        ),
        (
            GOOD.replace("0.0333333", "0"),
            2,
            [
                (
                    "C017.bvh-time",
                    None,
                    {"seconds": 0.0, "low": 1e-06, "high": 1000000.0, "rate": 30.0},
                )
            ],
        ),
        (
            GOOD.replace("Frames: 2", "Frames: 0").replace(FRAMES, ""),
            1,
            [("F007.bvh-empty", 32, {})],
        ),
        (GOOD.partition("MOTION")[0], 1, [("F007.bvh-no-motion", 29, {})]),
        (GOOD + "the end\n", 2, [("F006.bvh-after", 35, {"found": b"the"})]),
        (GOOD.replace("}\nMOTION", "}\n}\nMOTION"), 2, [("F006.extra-braces", None, {"n": 1})]),
        (
            GOOD.replace("\t\tOFFSET 0.1 0.0 0.0\n", ""),
            2,
            [("F007.bvh-no-offset", 6, {"joint": "joint LeftUpLeg"})],
        ),
        (re.sub(r"\n\t+CHANNELS.*", "", GOOD), 1, [("F007.bvh-no-channels", 28, {})]),
    ],
)
def test_oddities_load_with_a_warning(text, count, warnings):
    motion, found = read(text)
    assert motion.clip.n_rows == count
    assert found == warnings


def test_channels_of_an_end_site_are_counted_and_ignored():
    text = one_joint("Xrotation", "30 40").replace("0 1.7 0 }", "0 1.7 0 CHANNELS 1 Yrotation }")
    motion, warnings = read(text)
    joint = "End Site of joint a"
    assert warnings == [("F006.bvh-end-channels", 1, {"joint": joint})]
    half = np.radians(15)
    np.testing.assert_allclose(motion.clip.rotations, [[[np.sin(half), 0, 0, np.cos(half)]]])


# Root at height 90 in five frames, which turns the spine by 10 to 50 degrees about z.
TURNS = """HIERARCHY
ROOT hips
{
  OFFSET 0 90 0
  CHANNELS 3 Xposition Yposition Zposition
  JOINT spine
  {
    OFFSET 0 20 0
    CHANNELS 3 Zrotation Yrotation Xrotation
    End Site
    {
      OFFSET 0 30 0
    }
  }
}
MOTION
Frames: 5
Frame Time: 0.0333333
0 90 0 10 0 0
1 90 0 20 0 0
2 90 0 30 0 0
3 90 0 40 0 0
4 90 0 50 0 0
"""


@pytest.mark.parametrize("word", ["nan", "-NaN", "inf", "-1.#IND", "1e999"])
def test_frames_with_numbers_that_are_not_finite_are_gaps(word):
    text = TURNS.replace("20 0 0", f"{word} 0 0").replace("2 90", "2 -inf").replace("50", "nan")
    motion, notes = read(text)
    clip = motion.clip
    assert clip.timing.rows.tolist() == [0, -1, -1, 3, -1]
    # Half the angle of a turn about z is the arc tangent of z over w.
    turns = 2.0 * np.degrees(np.arctan2(clip.rotations[:, 1, 2], clip.rotations[:, 1, 3]))
    np.testing.assert_allclose(turns[[0, 3]], [10.0, 40.0], atol=1e-4)
    gaps = next(note for note in notes if note[0] == "F007.frames-lost")
    assert gaps[2]["n"] == 3
    key, _, values = gaps[2]["problem"]
    assert key == ("F003.too-large" if word == "1e999" else "F003.number")
    assert values["found"] == word.encode()
    assert values["item"] == "frame 1"


def test_gaps_are_found_without_line_ends():
    text = TURNS.replace("20 0 0", "nan 0 0")
    head, _, frames = text.partition("0.0333333\n")
    motion, _ = read(f"{head}0.0333333\n{' '.join(frames.split())}")
    assert motion.clip.timing.rows.tolist() == [0, -1, 2, 3, 4]


def test_word_in_a_frame_is_refused_beside_gaps():
    text = TURNS.replace("20 0 0", "nan 0 0").replace("40 0 0", "up 0 0")
    item = "frame 3"
    assert refusal(text) == ("F002.number", 22, {"item": item, "found": b"up"})


def test_motion_without_a_finite_frame_is_refused():
    text = re.sub(r" 90 0 ", " nan 0 ", TURNS)
    key, line, values = refusal(text)
    assert (key, line, values["n"]) == ("F003.frames-lost", None, 5)


@pytest.mark.slow
def test_many_static_joints_in_many_frames_are_refused_before_allocating():
    joints = "JOINT a { OFFSET 0 1 0 } " * 20000
    text = (
        f"HIERARCHY ROOT r {{ OFFSET 0 0 0 CHANNELS 1 Xrotation {joints} }} MOTION Frames: 20000 "
    )
    text += "Frame Time: 0.1 " + "1 " * 20000
    tracemalloc.start()
    fault = refusal(text)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    counts = {"channels": 1, "joints": 20001, "frames": 20000}
    assert fault == ("F002.bvh-few-channels", None, counts)
    assert peak < 100e6


def test_name_with_control_characters_is_shown_on_one_line():
    text = GOOD.replace("LeftUpLeg", "a\x07b").replace("OFFSET 0.1", "OFFSET x")
    with pytest.raises(FormatError) as caught:
        read(text)
    shown = 'a.bvh:8: OFFSET of joint a\\x07b: expected a number, found "x"'
    assert str(caught.value) == shown


def check(data: bytes) -> None:
    """Read a file; if it loads, it must also play."""
    source = Source("dir/a.bvh", data)
    try:
        motion = bvh.read(source)
    except ViewerError as problem:
        texts = [str(problem), *source.warnings]
    else:
        texts = source.warnings
        frames = frames_of(motion.figure, motion.clip, np.array([0.0]))
        assert np.isfinite(frames.rotations).all() and np.isfinite(frames.translations).all()
        world_frames(motion.figure, frames)
    for text in texts:
        assert re.match(r"dir/a\.bvh(:[1-9]\d*)?: \S", text), text
        assert text.isprintable() and len(text) < 600, text


@pytest.mark.parametrize("seed", range(10))
def test_mutated_file_is_read_or_refused_in_one_line(seed):
    rng = random.Random(seed)
    for _ in range(150):
        check(mutate(GOOD.encode(), rng))


def test_truncated_file_is_read_or_refused_in_one_line():
    for cut in range(len(GOOD)):
        check(GOOD[:cut].encode())


@pytest.mark.slow
@pytest.mark.parametrize("token", [b"3.4e38", b"-3.4e38", b"1e-300", b"0", b"-1", b"{", b"}", b"x"])
def test_file_with_an_inserted_word_is_read_or_refused_in_one_line(token):
    words = re.split(rb"(\s+)", GOOD.encode())
    for at in range(0, len(words), 2):
        check(b"".join([*words[:at], token, *words[at + 1 :]]))
        check(b"".join([*words[:at], token, b" ", *words[at:]]))


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r\r\n", b"\r"])
def test_invalid_number_is_reported_on_its_line(end):
    lines = GOOD.encode().rstrip().split(b"\n")
    for number, line in enumerate(lines, start=1):
        if not re.search(rb"\d$", line):
            continue
        broken = [*lines[: number - 1], line[:-1] + b"x", *lines[number:]]
        with pytest.raises(FormatError) as caught:
            bvh.read(Source("a.bvh", end.join(broken)))
        assert caught.value.line == number, str(caught.value)
