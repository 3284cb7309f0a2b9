"""All quirks of ``.skel``, each in a tiny file."""

import tracemalloc

import numpy as np
import pytest
from faults import warnings_of
from formats.skel_text import GOOD, INF, assert_good, read, refusal, silent

from viewer.errors import FormatError
from viewer.formats import Source, skel
from viewer.rigs.pose import rest_pose

NEAR = {"pos": "pose", "joint": "balljoint", "limits": "rotxlimit", "Offset": "offset"}


def unknown(line, word):
    hint = f'"{word}" (did you mean {NEAR.get(word)}?)'
    return "F006.unknown", line, {"found": hint if word in NEAR else word.encode()}


def test_all_values_of_a_valid_file_are_read():
    assert_good(silent(GOOD))


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(GOOD.replace("\n", "\r\n"), id="CRLF"),
        pytest.param(GOOD.replace("\n", "\r"), id="CR"),
        pytest.param(GOOD.replace("\n", "\r\r\n"), id="CR CR LF"),
        pytest.param(GOOD.replace("\n", "\r", 5).replace("\n", "\r\r\n"), id="CR and CR CR LF"),
        pytest.param(" ".join(GOOD.split()), id="one line"),
        pytest.param("\n".join(GOOD.split()), id="a word a line"),
        pytest.param(GOOD.replace(" {", "{").replace("}", "}"), id="glued braces"),
        pytest.param("".join(GOOD.split("\n")).replace(" {", "{"), id="all glued"),
        pytest.param(GOOD.rstrip(), id="no final newline"),
        pytest.param(GOOD + "\n \t\n\n", id="blank lines at the end"),
        pytest.param("\n\n\t" + GOOD, id="blank lines at the start"),
        pytest.param(GOOD.replace(" ", "\t\v\f"), id="tabs"),
        pytest.param("\ufeff" + GOOD, id="byte order mark"),
        pytest.param(GOOD + "\x1a", id="Ctrl-Z"),
        pytest.param(GOOD.replace("0.5", ".5").replace(" 0.25", " +2.5e-1"), id="spellings"),
        pytest.param(GOOD.replace("1 2 3", "1. 2.0f 3F"), id="trailing f"),
    ],
)
def test_white_space_and_number_notation_may_vary(text):
    assert_good(silent(text))


def test_items_may_be_in_any_order_and_between_joints():
    skeleton = silent(
        "balljoint root { balljoint arm { offset 0 1 0 } pose 0.5 0.25 7 boxmax 0.5 0.25 1 "
        "rotzlimit -100000 100000 rotylimit 0 0.5 offset 1 2 3 boxmin -0.5 -0.25 -1 "
        "rotxlimit -1 1 }"
    )
    assert_good(skeleton)


def test_last_of_repeated_items_is_used():
    skeleton = silent(
        "balljoint a { offset 1 1 1 pose 1 1 1 rotxlimit 0 1 boxmin 0 0 0 boxmax 5 5 5 "
        "offset 2 3 4 pose 5 6 7 rotxlimit -9 9 boxmin -1 -2 -3 boxmax 1 2 3 }"
    )
    assert skeleton.rest_translations.tolist() == [[2, 3, 4]]
    assert skeleton.rest_dofs[3:].tolist() == [5, 6, 7]
    assert skeleton.dof_limits[3].tolist() == [-9, 9]
    assert skeleton.boxes.tolist() == [[[-1, -2, -3], [1, 2, 3]]]


def test_empty_joint_has_the_defaults():
    skeleton = silent("balljoint a {}")
    assert skeleton.rest_translations.tolist() == [[0, 0, 0]]
    assert skeleton.boxes.tolist() == [[[-0.1] * 3, [0.1] * 3]]
    assert skeleton.rest_dofs.tolist() == [0] * 6
    assert skeleton.dof_limits.tolist() == [[-INF, INF]] * 6


@pytest.mark.parametrize(
    ("head", "name"),
    [
        ("balljoint{", ""),
        ("balljoint  {", ""),
        ("balljoint left upper leg {", "left upper leg"),
        ("balljoint left\r\n\tleg{", "left leg"),
        ("balljoint 3 {", "3"),
        ("balljoint pos {", "pos"),
        ("balljoint J\u00e9r\u00f4me {", "J\u00e9r\u00f4me"),
        ("balljoint a\u00a0b {", "a\u00a0b"),
        ("balljoint %s {", "%s"),
        ('balljoint "quoted" {', '"quoted"'),
    ],
)
def test_name_consists_of_all_words_up_to_the_brace(head, name):
    assert silent(head + "}").names == (name,)


def test_name_in_latin_1_is_preserved_byte_by_byte():
    skeleton = silent(b"balljoint \xe9t\xe9 {}")
    assert skeleton.names[0].encode("utf-8", "surrogateescape") == b"\xe9t\xe9"


def test_joints_are_numbered_in_file_order_even_with_equal_names():
    skeleton = silent(
        "balljoint a{ balljoint a{ balljoint {} } balljoint a{} balljoint {balljoint b{}} }"
    )
    assert skeleton.names == ("a", "a", "", "a", "", "b")
    assert skeleton.parents.tolist() == [-1, 0, 1, 0, 0, 4]


def test_several_roots_are_read():
    skeleton = silent("balljoint a { balljoint b {} } balljoint c { balljoint d {} }")
    assert skeleton.parents.tolist() == [-1, 0, -1, 2]
    assert skeleton.dof_joints.tolist() == [0] * 6 + [1] * 3 + [2] * 3 + [3] * 3


def test_corners_of_boxes_are_sorted_per_axis():
    skeleton = silent("balljoint a { boxmin 1 -2 3 boxmax -1 2 -3 }")
    assert skeleton.boxes.tolist() == [[[-1, -2, -3], [1, 2, 3]]]


def test_boxes_may_be_flat():
    skeleton = silent("balljoint a { boxmin 0 0 1 boxmax 2 0 1 }")
    assert skeleton.boxes.tolist() == [[[0, 0, 1], [2, 0, 1]]]


def test_box_with_one_corner_gets_the_other_by_default():
    assert silent("balljoint a { boxmin -2 -2 -2 }").boxes.tolist() == [[[-2] * 3, [0.1] * 3]]


# Limits


def test_pose_is_clamped_after_the_whole_joint_is_read():
    # The order is that of knee_r in test.skel, then with the pose before its limits as in
    # horse.skel.
    after = "rotxlimit -2 0 rotylimit 0 0 rotzlimit 0 0 pose -3 1 2"
    before = "pose -3 1 2 rotxlimit -2 0 rotylimit 0 0 rotzlimit 0 0"
    for items in (after, before):
        skeleton = silent(f"balljoint a {{ {items} }}")
        assert skeleton.rest_dofs[3:].tolist() == [-2, 0, 0]
        assert rest_pose(skeleton).dofs[3:].tolist() == [-2, 0, 0]


def test_equal_limits_lock_a_dof():
    skeleton = silent("balljoint a { rotxlimit -0.11 -0.11 rotylimit 0 0 }")
    assert skeleton.locked.tolist() == [False, False, False, True, True, False]
    assert skeleton.rest_dofs[3:].tolist() == [-0.11, 0, 0]


def test_limits_may_exclude_zero():
    skeleton = silent("balljoint a { rotxlimit -3 -2 rotylimit 1 2 }")
    assert skeleton.rest_dofs[3:].tolist() == [-2, 1, 0]


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("-100000 100000", [-INF, INF]),
        ("-1e5 1", [-INF, 1]),
        ("0 100000", [0, INF]),
        ("-200000 3e38", [-INF, INF]),
        ("-99999 99999", [-99999, 99999]),
        ("100000 100000", [100000, INF]),
    ],
)
def test_limits_of_100000_are_read_as_unlimited(written, meant):
    assert silent(f"balljoint a {{ rotylimit {written} }}").dof_limits[4].tolist() == meant


def test_minimum_above_maximum_is_ignored_with_a_warning():
    skeleton, warnings = read(
        "balljoint a {}\nballjoint b {\nrotylimit 2 -1\nrotxlimit 5 4\npose 9 9 9\n}"
    )
    assert skeleton.dof_limits[6:].tolist() == [[-INF, INF]] * 3
    assert skeleton.rest_dofs[6:].tolist() == [9, 9, 9]
    joint = "joint b"
    values = {"n": 2, "axis": "x", "low": 5.0, "high": 4.0, "joint": joint}
    assert warnings == [("S003.ignored", 4, values)]


# Unknown content


@pytest.mark.parametrize(
    ("item", "words"),
    [
        ("pos 0 0 1.57", ["pos"]),
        ("orient 1 0 0 0 1 0 0 0 1", ["orient"]),
        ("joint end { }", ["joint"]),
        ("joint { }", ["joint"]),
        ("joint{}", ["joint"]),
        ("joint end { offset 1 2 3 joint { pose 9 9 9 } balljoint b { } }", ["joint"]),
        ("limits { x { 1 2 } y { 3 4 } }", ["limits"]),
        ("colour red", ["colour"]),
        ("colour 1 red 2", ["colour"]),
        ("colour\nred", ["colour", "red"]),
        ("{ offset 9 9 9 }", ["{"]),
        ("flag", ["flag"]),
        ("scale 2 { 3 }", ["scale"]),
    ],
)
@pytest.mark.parametrize("place", ["before", "between", "after"])
def test_unknown_item_is_skipped_completely(item, words, place):
    known = ["offset 1 2 3", "balljoint arm { offset 0 1 0 }"]
    known.insert({"before": 0, "between": 1, "after": 2}[place], f"\n{item}\n")
    skeleton, warnings = read(f"balljoint root {{ {' '.join(known)} }}")
    assert skeleton.names == ("root", "arm")
    assert skeleton.parents.tolist() == [-1, 0]
    assert skeleton.rest_translations.tolist() == [[1, 2, 3], [0, 1, 0]]
    assert warnings == [unknown(line, word) for line, word in enumerate(words, 2)]


def test_stray_numbers_are_skipped():
    skeleton, warnings = read("balljoint a {\n5 6 7\noffset 1 2 3 balljoint b { }\n8 9 }")
    assert skeleton.rest_translations.tolist() == [[1, 2, 3], [0, 0, 0]]
    assert warnings == [unknown(2, "5"), unknown(4, "8")]


@pytest.mark.parametrize("text", ["version 1.0 {} ", "header { name { balljoint x { } } } ", "v "])
def test_unknown_words_outside_of_all_joints_are_skipped(text):
    skeleton, warnings = read(f"{text} balljoint a {{ }} {text}")
    assert skeleton.names == ("a",)
    assert warnings == [unknown(1, text.split()[0])]


def test_unknown_keyword_is_reported_once_with_its_first_line():
    _, warnings = read("balljoint a {\npos 1\nfoo 2\npos 3\nballjoint b { pos 4 }\nfoo { }\n}")
    assert warnings == [unknown(2, "pos"), unknown(3, "foo")]


def test_warnings_of_a_file_are_limited_to_100():
    _, warnings = read(f"balljoint a {{ {chr(10).join(f'w{number}' for number in range(500))} }}")
    assert len(warnings) == 101
    assert warnings[99] == unknown(100, "w99")
    assert warnings[100] == ("F007.further-warnings", None, {})


def test_keywords_must_be_lower_case():
    _, warnings = read("balljoint a { Offset 1 2 3 }")
    assert warnings == [unknown(1, "Offset")]


def test_missing_brace_at_the_end_is_a_warning():
    skeleton, warnings = read(GOOD.rstrip().removesuffix("}"))
    assert_good(skeleton)
    assert warnings == [("F006.closing", None, {})]


def test_extra_braces_after_the_root_are_a_warning():
    skeleton, warnings = read(GOOD + "}\n}")
    assert_good(skeleton)
    assert warnings == [("F006.extra-braces", None, {"n": 2})]


def test_arrays_of_a_loaded_skeleton_are_read_only():
    assert not silent(GOOD).rest_translations.flags.writeable


def test_real_robot_has_six_joints(shared):
    skeleton, warnings = read((shared / "test.skel").read_bytes())
    assert warnings == []
    assert skeleton.names == ("root", "head", "hip_l", "knee_l", "hip_r", "knee_r")
    assert skeleton.parents.tolist() == [-1, 0, 0, 2, 0, 4]
    assert np.count_nonzero(skeleton.locked) == 2


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
        ("\nballjoint a b\n", ("F002.opening", 2, {"item": "joint a b", "found": None})),
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
            ("F002.number", 3, {"item": "offset of joint a", "found": b"up"}),
        ),
        (
            "balljoint a {\r\n\r\n offset 1 nan 3 }",
            ("F003.number", 3, {"item": "offset of joint a", "found": b"nan"}),
        ),
        (
            "balljoint a {\r\r\noffset 1\r\r\ninf 3 }",
            ("F003.number", 3, {"item": "offset of joint a", "found": b"inf"}),
        ),
        (
            "balljoint a {\r\rpose 1e999 0 0 }",
            ("F003.too-large", 3, {"item": "pose of joint a", "found": b"1e999"}),
        ),
        (
            "balljoint a { rotxlimit 0 3.5e38 }",
            ("F003.too-large", 1, {"item": "rotxlimit of joint a", "found": b"3.5e38"}),
        ),
        (
            "balljoint a { rotylimit 0 1,5 }",
            ("F002.number", 1, {"item": "rotylimit of joint a", "found": b"1,5"}),
        ),
        (
            "balljoint a { rotzlimit 0 1_000 }",
            ("F002.number", 1, {"item": "rotzlimit of joint a", "found": b"1_000"}),
        ),
        (
            "balljoint a { boxmin 1.0-2.0 3 4 }",
            ("F002.number", 1, {"item": "boxmin of joint a", "found": b"1.0-2.0"}),
        ),
        (
            "balljoint a { boxmax 1 2 \u0663 }",
            ("F002.number", 1, {"item": "boxmax of joint a", "found": b"\xd9\xa3"}),
        ),
        (
            "balljoint a { offset 1 2\0 3 }",
            ("F002.number", 1, {"item": "offset of joint a", "found": b"2\x00"}),
        ),
        (
            "balljoint a {\noffset 1 2\n}",
            ("F002.width", 2, {"item": "offset of joint a", "expected": 3, "found": 2}),
        ),
        (
            "balljoint {\npose\nballjoint b {}",
            ("F002.width", 2, {"item": "pose of unnamed joint", "expected": 3, "found": 0}),
        ),
        (
            "balljoint a {\noffset 1 2",
            ("F002.width-end", 2, {"item": "offset of joint a", "expected": 3, "found": 2}),
        ),
        (
            "balljoint a { rotxlimit 1\n2 3 }",
            ("F002.more", 2, {"item": "rotxlimit of joint a", "expected": 2, "found": b"3"}),
        ),
        (
            "balljoint a {\n balljoint b {\n offset 1 2 3\n\n",
            ("F002.joint-open", 3, {"found": None, "joint": "joint b", "line": 2}),
        ),
        (
            "balljoint a {\n balljoint b { }\n balljoint {\n",
            ("F002.joint-open", 3, {"found": None, "joint": "unnamed joint", "line": 3}),
        ),
        ("balljoint a {\nfoo {\n { } balljoint b { }", ("F002.open", 2, {"word": b"foo"})),
        ("{ balljoint a { }", ("F002.open", 1, {"word": b"{"})),
    ],
)
def test_broken_file_is_refused_with_its_line(text, fault):
    assert refusal(text) == fault


def test_unusual_names_are_shown_on_one_line():
    text = b"balljoint \xff\x1b[31m\xe2\x80\xa8 {\n pose x 0 0 }"
    assert message(text) == ('pose of joint \ufffd\\x1b[31m\\u2028: expected a number, found "x"')


def test_long_names_and_words_are_truncated():
    text = f"balljoint {'n' * 200_000} {{ pose {'9x' * 100_000} 0 0 }}"
    assert message(text) == (f'pose of joint {"n" * 59}…: expected a number, found "{"9x" * 19}9…"')


def test_truncated_file_is_refused_or_loads_with_a_warning():
    for cut in range(len(GOOD.rstrip())):
        source = Source("a.skel", GOOD[:cut].encode())
        try:
            skel.read(source)
        except FormatError as problem:
            assert str(problem).startswith("a.skel"), cut
        else:
            # Only the last brace may be missing without changing the contents.
            assert ("F006.closing", None, {}) in warnings_of(source.diagnostics), cut


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
def test_2_million_blank_lines_are_counted(end):
    text = end * 2_000_000 + "balljoint a { offset up }"
    line = 1 if end == " " else 2_000_001
    item = "offset of joint a"
    assert refusal(text) == ("F002.number", line, {"item": item, "found": b"up"})


def test_name_of_2_mb_is_read():
    assert silent(f"balljoint {'x' * 2_000_000} {{}}").names == ("x" * 2_000_000,)


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
