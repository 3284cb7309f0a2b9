"""Positions in JSON texts, counted by hand or determined by an independent parser."""

import json

import pytest

from viewer.errors import FormatError
from viewer.formats import Source
from viewer.formats._joint_map import joint_map_text, read_joint_map
from viewer.formats._text.json_places import (
    constant_place,
    decoded,
    deepest_place,
    repeated_key,
    unique,
    value_place,
)
from viewer.rigs.retargeting.joint_map import JointMap

TEXT = r'{"a": [1, {"b": "x,]}\"", "c": []}, -2e5], "": {}, "d\u00e9": {"a": null}, "e": true}'


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ((), TEXT),
        (("a",), r'[1, {"b": "x,]}\"", "c": []}, -2e5]'),
        (("a", 0), "1"),
        (("a", 1, "b"), r'"x,]}\""'),
        (("a", 1, "c"), "[]"),
        (("a", 2), "-2e5"),
        (("",), "{}"),
        (("dé", "a"), "null"),
        (("e",), "true"),
    ],
)
def test_value_is_found_by_its_path(path, value):
    place = value_place(TEXT, path)
    assert TEXT[place:].startswith(value)
    # Python's parser reads the same value if it starts at that position.
    found = json.loads(TEXT)
    for key in path:
        found = found[key]
    assert json.JSONDecoder().raw_decode(TEXT, place)[0] == found


@pytest.mark.parametrize("path", [("b",), ("a", 3), ("a", "0"), ("a", 1, "b", 0), (0,)])
def test_missing_value_has_no_position(path):
    assert value_place(TEXT, path) is None


def test_last_duplicate_key_is_used_and_the_second_is_reported():
    text = '{"a": 1, "b": {"a": 2}, "c": [{"a": 3}, {"a": 4}], "a": 5}'
    assert text[value_place(text, ("a",))] == "5"
    assert repeated_key(text) == ("a", text.rindex('"a"'))
    assert repeated_key('[{"a": 1}, {"a": 2}, {"b": {"a": 1}, "a": 2}]') is None
    assert repeated_key(r'{"a": 1, "\u0061": 2}') == ("a", 9)


def test_nan_and_infinity_are_found_outside_strings():
    text = '{"NaN": "a NaN", "b": [1, -Infinity, NaN]}'
    assert constant_place(text, "-Infinity") == 26
    assert constant_place(text, "NaN") == 37
    assert constant_place('{"NaN": "Infinity"}', "NaN") is None


def test_deepest_bracket_is_found():
    assert deepest_place('["[[", [[1]]]') == 8
    assert deepest_place("[{}, {}, [[") == 10


class RefusedError(Exception):
    def __init__(self, key, offset, **values):
        super().__init__(key, offset, values)


@pytest.mark.parametrize(
    ("text", "key", "offset"),
    [
        ('{"a": é}', "F002.json", 6),
        ("[" * 100_000, "F002.json-nesting", 99_999),
        ('{"b": {"a": 1, "a": 2}}', "F002.json-twice", 15),
        ("[1, " + "9" * 5000 + "]", "F002.capture-digits", 4),
    ],
)
def test_texts_that_cannot_be_decoded_are_refused_at_an_offset(text, key, offset):
    decoder = json.JSONDecoder(object_pairs_hook=unique)
    with pytest.raises(RefusedError) as caught:
        decoded(text, RefusedError, decoder.decode)
    message, found, _ = caught.value.args
    assert (message.partition(":")[0], found) == (key, offset)
    assert decoded('{"a": 1, "a": [2]}', RefusedError) == {"a": [2]}


def read(text):
    return read_joint_map(Source("map.txt", data=text.encode("utf-8", "surrogateescape")))


def test_every_name_is_read_as_it_was_written():
    names = [
        *("a", "knee#5", "#5", "Bip01 L Thigh", "x = y", 'say "hi"', "tail #1", " lead", "trail "),
        *("tab\tx", "line\nx", "é", "\udcff", "mixamorig:Hips", "a  b", "\\", "a\u2028b", "\u00a0"),
    ]
    pairs = (*zip(names, reversed(names), strict=True), ("rest", ""))
    assert read(joint_map_text(JointMap(pairs), ("walk", "fox"))).pairs == pairs


def test_comments_blank_lines_and_joints_at_rest_are_read():
    found = read("# figure = motion\r\n\r\nhip=Hips # root\r\n  tail = # rest\r\n leg#2 = a#1\r\n")
    assert found.pairs == (("hip", "Hips"), ("tail", ""), ("leg#2", "a#1"))
    assert found.lines == (3, 4, 5)


@pytest.mark.parametrize(
    "line", ["hip", "= Hips", "a = b = c", 'a "b" = c', '"a = b', '"" = b', r'"\x" = b']
)
def test_invalid_line_is_reported_with_its_location(line):
    with pytest.raises(FormatError) as caught:
        read(f"hip = Hips\n{line}\n")
    found = caught.value.diagnostic
    assert (found.key, found.line, found.values) == ("F002.joint-map", 2, {"found": line})


def test_long_lines_are_refused_immediately():
    with pytest.raises(FormatError) as caught:
        read("hip = Hips\n" + "a" + 1_000_000 * " " + "b")
    assert caught.value.diagnostic.line == 2


def test_map_without_joints_is_refused():
    with pytest.raises(FormatError) as caught:
        read("# nothing\n")
    assert caught.value.diagnostic.key == "F002.joint-map-empty"
