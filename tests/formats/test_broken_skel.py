"""Broken ``.skel`` files with their exact messages, and large ones."""

import tracemalloc

import pytest
from skel_text import GOOD, read, refusal, silent

from viewer.errors import FormatError
from viewer.formats import Source, skel


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "a.skel: expected a skeleton, found no balljoint (an empty file)"),
        (" \n ", "a.skel: expected a skeleton, found no balljoint (only white space)"),
        ("offset 1 2 3", "a.skel:1: expected a skeleton, found no balljoint"),
        ("\0\0\0\0", "a.skel: expected a skeleton, found no balljoint (zeros)"),
        ("balljoint", 'a.skel:1: joint without a name: expected "{", found the end of the file'),
        ("\nballjoint a b\n", 'a.skel:2: joint a b: expected "{", found the end of the file'),
        ("balljoint a\noffset 1 2 3 }", 'a.skel:2: joint a: expected "{", found "offset"'),
        ("balljoint a\nballjoint b {}", 'a.skel:2: joint a: expected "{", found "balljoint"'),
        ("balljoint\n}", 'a.skel:2: joint without a name: expected "{", found "}"'),
        (
            "balljoint a {\n\n offset 1 up 3 }",
            'a.skel:3: offset of joint a: expected a number, found "up"',
        ),
        (
            "balljoint a {\r\n\r\n offset 1 nan 3 }",
            'a.skel:3: offset of joint a: expected a number, found "nan"',
        ),
        (
            "balljoint a {\r\r\noffset 1\r\r\ninf 3 }",
            'a.skel:3: offset of joint a: expected a number, found "inf"',
        ),
        (
            "balljoint a {\r\rpose 1e999 0 0 }",
            'a.skel:3: pose of joint a: expected a number below 3.4e+38, found "1e999"',
        ),
        (
            "balljoint a { rotxlimit 0 3.5e38 }",
            'a.skel:1: rotxlimit of joint a: expected a number below 3.4e+38, found "3.5e38"',
        ),
        (
            "balljoint a { rotylimit 0 1,5 }",
            'a.skel:1: rotylimit of joint a: expected a number, found "1,5"',
        ),
        (
            "balljoint a { rotzlimit 0 1_000 }",
            'a.skel:1: rotzlimit of joint a: expected a number, found "1_000"',
        ),
        (
            "balljoint a { boxmin 1.0-2.0 3 4 }",
            'a.skel:1: boxmin of joint a: expected a number, found "1.0-2.0"',
        ),
        (
            "balljoint a { boxmax 1 2 \u0663 }",
            'a.skel:1: boxmax of joint a: expected a number, found "\u0663"',
        ),
        (
            "balljoint a { offset 1 2\0 3 }",
            'a.skel:1: offset of joint a: expected a number, found "2\\x00"',
        ),
        (
            "balljoint a {\noffset 1 2\n}",
            "a.skel:2: offset of joint a: expected 3 numbers, found 2",
        ),
        (
            "balljoint {\npose\nballjoint b {}",
            "a.skel:2: pose of joint without a name: expected 3 numbers, found 0",
        ),
        (
            "balljoint a {\noffset 1 2",
            "a.skel:2: offset of joint a: expected 3 numbers, found 2, then the end of the file",
        ),
        (
            "balljoint a { rotxlimit 1\n2 3 }",
            'a.skel:2: rotxlimit of joint a: expected 2 numbers, found more: "3"',
        ),
        (
            "balljoint a {\n balljoint b {\n offset 1 2 3\n\n",
            'a.skel:3: expected "}", found the end of the file: joint b (line 2) is still open',
        ),
        (
            "balljoint a {\n balljoint b { }\n balljoint {\n",
            'a.skel:3: expected "}", found the end of the file: '
            "joint without a name (line 3) is still open",
        ),
        (
            "balljoint a {\nfoo {\n { } balljoint b { }",
            'a.skel:2: "foo" is still open where the file ends',
        ),
        ("{ balljoint a { }", 'a.skel:1: "{" is still open where the file ends'),
    ],
)
def test_broken_file_is_refused_with_its_line(text, message):
    assert refusal(text) == message


def test_odd_names_are_shown_on_one_line():
    text = b"balljoint \xff\x1b[31m\xe2\x80\xa8 {\n pose x 0 0 }"
    assert refusal(text) == (
        'a.skel:2: pose of joint \ufffd\\x1b[31m\\u2028: expected a number, found "x"'
    )


def test_long_names_and_words_are_cut():
    text = f"balljoint {'n' * 5_000_000} {{ pose {'9x' * 2_500_000} 0 0 }}"
    assert refusal(text) == (
        f'a.skel:1: pose of joint {"n" * 39}…: expected a number, found "{"9x" * 19}9…"'
    )


@pytest.mark.parametrize("cut", range(len(GOOD.rstrip())))
def test_file_cut_anywhere_is_refused_or_warned_of(cut):
    source = Source("a.skel", GOOD[:cut].encode())
    try:
        skel.read(source)
    except FormatError as problem:
        assert str(problem).startswith("a.skel")
    else:
        # Only the last brace may be missing without making it another file.
        assert 'a.skel: the last "}" is missing' in source.warnings


# Large files


def test_100_000_nested_joints_load():
    skeleton = silent("balljoint a{" * 100_000 + "}" * 100_000)
    assert skeleton.n_joints == 100_000
    assert skeleton.parents[[0, 1, -1]].tolist() == [-1, 0, 99_998]


def test_100_000_unclosed_joints_name_the_innermost():
    assert refusal("balljoint a{\n" * 100_000) == (
        'a.skel:100000: expected "}", found the end of the file: '
        "joint a (line 100000) is still open"
    )


def test_20_000_siblings_load():
    skeleton = silent("balljoint r{\n" + "balljoint a{}\n" * 20_000 + "}")
    assert skeleton.parents.tolist() == [-1] + [0] * 20_000


def test_unknown_block_nested_a_million_deep_is_skipped():
    _, warnings = read("balljoint a { foo " + "{" * 1_000_000 + "}" * 1_000_000 + " }")
    assert warnings == ['a.skel:1: skipped unknown "foo"']


def test_20_000_different_unknown_words_are_skipped():
    words = "\n".join(f"w{number}" for number in range(20_000))
    assert len(read(f"balljoint a {{ {words} }}")[1]) == 101


@pytest.mark.parametrize("end", ["\n", "\r", "\r\n", "\r\r\n", " "])
def test_5_million_blank_lines_are_counted(end):
    text = end * 5_000_000 + "balljoint a { offset up }"
    line = 1 if end == " " else 5_000_001
    assert refusal(text) == f'a.skel:{line}: offset of joint a: expected a number, found "up"'


def test_name_of_5_mb_loads():
    assert silent(f"balljoint {'x' * 5_000_000} {{}}").names == ("x" * 5_000_000,)


def test_refusal_takes_little_memory():
    text = b"balljoint a {\n" + b"offset 0 0 0\n" * 20_000 + b"pose up"
    tracemalloc.start()
    try:
        refusal(text)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 1_000_000
