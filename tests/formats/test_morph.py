"""The .morph reader: grammar, quirks, exact messages."""

import pytest

from viewer.errors import FormatError, UnsupportedFormatError
from viewer.formats import Source, detect, read, write
from viewer.rig.morph_target import MorphTarget

POSITIONS = "positions 2 {\n  3 0 1 2\n  7 .5 -1 1e1\n}\n"
NORMALS = "normals 2 {\n  3 0 0 1\n  7 0 1 0\n}\n"
GOOD = POSITIONS + NORMALS


def parse(text, path="smile.morph"):
    source = Source(path, text.encode())
    target = read(source)
    assert isinstance(target, MorphTarget)
    return target, source.warnings


def assert_good(target):
    assert target.name == "smile"
    assert target.vertices.tolist() == [3, 7]
    assert target.positions.tolist() == [[0, 1, 2], [0.5, -1, 10]]
    assert target.normals.tolist() == [[0, 0, 1], [0, 1, 0]]


@pytest.mark.parametrize(
    "text",
    [
        GOOD,
        GOOD.replace("\n", "\r\n"),
        GOOD.replace("\n", " "),
        GOOD.replace(" {\n", "{"),
        "\ufeff" + GOOD + "\n\n\t",
        NORMALS + POSITIONS,
        POSITIONS + "normals 2 { 7 0 1 0 3 0 0 1 }",
        "positions 2 { 7 .5 -1 1e1 3 0 1 2 }" + NORMALS,
    ],
    ids=["plain", "crlf", "one line", "glued", "mark", "swapped", "other order", "descending"],
)
def test_reads_every_part_without_a_word(text):
    target, warnings = parse(text)
    assert_good(target)
    assert warnings == []


def test_missing_last_brace_warns():
    target, warnings = parse(GOOD.rstrip("}\n"))
    assert_good(target)
    assert warnings == ['smile.morph: the last "}" is missing: normals ends with the file']


def test_missing_normals_warn():
    target, warnings = parse(POSITIONS)
    assert target.normals is None
    assert warnings == ["smile.morph: no normals section: normals stay as they are"]


def test_empty_target_warns():
    target, warnings = parse("positions 0 { } normals 0 { }")
    assert len(target.vertices) == 0 and warnings == ["smile.morph: moves no vertex"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (NORMALS, "smile.morph:4: no positions section"),
        ("", "smile.morph: expected a .morph file, found an empty file"),
        (
            GOOD.replace("-1", "up"),
            'smile.morph:3: positions: expected a number, found "up"',
        ),
        (
            GOOD.replace("-1", "nan"),
            'smile.morph:3: positions: expected a number, found "nan"',
        ),
        (
            GOOD.replace("7 .5", "7.5 .5"),
            'smile.morph:3: positions: expected a vertex index, found "7.5"',
        ),
        (
            GOOD.replace("7 .5", "-7 .5"),
            'smile.morph:3: positions: expected a vertex index, found "-7"',
        ),
        (
            GOOD.replace("7 .5", "3 .5"),
            'smile.morph:3: positions: vertex "3" is listed twice',
        ),
        (
            GOOD.replace("7 0 1 0", "8 0 1 0"),
            "smile.morph:5: normals: expected the vertices that positions has, "
            "found 8 instead of 7",
        ),
        (
            POSITIONS + "normals 1 { 3 0 0 1 }",
            "smile.morph:5: positions (line 1) has 2 vertices, normals (line 5) has 1",
        ),
        (
            GOOD.replace("positions 2", "positions 3"),
            "smile.morph:1: positions: expected 3 rows of 4 numbers, found 2 (to line 4)",
        ),
        (
            GOOD.replace("positions 2", "positions 2000000000"),
            "smile.morph:1: positions: expected a count that the file can hold, found 2000000000 "
            f"entries in {len(GOOD) - len('positions 2')} bytes",
        ),
        (
            GOOD.replace("positions 2", "positions -2"),
            'smile.morph:1: positions: expected a count, found "-2"',
        ),
        (
            GOOD.replace("  3 0 1 2\n", "  3 0 1\n"),
            "smile.morph:2: expected 4 numbers, found 3 (positions)",
        ),
        (
            GOOD + "triangles 1 { 0 1 2 }",
            'smile.morph:9: expected positions or normals, found "triangles"',
        ),
        (GOOD + POSITIONS, "smile.morph:9: expected one section of positions, found another"),
        (
            GOOD.replace("normals 2 {", "normals 2"),
            'smile.morph:6: normals: expected "{", found "3"',
        ),
        (
            POSITIONS + "normals 2 { 3 0 0 1",
            'smile.morph:5: expected "}" to close normals (line 5), found the end of the file '
            "after 1 of 2 rows",
        ),
        ("positions", "smile.morph:1: positions: expected a count, found the end of the file"),
    ],
)
def test_malformed_files_are_refused_with_their_line(text, message):
    with pytest.raises(FormatError) as caught:
        parse(text)
    assert str(caught.value) == message


def test_truncation_anywhere_is_an_error_or_a_warning():
    for length in range(len(GOOD.rstrip())):
        try:
            _, warnings = parse(GOOD[:length])
        except FormatError as problem:
            assert str(problem).startswith("smile.morph")
        else:
            assert warnings, GOOD[:length]


def test_morph_is_told_from_a_skin_by_its_suffix():
    assert detect(Source("smile.morph", GOOD.encode())) == "morph"
    assert detect(Source("smile.skin", GOOD.encode())) == "skin"


def test_morphs_are_not_written(tmp_path):
    target, _ = parse(GOOD)
    with pytest.raises(UnsupportedFormatError, match=r'no writer for "\.morph"'):
        write(target, tmp_path / "copy.morph")
