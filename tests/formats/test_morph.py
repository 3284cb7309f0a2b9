"""The .morph reader: grammar, quirks, and messages."""

import pytest
from faults import refusal_of, warnings_of

from viewer.errors import FormatError, UnsupportedFormatError
from viewer.formats import Source, detect, read, write
from viewer.rigs.morph_target import MorphTarget

POSITIONS = "positions 2 {\n  3 0 1 2\n  7 .5 -1 1e1\n}\n"
NORMALS = "normals 2 {\n  3 0 0 1\n  7 0 1 0\n}\n"
GOOD = POSITIONS + NORMALS


def parse(text, path="smile.morph"):
    source = Source(path, text.encode())
    target = read(source)
    assert isinstance(target, MorphTarget)
    return target, warnings_of(source.diagnostics)


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
def test_all_values_are_read_without_warnings(text):
    target, warnings = parse(text)
    assert_good(target)
    assert warnings == []


def test_missing_last_brace_is_reported_as_a_warning():
    target, warnings = parse(GOOD.rstrip("}\n"))
    assert_good(target)
    assert warnings == [("F006.last-brace", None, {"section": "normals"})]


def test_missing_normals_are_reported_as_a_warning():
    target, warnings = parse(POSITIONS)
    assert target.normals is None
    assert warnings == [("F007.morph-normals", None, {})]


def test_empty_target_is_reported_as_a_warning():
    target, warnings = parse("positions 0 { } normals 0 { }")
    assert len(target.vertices) == 0 and warnings == [("F007.morph-empty", None, {})]


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (NORMALS, ("F002.morph-positions", 4, {"looks": None})),
        ("", ("F002.kind", None, {"wanted": ".morph", "looks": "an empty file"})),
        (
            GOOD.replace("-1", "up"),
            ("F002.number", 3, {"item": "positions, entry 1", "found": b"up"}),
        ),
        (
            GOOD.replace("-1", "nan"),
            ("F003.number", 3, {"item": "positions, entry 1", "found": b"nan"}),
        ),
        (
            GOOD.replace("7 .5", "7.5 .5"),
            ("F002.morph-index", 3, {"section": "positions", "found": 7.5}),
        ),
        (
            GOOD.replace("7 .5", "-7 .5"),
            ("F002.morph-index", 3, {"section": "positions", "found": -7.0}),
        ),
        (
            GOOD.replace("7 .5", "3 .5"),
            ("F002.morph-twice", 3, {"section": "positions", "vertex": 3}),
        ),
        (
            GOOD.replace("7 0 1 0", "8 0 1 0"),
            ("F002.morph-vertices", 5, {"found": 8, "expected": 7}),
        ),
        (
            POSITIONS + "normals 1 { 3 0 0 1 }",
            ("F002.morph-counts", 5, {"line": 1, "first": 2, "other": 5, "second": 1}),
        ),
        (
            GOOD.replace("positions 2", "positions 3"),
            ("F002.skin-declared", 1, {"section": "positions", "expected": 3, "found": 2}),
        ),
        (
            GOOD.replace("positions 2", "positions 2000000000"),
            ("F002.skin-too-many", 1, {"section": "positions", "found": 2000000000, "size": 63}),
        ),
        (
            GOOD.replace("positions 2", "positions -2"),
            ("F002.count", 1, {"item": "positions", "found": b"-2"}),
        ),
        (
            GOOD.replace("  3 0 1 2\n", "  3 0 1\n"),
            ("F002.width", 2, {"item": "positions, entry 0", "expected": 4, "found": 3}),
        ),
        (GOOD + "triangles 1 { 0 1 2 }", ("F002.morph-section", 9, {"found": b"triangles"})),
        (GOOD + POSITIONS, ("F002.morph-repeated", 9, {"section": "positions"})),
        (
            GOOD.replace("normals 2 {", "normals 2"),
            ("F002.skin-brace", 6, {"section": "normals", "found": b"3"}),
        ),
        (
            POSITIONS + "normals 2 { 3 0 0 1",
            ("F002.skin-rows-end", 5, {"section": "normals", "line": 5, "found": 1, "expected": 2}),
        ),
        ("positions", ("F002.count", 1, {"item": "positions", "found": None})),
    ],
)
def test_malformed_files_are_refused_with_their_line(text, fault):
    assert refusal_of(lambda: parse(text)) == fault


def test_truncation_anywhere_is_an_error_or_a_warning():
    for length in range(len(GOOD.rstrip())):
        try:
            _, warnings = parse(GOOD[:length])
        except FormatError as problem:
            assert str(problem).startswith("smile.morph")
        else:
            assert warnings, GOOD[:length]


def test_morph_is_distinguished_from_a_skin_by_its_suffix():
    assert detect(Source("smile.morph", GOOD.encode())) == "morph"
    assert detect(Source("smile.skin", GOOD.encode())) == "skin"


def test_writing_of_morphs_is_refused(tmp_path):
    target, _ = parse(GOOD)
    with pytest.raises(UnsupportedFormatError, match=r'no writer for "\.morph"') as caught:
        write(target, tmp_path / "copy.morph")
    assert caught.value.diagnostic.key == "F002.no-writer"
