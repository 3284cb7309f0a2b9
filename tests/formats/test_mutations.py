"""Thousands of broken files, which are read or refused in one line that starts with the path."""

import random
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from viewer.errors import ViewerError
from viewer.formats import Source, read
from viewer.rigs.figure import Figure
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.pose import rest_pose
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.skinning import deform

pytestmark = pytest.mark.slow

SKEL = b"""balljoint root {
\toffset 0 1 0
\tboxmin -0.1 -0.2 -0.3
\tboxmax 0.1 0.2 0.3
\trotxlimit -1.5 1.5
\tpose 0.5 0 -0.25
\tballjoint arm {
\t\toffset 1 0 0
\t\trotylimit -100000 100000
\t\tballjoint {
\t\t}
\t}
\tballjoint arm{ pose 1e-3 +.5 5. }
\tunknown 1 2 { 3 }
}
"""
SKIN = b"""positions 4 {
 0 0 0
 1 0 0.5
 0 1 -2.25e-1
 1 1 12.345678901234567
}
normals 4 {
 0 0 1
 0 0 1
 0 1 0
 0.6 0.8 0
}
texcoords 4 {
 0 0
 1 0
 0 1
 1 1
}
skinweights 4 {
 1 0 1.0
 2 0 0.5 1 0.5
 0
 3 1 0.25 0 0.25 1 0.5
}
material face {
 texture head.png
}
triangles 2 {
 0 1 2
 1 3 2
}
bindings 2 {
 matrix {
  1 0 0
  0 1 0
  0 0 1
  0 1 0
 }
 matrix {
  0 1 0
  -1 0 0
  0 0 1
  1 1 0
 }
}
"""
FILES = {"dir/a.skel": SKEL, "dir/a.skin": SKIN}
TOKENS = [
    *b"{ } { } 0 -1 1 2 3 4 5 1e9 2e9 -2147483648 2147483648 1e38 3.4e38 1e-300 -1e-40 nan".split(),
    *b"inf 1e999 0x1 1_0 1,5 - . 5. .5 +1 1f 99999999999999999999 balljoint offset pose".split(),
    *b"boxmin rotxlimit positions normals texcoords skinweights material triangles".split(),
    *b"bindings matrix texture foo \x00 \xff \xef\xbb\xbf \x1a \xd9\xa3 \xc2\xa0 \x85 %s".split(),
    b"\r",
    b"\r\r\n",
    b"\n",
    b" ",
    b"",
]


def check(path, data):
    """Read one file; if it loads, it must also be possible to pose it."""
    source = Source(path, data)
    try:
        figure = read(source)
    except ViewerError as problem:
        texts = [str(problem), *source.warnings]
    else:
        texts = source.warnings
        assert isinstance(figure, Figure)
        move(figure)
    for text in texts:
        assert re.match(re.escape(path) + r"(:[1-9]\d*)?: \S", text), text
        assert text.isprintable(), text
        assert len(text) < 600, text


def move(figure):
    """Deform a figure in its rest pose and in another pose."""
    if figure.skeleton is not None:
        pose = rest_pose(figure.skeleton)
        assert np.isfinite(world_matrices(figure.skeleton, pose)).all()
        pose.dofs[:] = 0.7
        assert np.isfinite(world_matrices(figure.skeleton, pose)).all()
    if figure.skin is not None:
        star = star_skeleton(figure.skin.n_joints) if figure.skin.n_joints else None
        figure = Figure("attached", figure.mesh, star, figure.skin)
    if figure.mesh is not None:
        positions, normals = deform(figure)
        assert np.isfinite(positions).all()
        assert np.isfinite(normals).all()


def star_skeleton(n_joints):
    """Return a skeleton for a skin without one, with every joint a child of the first."""
    return Skeleton(
        names=("",) * n_joints,
        parents=[-1] + [0] * (n_joints - 1),
        rest_translations=np.ones((n_joints, 3)),
        rest_rotations=np.tile([0.0, 0.6, 0, 0.8], (n_joints, 1)),
        rest_scales=np.ones((n_joints, 3)),
        dof_joints=[],
        dof_kinds=[],
        rest_dofs=[],
        dof_limits=np.zeros((0, 2)),
    )


def mutate(data, rng):
    """Return the bytes with one to four realistic changes."""
    for _ in range(rng.randint(1, 4)):
        data = rng.choice(MUTATIONS)(data, rng)
    return data


def flip(data, rng):
    at = rng.randrange(len(data) + 1)
    return data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]


def flip_bit(data, rng):
    at = rng.randrange(max(len(data), 1))
    return (
        data[:at]
        + bytes(byte ^ 1 << rng.randrange(8) for byte in data[at : at + 1])
        + data[at + 1 :]
    )


def delete(data, rng):
    at = rng.randrange(len(data) + 1)
    return data[:at] + data[at + rng.randint(1, 20) :]


def insert(data, rng):
    at = rng.randrange(len(data) + 1)
    return (
        data[:at]
        + rng.choice([b"", b" "])
        + rng.choice(TOKENS)
        + rng.choice([b"", b" "])
        + data[at:]
    )


def truncate(data, rng):
    return data[: rng.randrange(len(data) + 1)]


def drop_line(data, rng):
    lines = data.splitlines(keepends=True) or [b""]
    del lines[rng.randrange(len(lines))]
    return b"".join(lines)


def repeat_line(data, rng):
    lines = data.splitlines(keepends=True) or [b""]
    at = rng.randrange(len(lines))
    return b"".join(lines[: at + 1] + lines[at : at + rng.randint(1, 9)] + lines[at + 1 :])


def swap_words(data, rng):
    words = re.split(rb"(\s+)", data)
    first, second = rng.randrange(len(words)), rng.randrange(len(words))
    words[first], words[second] = words[second], words[first]
    return b"".join(words)


def replace_word(data, rng):
    words = re.split(rb"(\s+|[{}])", data)
    words[rng.randrange(len(words))] = rng.choice(TOKENS)
    return b"".join(words)


def move_block(data, rng):
    a, b, c = sorted(rng.randrange(len(data) + 1) for _ in range(3))
    return data[:a] + data[b:c] + data[a:b] + data[c:]


def other_line_ends(data, rng):
    return data.replace(b"\n", rng.choice([b"\r", b"\r\n", b"\r\r\n", b" ", b"\x85", b"\0"]))


MUTATIONS = [
    *[flip, flip_bit, delete, insert, truncate, drop_line, repeat_line],
    *[swap_words, replace_word, replace_word, move_block, other_line_ends],
]


@pytest.mark.parametrize("path", FILES)
@pytest.mark.parametrize("seed", range(5))
def test_mutated_file_is_read_or_refused_in_one_line(path, seed):
    rng = random.Random(seed)
    for _ in range(150):
        check(path, mutate(FILES[path], rng))


@pytest.mark.parametrize("path", FILES)
def test_truncated_file_is_read_or_refused_in_one_line(path):
    for cut in range(len(FILES[path])):
        check(path, FILES[path][:cut])


@pytest.mark.parametrize("path", FILES)
@pytest.mark.parametrize("token", [b"{", b"}", b" ", b"-", b"x", b"\0", b"9", b".", b"\x1a"])
def test_file_with_an_inserted_letter_is_read_or_refused_in_one_line(path, token):
    data = FILES[path]
    # Together, the letters are inserted everywhere.
    for at in range(token[0] % 4, len(data), 4):
        check(path, data[:at] + token + data[at:])


@pytest.mark.parametrize("path", FILES)
@pytest.mark.parametrize("token", [b"3.4e38", b"-3.4e38", b"1e-300", b"0", b"1e-45", b"-1"])
def test_file_with_an_extreme_number_is_read_or_refused_in_one_line(path, token):
    words = re.split(rb"(\s+)", FILES[path])
    for at in range(0, len(words), 2):
        check(path, b"".join([*words[:at], token, *words[at + 1 :]]))


def test_file_with_only_extreme_numbers_can_be_posed():
    check("dir/a.skel", re.sub(rb"-?\d\S*", b"3.4e38", SKEL))
    body = re.sub(rb"(\n  ?)(-?[\d.e-]+) (\S+) (\S+)(?=\n)", rb"\1\2 3.4e38 -3.4e38", SKIN)
    check("dir/a.skin", body)


@given(st.lists(st.sampled_from(TOKENS), max_size=60), st.sampled_from(sorted(FILES)))
@settings(max_examples=200)
def test_random_words_are_read_or_refused_in_one_line(words, path):
    check(path, b" ".join(words))


@given(st.binary(max_size=200), st.sampled_from(sorted(FILES)))
@settings(max_examples=200)
def test_random_bytes_are_read_or_refused_in_one_line(data, path):
    check(path, data)


@given(st.data(), st.sampled_from(sorted(FILES)))
@settings(max_examples=150)
def test_file_with_replaced_words_is_read_or_refused_in_one_line(data, path):
    words = re.split(rb"(\s+|[{}])", FILES[path])
    places = st.integers(0, len(words) - 1)
    changes = data.draw(
        st.dictionaries(places, st.sampled_from(TOKENS) | st.binary(max_size=6), max_size=5)
    )
    check(path, b"".join(changes.get(at, word) for at, word in enumerate(words)))


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r\r\n", b"\r"])
@pytest.mark.parametrize("path", FILES)
def test_invalid_number_is_reported_on_its_line(path, end):
    lines = FILES[path].split(b"\n")
    for number, line in enumerate(lines, start=1):
        # Only rows of numbers are changed, with or without the keyword of an item, but not those
        # after an unknown word.
        if b"unknown" in line or not re.search(rb"[\d.]+$", line) or b"{" in line:
            continue
        broken = [*lines[: number - 1], line[:-1] + b"x", *lines[number:]]
        with pytest.raises(ViewerError) as caught:
            read(Source(path, end.join(broken)))
        assert str(caught.value).startswith(f"{path}:{number}: "), str(caught.value)
        assert caught.value.diagnostic.key in ("F002.number", "F002.skin-influence-count")
