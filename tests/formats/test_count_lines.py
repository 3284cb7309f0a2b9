"""Wrong counts, which are refused at the line of the count with both values."""

import pytest
from faults import refusal_of
from formats.bvh_text import GOOD as BVH
from formats.skin_text import GOOD as SKIN

from viewer.formats import Source, read

ANIM = """animation {
 range 0 1
 numchannels 1
 channel {
  extrapolate constant constant
  keys 2 {
   0 0.5 flat flat
   1 1.5 flat flat
  }
 }
}
"""
MORPH = "positions 2 {\n 0 1 2 3\n 4 0 0 1\n}\nnormals 2 {\n 0 0 0 1\n 4 0 1 0\n}\n"
RIG = "rig a {\n skeleton a.skel\n morphs\n 2\n {\n x.morph\n y.morph\n }\n}\n"
PLY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 2
"""
FILES = {
    "a.skin": SKIN, "a.anim": ANIM, "a.morph": MORPH, "a.rig": RIG, "a.bvh": BVH, "a.ply": PLY,
}  # fmt: skip


def refusal(name, text):
    return refusal_of(lambda: read(Source(name, text.encode())))


# For each wrong count: the file, the text before the count, the count, and the actual number.
COUNTS = [
    ("a.skin", "positions ", 3),
    ("a.skin", "normals ", 3),
    ("a.skin", "skinweights ", 3),
    ("a.skin", "triangles ", 1),
    ("a.skin", "bindings ", 2),
    ("a.anim", "numchannels ", 1),
    ("a.anim", "keys ", 2),
    ("a.morph", "positions ", 2),
    ("a.morph", "normals ", 2),
    ("a.rig", "morphs\n ", 2),
    ("a.bvh", "CHANNELS ", 6),
]


@pytest.mark.parametrize("step", [-1, 1])
@pytest.mark.parametrize(("name", "head", "count"), COUNTS)
def test_wrong_count_is_refused_at_its_line(name, head, count, step):
    text = FILES[name]
    assert f"{head}{count}" in text
    before, _, after = text.partition(f"{head}{count}")
    _, line, values = refusal(name, f"{before}{head}{count + step}{after}")
    assert line == 1 + f"{before}{head}".count("\n")
    assert (values["expected"], values["found"]) == (count + step, count)


@pytest.mark.parametrize(("element", "count", "line"), [("vertex", 3, 3), ("face", 1, 7)])
def test_too_many_rows_of_a_table_are_refused_at_its_element(element, count, line):
    fault = refusal("a.ply", PLY.replace(f"{element} {count}", f"{element} {count + 9}"))
    found = {"element": element, "expected": count + 9, "found": 1 if element == "face" else 4}
    assert fault == ("F002.ply-lines", line, found)


@pytest.mark.parametrize(("stated", "line"), [("1 0 0.25 1 0.75", 13), ("3 0 0.25 1 0.75", 13)])
def test_vertex_with_a_wrong_number_of_influences_is_refused_at_its_line(stated, line):
    """The wrong count makes the counts of all later vertices appear shifted."""
    fault = refusal("a.skin", SKIN.replace("2 0 0.25 1 0.75", stated))
    values = {"vertex": 1, "pairs": stated[:1].encode(), "found": 4}
    assert fault == ("F002.skin-influences", line, values)


def test_counts_in_a_file_of_one_line_are_used():
    text = " ".join(SKIN.replace("1 1 1\n}", "2 1 1\n}").split())
    key, _, values = refusal("a.skin", text)
    assert key == "F002.skin-influences-end"
    assert (values["vertex"], values["pairs"]) == (2, b"2")
