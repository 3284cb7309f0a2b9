"""Broken ``.skel`` files with their messages, and large files."""

import tracemalloc

import pytest
from faults import warnings_of
from formats.skel_text import GOOD, read, refusal, silent

from viewer.errors import FormatError
from viewer.formats import Source, skel


def message(text):
    with pytest.raises(FormatError) as caught:
        skel.read(Source("a.skel", text.encode() if isinstance(text, str) else text))
    return caught.value.diagnostic.message


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("", ("F002.no-joint", None, {"looks": "an empty file"})),
        (" \n ", ("F002.no-joint", None, {"looks": "only white space"})),
        ("offset 1 2 3", ("F002.no-joint", 1, {"looks": None})),
        ("\0\0\0\0", ("F002.no-joint", None, {"looks": "zeros"})),
        ("balljoint", ("F002.opening", 1, {"item": "unnamed joint", "found": None})),
        (
            "\nballjoint a b\n",
            ("F002.opening", 2, {"item": "joint a b", "found": None}),
        ),
        (
            "balljoint a\noffset 1 2 3 }",
            ("F002.opening", 2, {"item": "joint a", "found": b"offset"}),
        ),
        (
            "balljoint a\nballjoint b {}",
            ("F002.opening", 2, {"item": "joint a", "found": b"balljoint"}),
        ),
        ("balljoint\n}", ("F002.opening", 2, {"item": "unnamed joint", "found": b"}"})),
        (
            "balljoint a {\n\n offset 1 up 3 }",
            (
                "F002.number",
                3,
                {
                    "item": "offset of joint a",
                    "found": b"up",
                },
            ),
        ),
        (
            "balljoint a {\r\n\r\n offset 1 nan 3 }",
            (
                "F003.number",
                3,
                {
                    "item": "offset of joint a",
                    "found": b"nan",
                },
            ),
        ),
        (
            "balljoint a {\r\r\noffset 1\r\r\ninf 3 }",
            (
                "F003.number",
                3,
                {
                    "item": "offset of joint a",
                    "found": b"inf",
                },
            ),
        ),
        (
            "balljoint a {\r\rpose 1e999 0 0 }",
            (
                "F003.too-large",
                3,
                {
                    "item": "pose of joint a",
                    "found": b"1e999",
                },
            ),
        ),
        (
            "balljoint a { rotxlimit 0 3.5e38 }",
            (
                "F003.too-large",
                1,
                {
                    "item": "rotxlimit of joint a",
                    "found": b"3.5e38",
                },
            ),
        ),
        (
            "balljoint a { rotylimit 0 1,5 }",
            (
                "F002.number",
                1,
                {
                    "item": "rotylimit of joint a",
                    "found": b"1,5",
                },
            ),
        ),
        (
            "balljoint a { rotzlimit 0 1_000 }",
            (
                "F002.number",
                1,
                {
                    "item": "rotzlimit of joint a",
                    "found": b"1_000",
                },
            ),
        ),
        (
            "balljoint a { boxmin 1.0-2.0 3 4 }",
            (
                "F002.number",
                1,
                {
                    "item": "boxmin of joint a",
                    "found": b"1.0-2.0",
                },
            ),
        ),
        (
            "balljoint a { boxmax 1 2 \u0663 }",
            (
                "F002.number",
                1,
                {
                    "item": "boxmax of joint a",
                    "found": b"\xd9\xa3",
                },
            ),
        ),
        (
            "balljoint a { offset 1 2\0 3 }",
            (
                "F002.number",
                1,
                {
                    "item": "offset of joint a",
                    "found": b"2\x00",
                },
            ),
        ),
        (
            "balljoint a {\noffset 1 2\n}",
            (
                "F002.width",
                2,
                {
                    "item": "offset of joint a",
                    "expected": 3,
                    "found": 2,
                },
            ),
        ),
        (
            "balljoint {\npose\nballjoint b {}",
            (
                "F002.width",
                2,
                {
                    "item": "pose of unnamed joint",
                    "expected": 3,
                    "found": 0,
                },
            ),
        ),
        (
            "balljoint a {\noffset 1 2",
            (
                "F002.width-end",
                2,
                {
                    "item": "offset of joint a",
                    "expected": 3,
                    "found": 2,
                },
            ),
        ),
        (
            "balljoint a { rotxlimit 1\n2 3 }",
            (
                "F002.more",
                2,
                {
                    "item": "rotxlimit of joint a",
                    "expected": 2,
                    "found": b"3",
                },
            ),
        ),
        (
            "balljoint a {\n balljoint b {\n offset 1 2 3\n\n",
            ("F002.joint-open", 3, {"found": None, "joint": "joint b", "line": 2}),
        ),
        (
            "balljoint a {\n balljoint b { }\n balljoint {\n",
            ("F002.joint-open", 3, {"found": None, "joint": "unnamed joint", "line": 3}),
        ),
        (
            "balljoint a {\nfoo {\n { } balljoint b { }",
            ("F002.open", 2, {"word": b"foo"}),
        ),
        ("{ balljoint a { }", ("F002.open", 1, {"word": b"{"})),
    ],
)
def test_broken_file_is_refused_with_its_line(text, fault):
    assert refusal(text) == fault


def test_unusual_names_are_shown_on_one_line():
    text = b"balljoint \xff\x1b[31m\xe2\x80\xa8 {\n pose x 0 0 }"
    assert message(text) == ('pose of joint \ufffd\\x1b[31m\\u2028: expected a number, found "x"')


def test_long_names_and_words_are_truncated():
    text = f"balljoint {'n' * 5_000_000} {{ pose {'9x' * 2_500_000} 0 0 }}"
    assert message(text) == (f'pose of joint {"n" * 59}…: expected a number, found "{"9x" * 19}9…"')


@pytest.mark.parametrize("cut", range(len(GOOD.rstrip())))
def test_truncated_file_is_refused_or_loads_with_a_warning(cut):
    source = Source("a.skel", GOOD[:cut].encode())
    try:
        skel.read(source)
    except FormatError as problem:
        assert str(problem).startswith("a.skel")
    else:
        # Only the last brace may be missing without changing the contents.
        assert ("F006.closing", None, {}) in warnings_of(source.diagnostics)


# Large files


@pytest.mark.slow
def test_100_000_nested_joints_are_read():
    skeleton = silent("balljoint a{" * 100_000 + "}" * 100_000)
    assert skeleton.n_joints == 100_000
    assert skeleton.parents[[0, 1, -1]].tolist() == [-1, 0, 99_998]


@pytest.mark.slow
def test_100_000_unclosed_joints_are_refused_at_the_innermost():
    values = {"found": None, "joint": "joint a", "line": 100_000}
    assert refusal("balljoint a{\n" * 100_000) == ("F002.joint-open", 100_000, values)


def test_20_000_siblings_are_read():
    skeleton = silent("balljoint r{\n" + "balljoint a{}\n" * 20_000 + "}")
    assert skeleton.parents.tolist() == [-1] + [0] * 20_000


@pytest.mark.slow
def test_unknown_block_nested_a_million_deep_is_skipped():
    _, warnings = read("balljoint a { foo " + "{" * 1_000_000 + "}" * 1_000_000 + " }")
    assert warnings == [("F006.unknown", 1, {"found": b"foo"})]


def test_20_000_different_unknown_words_are_skipped():
    words = "\n".join(f"w{number}" for number in range(20_000))
    assert len(read(f"balljoint a {{ {words} }}")[1]) == 101


@pytest.mark.slow
@pytest.mark.parametrize("end", ["\n", "\r", "\r\n", "\r\r\n", " "])
def test_5_million_blank_lines_are_counted(end):
    text = end * 5_000_000 + "balljoint a { offset up }"
    line = 1 if end == " " else 5_000_001
    item = "offset of joint a"
    assert refusal(text) == ("F002.number", line, {"item": item, "found": b"up"})


def test_name_of_5_mb_is_read():
    assert silent(f"balljoint {'x' * 5_000_000} {{}}").names == ("x" * 5_000_000,)


@pytest.mark.slow
def test_refusal_needs_little_memory():
    text = b"balljoint a {\n" + b"offset 0 0 0\n" * 20_000 + b"pose up"
    tracemalloc.start()
    try:
        refusal(text)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 1_000_000
