"""BVH files with mutations, truncation or inserted words, which load or are refused in one line."""

import random
import re
import tracemalloc

import numpy as np
import pytest
from formats.bvh.bvh_refusals import refusal
from formats.bvh_text import GOOD, read
from formats.test_mutations import mutate

from viewer.errors import FormatError, ViewerError
from viewer.formats import Source, bvh
from viewer.rig.motion.evaluation import frames_of, world_frames


@pytest.mark.slow
def test_many_static_joints_in_many_frames_are_refused_before_allocating() -> None:
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


def test_name_with_control_characters_is_shown_on_one_line() -> None:
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
def test_mutated_file_is_read_or_refused_in_one_line(seed: int) -> None:
    rng = random.Random(seed)
    for _ in range(150):
        check(mutate(GOOD.encode(), rng))


def test_truncated_file_is_read_or_refused_in_one_line() -> None:
    for cut in range(len(GOOD)):
        check(GOOD[:cut].encode())


@pytest.mark.slow
@pytest.mark.parametrize("token", [b"3.4e38", b"-3.4e38", b"1e-300", b"0", b"-1", b"{", b"}", b"x"])
def test_file_with_an_inserted_word_is_read_or_refused_in_one_line(token: bytes) -> None:
    words = re.split(rb"(\s+)", GOOD.encode())
    for at in range(0, len(words), 2):
        check(b"".join([*words[:at], token, *words[at + 1 :]]))
        check(b"".join([*words[:at], token, b" ", *words[at:]]))


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r\r\n", b"\r"])
def test_invalid_number_is_reported_on_its_line(end: bytes) -> None:
    lines = GOOD.encode().rstrip().split(b"\n")
    for number, line in enumerate(lines, start=1):
        if not re.search(rb"\d$", line):
            continue
        broken = [*lines[: number - 1], line[:-1] + b"x", *lines[number:]]
        with pytest.raises(FormatError) as caught:
            bvh.read(Source("a.bvh", end.join(broken)))
        assert caught.value.line == number, str(caught.value)
