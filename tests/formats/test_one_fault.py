"""Readers that continue after errors, with one error of each kind, its location and its effect."""

from typing import Any

import pytest
from formats.broken_text import ANIM, OBJ, PLY, gone_on
from formats.bvh_text import GOOD as BVH
from formats.skel_text import GOOD as SKEL
from formats.skin_text import BINDINGS
from formats.skin_text import GOOD as SKIN

from viewer.errors import ViewerError
from viewer.formats import Source, anim, bvh, obj, ply, skel, skin

FILES = {
    "a.skin": (skin, SKIN),
    "a.obj": (obj, OBJ),
    "a.ply": (ply, PLY),
    "a.skel": (skel, SKEL),
    "a.bvh": (bvh, BVH),
    "a.anim": (anim, ANIM),
}

# Of each file: the text that is replaced, the faulty one, the key, line and values of the report,
# the part of the figure, and the places in it.
FAULTS: dict[str, list[tuple[str, str, str, int | None, dict[str, Any], str, list[int]]]] = {
    "a.skin": [
        (
            "2 0 0",
            "2 nan 0",
            "F003.number",
            3,
            {"item": "positions of vertex 1", "found": b"nan"},
            "positions",
            [1],
        ),
        (
            "2 0 0",
            "2 0,5 0",
            "F002.number",
            3,
            {"item": "positions of vertex 1", "found": b"0,5"},
            "positions",
            [1],
        ),
        (
            "2 0 0",
            "2 0",
            "F002.width",
            3,
            {"item": "positions of vertex 1", "expected": 3, "found": 2},
            "positions",
            [1],
        ),
        (
            "positions 3",
            "positions 4",
            "F002.skin-declared",
            1,
            {"section": "positions", "expected": 4, "found": 3},
            "",
            [],
        ),
        (
            "  2 0 0\n",
            "",
            "F002.skin-entries",
            1,
            {"section": "positions", "expected": 3, "other": "normals", "found": 2},
            "positions",
            [0, 1, 2],
        ),
        (
            "normals 3 {\n  0 0 1\n",
            "normals 2 {\n",
            "F002.skin-entries",
            6,
            {"section": "normals", "expected": 3, "other": "positions", "found": 2},
            "",
            [],
        ),
        (
            "1 0 1.0",
            "1 0 nan",
            "W003.number",
            12,
            {"item": "skinweights of vertex 0", "found": b"nan"},
            "weights",
            [0],
        ),
        (
            "1 1 1\n}",
            "1 2 1\n}",
            "W010.skin-joint",
            14,
            {"vertex": 2, "limit": 2, "found": 2},
            "weights",
            [2],
        ),
        (
            "1 1 1\n}",
            "1 0.5 1\n}",
            "F002.skin-joint",
            14,
            {"vertex": 2, "found": b"0.5"},
            "weights",
            [2],
        ),
        (
            "1 1 1\n}",
            "2 1 1\n}",
            "F002.skin-influences",
            14,
            {"vertex": 2, "pairs": b"2", "found": 2},
            "weights",
            [2],
        ),
        (
            "  1 1 1\n}",
            "}",
            "F002.skin-entries",
            11,
            {"section": "skinweights", "expected": 3, "other": "positions", "found": 2},
            "weights",
            [2],
        ),
        (
            "0 1 2\n}",
            "0 1 7\n}",
            "F002.skin-corner-range",
            17,
            {"triangle": 0, "limit": 3, "found": 7},
            "triangles",
            [0],
        ),
        (
            "0 1 2\n}",
            "0 1 1.5\n}",
            "F002.skin-corner",
            17,
            {"triangle": 0, "found": 1.5},
            "triangles",
            [0],
        ),
        (
            "0 1 2\n}",
            "0 inf 2\n}",
            "F003.number",
            17,
            {"item": "triangle 0", "found": b"inf"},
            "triangles",
            [0],
        ),
        (
            "0 1 0\n  0 0 1\n  5",
            "0 0 0\n  0 0 1\n  5",
            "B002.skin-matrix",
            20,
            {"matrix": 0, "determinant": 0.0},
            "bindings",
            [0],
        ),
        (
            "0 1 0\n  0 0 1\n  8",
            "0 -1.#IND 0\n  0 0 1\n  8",
            "F003.number",
            28,
            {"item": "bindings matrix 1", "found": b"-1.#IND"},
            "bindings",
            [1],
        ),
        (
            "8 9 10",
            "8 9",
            "F002.width",
            26,
            {"item": "bindings matrix 1", "expected": 12, "found": 11},
            "bindings",
            [1],
        ),
        (
            BINDINGS,
            "",
            "B001.skin-section",
            11,
            {"missing": "bindings", "present": "skinweights"},
            "bindings",
            [0, 1],
        ),
        (
            "bindings 2",
            "bindings 3",
            "B001.skin-count",
            19,
            {"line": 32, "expected": 3, "found": 2, "then": b"}"},
            "",
            [],
        ),
    ],
    "a.obj": [
        (
            "v 1 0 0",
            "v 1 nan 0",
            "F003.number",
            2,
            {"item": "v of vertex 1", "found": b"nan"},
            "positions",
            [1],
        ),
        (
            "v 1 0 0",
            "v 1 0",
            "F002.width",
            2,
            {"item": "v of vertex 1", "expected": 3, "found": 2},
            "positions",
            [1],
        ),
        ("vn 0 0 1", "vn 0 inf 1", "F003.number", 5, {"item": "vn 0", "found": b"inf"}, "", [0]),
        ("2//1 3", "9//1 3", "F002.obj-v-range", 6, {"limit": 4, "found": 9}, "triangles", [0, 1]),
        ("f 1 2 3", "f 1 2 0", "F002.obj-zero", 7, {}, "triangles", [2]),
        ("f 1 2 3", "f 1 2 -5", "F002.obj-v-back", 7, {"least": -4, "found": -5}, "triangles", [2]),
        ("f 1 2 3", "f 1 x 3", "F002.obj-corner", 7, {"found": b"x"}, "triangles", [2]),
        ("f 1 2 3", "f", "F002.obj-face", 7, {"least": 3, "found": 0}, "", []),
    ],
    "a.ply": [
        (
            "1 0 0",
            "1 nan 0",
            "F003.number",
            11,
            {"item": "vertex 1", "found": b"nan"},
            "positions",
            [1],
        ),
        (
            "3 0 2 3",
            "3 0 2 9",
            "F002.ply-corner",
            15,
            {"face": 1, "last": 3, "found": 9.0},
            "triangles",
            [1],
        ),
    ],
    "a.skel": [
        (
            "offset 0 1 0",
            "offset 0 nan 0",
            "F003.number",
            10,
            {"item": "offset of joint arm", "found": b"nan"},
            "joints",
            [1],
        ),
        (
            "offset 0 1 0",
            "offset 0 1",
            "F002.width",
            10,
            {"item": "offset of joint arm", "expected": 3, "found": 2},
            "joints",
            [1],
        ),
        (
            "pose 0.5",
            "pose up",
            "F002.number",
            8,
            {"item": "pose of joint root", "found": b"up"},
            "items",
            [0],
        ),
    ],
    "a.bvh": [
        (
            "0.1 0.0 0.0",
            "0.1 nan 0.0",
            "F003.number",
            8,
            {"item": "OFFSET of joint LeftUpLeg", "found": b"nan"},
            "joints",
            [1],
        )
    ],
    "a.anim": [
        (
            "0.5 1",
            "0.5 nan",
            "F003.number",
            6,
            {
                "where": "channel 0, key 1",
                "found": b"nan",
                "begins": None,
                "item": "channel 0, key 1: value",
            },
            "channels",
            [0],
        ),
        (
            "keys 3",
            "keys 4",
            "F002.anim-keys",
            4,
            {"where": "channel 0", "found": 3, "begins": None, "expected": 4},
            "channels",
            [0],
        ),
        (
            "channels 1",
            "channels 2",
            "F002.anim-channels",
            3,
            {"where": "animation", "found": 1, "begins": None, "expected": 2},
            "",
            [],
        ),
    ],
}
CASES = [(name, *case) for name, cases in FAULTS.items() for case in cases]


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case[0]}, {case[2]!r}"[:40])
def test_each_error_is_reported_with_its_location(case):
    name, old, new, *fault, part, places = case
    module, text = FILES[name]
    assert old in text
    broken = text.replace(old, new, 1)
    assert gone_on(module, broken, name)[1] == [(tuple(fault), 1, part, places)]
    with pytest.raises(ViewerError):  # without collecting errors, the reader refuses the file
        module.read(Source(name, broken.encode()))


@pytest.mark.parametrize("name", FILES)
def test_valid_files_have_no_errors(name):
    module, text = FILES[name]
    assert gone_on(module, text, name)[1] == []
