"""Joint map files: round trips of names with any characters, and locations of invalid lines."""

import pytest

from viewer.errors import FormatError
from viewer.formats import Source
from viewer.formats._joint_map import joint_map_text, read_joint_map
from viewer.rig.retargeting.joint_map import JointMap


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
