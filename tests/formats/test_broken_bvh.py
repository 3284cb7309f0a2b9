"""Broken ``.bvh`` files with their exact messages, and thousands of mutations."""

from __future__ import annotations

import random
import re
import tracemalloc

import numpy as np
import pytest
from bvh_text import GOOD, one_joint, read
from test_mutations import mutate

from viewer.errors import FormatError, ViewerError
from viewer.formats import Source, bvh
from viewer.rig.motion.evaluation import frames_of, world_frames

FRAMES = GOOD.partition("0.0333333\n")[2]


def refusal(text: str) -> str:
    with pytest.raises(FormatError) as caught:
        read(text)
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "a.bvh:1: expected HIERARCHY, found the end of the file (an empty file)"),
        (" \n", "a.bvh:1: expected HIERARCHY, found the end of the file (only white space)"),
        ("\nROOT a", 'a.bvh:2: expected HIERARCHY, found "ROOT"'),
        ("HIERARCHY", "a.bvh:1: expected ROOT, found the end of the file"),
        ("HIERARCHY MOTION", 'a.bvh:1: expected ROOT, found "MOTION"'),
        ("HIERARCHY\nJOINT a {", 'a.bvh:2: expected ROOT or MOTION, found "JOINT"'),
        ("HIERARCHY\nROOT a\n", 'a.bvh:2: joint a: expected "{", found the end of the file'),
        (
            GOOD.replace("LeftUpLeg\n\t{", "LeftUpLeg\n\t"),
            'a.bvh:8: joint LeftUpLeg: expected "{", found "OFFSET"',
        ),
        (
            GOOD.replace("OFFSET 0.1 0.0 0.0", "OFFSET 0.1 up 0.0"),
            'a.bvh:8: OFFSET of joint LeftUpLeg: expected a number, found "up"',
        ),
        (
            GOOD.replace("OFFSET 0.1 0.0 0.0", "OFFSET 0.1 nan 0.0"),
            'a.bvh:8: OFFSET of joint LeftUpLeg: expected a number, found "nan"',
        ),
        (
            GOOD.replace("OFFSET 0.1 0.0 0.0", "OFFSET 0,1 0 0"),
            'a.bvh:8: OFFSET of joint LeftUpLeg: expected a number, found "0,1"',
        ),
        (
            GOOD.replace("OFFSET 0.1 0.0 0.0", "OFFSET 0.1 0.0"),
            "a.bvh:8: OFFSET of joint LeftUpLeg: expected 3 numbers, found 2",
        ),
        (
            GOOD.replace("OFFSET 0.1 0.0 0.0", "OFFSET 0.1 0.0 0.0 5"),
            'a.bvh:8: OFFSET of joint LeftUpLeg: expected 3 numbers, found more: "5"',
        ),
        (
            GOOD.replace("OFFSET 0.1 0.0 0.0", "OFFSET 1 2 3\nOFFSET 4 5 6"),
            "a.bvh:9: joint LeftUpLeg: expected one OFFSET, found another",
        ),
        (
            GOOD.replace("OFFSET 0.0 0.2 0.0", "OFFSET 0.0 1e999 0.0"),
            "a.bvh:26: OFFSET of End Site of joint Head: expected a number below 3.4e+38, "
            'found "1e999"',
        ),
        (
            GOOD.replace("CHANNELS 6", "CHANNELS 5"),
            "a.bvh:5: CHANNELS of joint Hips: expected 5 channel names, found 6",
        ),
        (
            GOOD.replace("CHANNELS 6", "CHANNELS 99999999999"),
            "a.bvh:5: CHANNELS of joint Hips: expected 99999999999 channel names, found 6",
        ),
        (
            GOOD.replace("CHANNELS 6", "CHANNELS -6"),
            'a.bvh:5: CHANNELS of joint Hips: expected a count, found "-6"',
        ),
        (
            GOOD.replace("CHANNELS 6", "CHANNELS 2.5"),
            'a.bvh:5: CHANNELS of joint Hips: expected a count, found "2.5"',
        ),
        (
            GOOD.replace("Zposition", "Wposition"),
            'a.bvh:5: CHANNELS of joint Hips: expected Xposition … Zrotation, found "Wposition"',
        ),
        (
            GOOD.replace("Zposition", "xposition"),
            'a.bvh:5: CHANNELS of joint Hips: expected each position once, found "xposition" again',
        ),
        (
            GOOD.replace("\tCHANNELS 6", "\tCHANNELS 1 Xrotation\n\tCHANNELS 6"),
            "a.bvh:6: joint Hips: expected one CHANNELS, found another",
        ),
        (
            GOOD.replace("\tOFFSET 0.1", "\tCENTER 0.1"),
            "a.bvh:8: joint LeftUpLeg: expected OFFSET, CHANNELS, JOINT, End Site or "
            '"}", found "CENTER"',
        ),
        (
            GOOD.replace("OFFSET 0.0 0.2 0.0", "JOINT x { }"),
            'a.bvh:26: End Site of joint Head: expected OFFSET or "}", found "JOINT"',
        ),
        (
            GOOD.replace("}\nMOTION", "MOTION"),
            'a.bvh:29: expected "}", found "MOTION": joint Hips (line 2) is still open',
        ),
        (
            GOOD.partition("\t\tJOINT LeftFoot")[0],
            'a.bvh:9: expected "}", found the end of the file: joint LeftUpLeg (line 6) '
            "is still open",
        ),
        (
            GOOD.replace("Frames: 2", "Frames: two"),
            'a.bvh:31: Frames: expected a count, found "two"',
        ),
        (GOOD.replace("Frames: 2", "Frames: -1"), 'a.bvh:31: Frames: expected a count, found "-1"'),
        (
            GOOD.partition(" 2\nFrame Time")[0],
            "a.bvh:31: Frames: expected a count, found the end of the file",
        ),
        (
            GOOD.replace("0.0333333", "nan"),
            'a.bvh:32: Frame Time: expected seconds, found "nan"',
        ),
        (
            GOOD.replace("0.0333333", "-0.1"),
            'a.bvh:32: Frame Time: expected seconds, found "-0.1"',
        ),
        (
            GOOD.replace("10 20 30", "10 inf 30"),
            'a.bvh:34: frame 1: expected a number, found "inf"',
        ),
        (
            GOOD.replace("0.0 1.0 0.0 0", "0.0 1.0 0.0 0;"),
            'a.bvh:33: frame 0: expected a number, found "0;"',
        ),
        (
            GOOD.replace("0.0 1.0 0.0 0 0 0", "0.0 1.0 0.0 0 0"),
            "a.bvh:33: frame 0: expected 15 numbers as CHANNELS says, found 14",
        ),
        (
            GOOD.replace("10 20 30", "10 20 30 40"),
            "a.bvh:34: frame 1: expected 15 numbers as CHANNELS says, found 16",
        ),
        (
            re.sub(r" 0\n", "\n", GOOD).replace(" 90\n", "\n"),
            "a.bvh:33: frame 0: expected 15 numbers as CHANNELS says, found 14",
        ),
        (
            GOOD.replace("Frames: 2", "Frames: 30").replace(FRAMES, ""),
            "a.bvh:32: expected 30 frames as Frames says, found none",
        ),
        (
            GOOD.replace("Frames: 2", "Frames: 30").replace(FRAMES, "1 2 3\n"),
            "a.bvh:33: expected 30 frames as Frames says, found none and 3 of 15 numbers of the "
            "next",
        ),
    ],
)
def test_malformed_files_are_refused_with_their_line(text: str, message: str) -> None:
    text = text.replace("OFFSET 0.0 0.0 0.2", "OFFSET 0.0 0.0 0.2")
    assert refusal(text) == message


@pytest.mark.parametrize(
    ("text", "count", "warnings"),
    [
        (
            GOOD.replace("Frames: 2", "Frames: 1"),
            2,
            ["34: expected 1 frame as Frames says, found 2; the whole ones are used"],
        ),
        (
            GOOD.replace("Frames: 2", "Frames: 99999999999"),
            2,
            ["34: expected 99999999999 frames as Frames says, found 2; the whole ones are used"],
        ),
        (
            GOOD.rstrip()[:-8],
            1,
            [
                "34: expected 2 frames as Frames says, found 1 and 11 of 15 numbers of the next; "
                "the whole ones are used"
            ],
        ),
        (
            " ".join(GOOD.split()[:-4]),
            1,
            [
                "1: expected 2 frames as Frames says, found 1 and 11 of 15 numbers of the next; "
                "the whole ones are used"
            ],
        ),
        (GOOD.replace("Frames: 2\n", ""), 2, ["31: Frames is missing: all rows are used"]),
        (
            GOOD.replace("Frame Time: 0.0333333\n", ""),
            2,
            ["Frame Time is missing: taken for 30 frames a second"],
        ),
        (
            GOOD.replace("0.0333333", "0"),
            2,
            ["Frame Time is 0, expected 1e-06 to 1,000,000 seconds: taken for 30 frames a second"],
        ),
        (
            GOOD.replace("Frames: 2", "Frames: 0").replace(FRAMES, ""),
            1,
            ["32: no frames: shown in the rest pose"],
        ),
        (GOOD.partition("MOTION")[0], 1, ["29: no MOTION: shown in the rest pose"]),
        (GOOD + "the end\n", 2, ['35: ignored what follows the last frame, "the"']),
        (GOOD.replace("}\nMOTION", "}\n}\nMOTION"), 2, ['ignored 1 "}" after the root']),
        (
            GOOD.replace("\t\tOFFSET 0.1 0.0 0.0\n", ""),
            2,
            ["6: joint LeftUpLeg has no OFFSET: taken for 0 0 0"],
        ),
        (
            re.sub(r"\n\t+CHANNELS.*", "", GOOD),
            1,
            ["28: no joint has channels: shown in the rest pose"],
        ),
    ],
)
def test_what_is_odd_loads_with_a_warning(text: str, count: int, warnings: list[str]) -> None:
    motion, found = read(text)
    assert motion.clip.n_rows == count
    assert found == warnings


def test_channels_of_an_end_site_are_counted_and_ignored() -> None:
    text = one_joint("Xrotation", "30 40").replace("0 1.7 0 }", "0 1.7 0 CHANNELS 1 Yrotation }")
    motion, warnings = read(text)
    assert warnings == ["1: ignored the channels of an End Site of joint a"]
    half = np.radians(15)
    np.testing.assert_allclose(motion.clip.rotations, [[[np.sin(half), 0, 0, np.cos(half)]]])


def test_many_joints_without_channels_in_many_frames_are_refused_before_memory_is_taken() -> None:
    joints = "JOINT a { OFFSET 0 1 0 } " * 20000
    text = (
        f"HIERARCHY ROOT r {{ OFFSET 0 0 0 CHANNELS 1 Xrotation {joints} }} MOTION Frames: 20000 "
    )
    text += "Frame Time: 0.1 " + "1 " * 20000
    tracemalloc.start()
    message = refusal(text)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert message == (
        "a.bvh: expected channels for most joints, found 1 for 20001 joints in 20000 frames"
    )
    assert peak < 100e6


def test_a_name_with_control_characters_stays_on_one_line() -> None:
    message = refusal(GOOD.replace("LeftUpLeg", "a\x07b").replace("OFFSET 0.1", "OFFSET x"))
    assert message == 'a.bvh:8: OFFSET of joint a\\x07b: expected a number, found "x"'


def check(data: bytes) -> None:
    """Read a file; whatever loads must also move."""
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
def test_mutated_file_gives_a_motion_or_one_line(seed: int) -> None:
    rng = random.Random(seed)
    for _ in range(150):
        check(mutate(GOOD.encode(), rng))


def test_file_cut_anywhere_gives_a_motion_or_one_line() -> None:
    for cut in range(len(GOOD)):
        check(GOOD[:cut].encode())


@pytest.mark.parametrize("token", [b"3.4e38", b"-3.4e38", b"1e-300", b"0", b"-1", b"{", b"}", b"x"])
def test_word_put_anywhere_gives_a_motion_or_one_line(token: bytes) -> None:
    words = re.split(rb"(\s+)", GOOD.encode())
    for at in range(0, len(words), 2):
        check(b"".join([*words[:at], token, *words[at + 1 :]]))
        check(b"".join([*words[:at], token, b" ", *words[at:]]))


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r\r\n", b"\r"])
def test_word_that_should_be_a_number_is_found_on_its_line(end: bytes) -> None:
    lines = GOOD.encode().rstrip().split(b"\n")
    for number, line in enumerate(lines, start=1):
        if not re.search(rb"\d$", line):
            continue
        broken = [*lines[: number - 1], line[:-1] + b"x", *lines[number:]]
        with pytest.raises(FormatError) as caught:
            bvh.read(Source("a.bvh", end.join(broken)))
        assert str(caught.value).startswith(f"a.bvh:{number}: "), str(caught.value)
