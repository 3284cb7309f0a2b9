"""Readers that continue after faults: one fault of each kind, with its place and effect."""

from __future__ import annotations

from typing import Any

import pytest
from broken_text import ANIM, OBJ, PLY, gone_on
from bvh_text import GOOD as BVH
from faults import Fault
from skel_text import GOOD as SKEL
from skin_text import BINDINGS
from skin_text import GOOD as SKIN

from viewer.diagnostics import Phrase
from viewer.errors import ViewerError
from viewer.formats import Source, anim, bvh, obj, ply, skel, skin

# (module, name, text, old, new, fault, part, places)
ONE: list[tuple[Any, str, str, str, str, Fault, str, list[int]]] = [
    (
        skin,
        "a.skin",
        SKIN,
        "2 0 0",
        "2 nan 0",
        (
            "F003.number",
            3,
            {"item": Phrase("of-vertex", section="positions", index=1), "found": b"nan"},
        ),
        "positions",
        [1],
    ),
    (
        skin,
        "a.skin",
        SKIN,
        "2 0 0",
        "2 0,5 0",
        (
            "F002.number",
            3,
            {"item": Phrase("of-vertex", section="positions", index=1), "found": b"0,5"},
        ),
        "positions",
        [1],
    ),
    (
        skin,
        "a.skin",
        SKIN,
        "2 0 0",
        "2 0",
        (
            "F002.width",
            3,
            {"item": Phrase("of-vertex", section="positions", index=1), "expected": 3, "found": 2},
        ),
        "positions",
        [1],
    ),
    (
        skin,
        "a.skin",
        SKIN,
        "positions 3",
        "positions 4",
        ("F002.skin-declared", 1, {"section": "positions", "expected": 4, "found": 3}),
        "",
        [],
    ),
    (
        skin,
        "a.skin",
        SKIN,
        "  2 0 0\n",
        "",
        (
            "F002.skin-entries",
            1,
            {"section": "positions", "expected": 3, "other": "normals", "found": 2},
        ),
        "positions",
        [0, 1, 2],
    ),
    (
        skin,
        "a.skin",
        SKIN,
        "normals 3 {\n  0 0 1\n",
        "normals 2 {\n",
        (
            "F002.skin-entries",
            6,
            {"section": "normals", "expected": 3, "other": "positions", "found": 2},
        ),
        "",
        [],
    ),
    (
        skin,
        "a.skin",
        SKIN,
        "1 0 1.0",
        "1 0 nan",
        (
            "W003.number",
            12,
            {"item": Phrase("of-vertex", section="skinweights", index=0), "found": b"nan"},
        ),
        "weights",
        [0],
    ),
    (
        skin,
        "a.skin",
        SKIN,
        "1 1 1\n}",
        "1 2 1\n}",
        ("W010.skin-joint", 14, {"vertex": 2, "limit": 2, "found": 2}),
        "weights",
        [2],
    ),
    (
        skin,
        "a.skin",
        SKIN,
        "1 1 1\n}",
        "1 0.5 1\n}",
        ("F002.skin-joint", 14, {"vertex": 2, "found": b"0.5"}),
        "weights",
        [2],
    ),
    (
        skin,
        "a.skin",
        SKIN,
        "1 1 1\n}",
        "2 1 1\n}",
        ("F002.skin-influences", 14, {"vertex": 2, "pairs": b"2", "found": 2}),
        "weights",
        [2],
    ),
    (
        skin,
        "a.skin",
        SKIN,
        "  1 1 1\n}",
        "}",
        (
            "F002.skin-entries",
            11,
            {"section": "skinweights", "expected": 3, "other": "positions", "found": 2},
        ),
        "weights",
        [2],
    ),
    (
        skin,
        "a.skin",
        SKIN,
        "0 1 2\n}",
        "0 1 7\n}",
        ("F002.skin-corner-range", 17, {"triangle": 0, "limit": 3, "found": 7}),
        "triangles",
        [0],
    ),
    (
        skin,
        "a.skin",
        SKIN,
        "0 1 2\n}",
        "0 1 1.5\n}",
        ("F002.skin-corner", 17, {"triangle": 0, "found": 1.5}),
        "triangles",
        [0],
    ),
    (
        skin,
        "a.skin",
        SKIN,
        "0 1 2\n}",
        "0 inf 2\n}",
        (
            "F003.number",
            17,
            {"item": Phrase("triangle", section="triangles", index=0), "found": b"inf"},
        ),
        "triangles",
        [0],
    ),
    (
        skin,
        "a.skin",
        SKIN,
        "0 1 0\n  0 0 1\n  5",
        "0 0 0\n  0 0 1\n  5",
        ("B002.skin-matrix", 20, {"matrix": 0, "determinant": 0.0}),
        "bindings",
        [0],
    ),
    (
        skin,
        "a.skin",
        SKIN,
        "0 1 0\n  0 0 1\n  8",
        "0 -1.#IND 0\n  0 0 1\n  8",
        ("F003.number", 28, {"item": Phrase("matrix", index=1), "found": b"-1.#IND"}),
        "bindings",
        [1],
    ),
    (
        skin,
        "a.skin",
        SKIN,
        "8 9 10",
        "8 9",
        ("F002.width", 26, {"item": Phrase("matrix", index=1), "expected": 12, "found": 11}),
        "bindings",
        [1],
    ),
    (
        skin,
        "a.skin",
        SKIN,
        BINDINGS,
        "",
        ("B001.skin-section", 11, {"missing": "bindings", "present": "skinweights"}),
        "bindings",
        [0, 1],
    ),
    (
        skin,
        "a.skin",
        SKIN,
        "bindings 2",
        "bindings 3",
        ("B001.skin-count", 19, {"line": 32, "expected": 3, "found": 2, "then": b"}"}),
        "",
        [],
    ),
    (
        obj,
        "a.obj",
        OBJ,
        "v 1 0 0",
        "v 1 nan 0",
        ("F003.number", 2, {"item": Phrase("obj-v", index=1), "found": b"nan"}),
        "positions",
        [1],
    ),
    (
        obj,
        "a.obj",
        OBJ,
        "v 1 0 0",
        "v 1 0",
        ("F002.width", 2, {"item": Phrase("obj-v", index=1), "expected": 3, "found": 2}),
        "positions",
        [1],
    ),
    (
        obj,
        "a.obj",
        OBJ,
        "vn 0 0 1",
        "vn 0 inf 1",
        ("F003.number", 5, {"item": Phrase("obj-vn", index=0), "found": b"inf"}),
        "",
        [0],
    ),
    (
        obj,
        "a.obj",
        OBJ,
        "2//1 3",
        "9//1 3",
        ("F002.obj-v-range", 6, {"limit": 4, "found": 9}),
        "triangles",
        [0, 1],
    ),
    (obj, "a.obj", OBJ, "f 1 2 3", "f 1 2 0", ("F002.obj-zero", 7, {}), "triangles", [2]),
    (
        obj,
        "a.obj",
        OBJ,
        "f 1 2 3",
        "f 1 2 -5",
        ("F002.obj-v-back", 7, {"least": -4, "found": -5}),
        "triangles",
        [2],
    ),
    (
        obj,
        "a.obj",
        OBJ,
        "f 1 2 3",
        "f 1 x 3",
        ("F002.obj-corner", 7, {"found": b"x"}),
        "triangles",
        [2],
    ),
    (obj, "a.obj", OBJ, "f 1 2 3", "f 1 2", ("F002.obj-face", 7, {"least": 3, "found": 2}), "", []),
    (
        ply,
        "a.ply",
        PLY,
        "1 0 0",
        "1 nan 0",
        ("F003.number", 11, {"item": Phrase("ply-row", element="vertex", row=1), "found": b"nan"}),
        "positions",
        [1],
    ),
    (
        ply,
        "a.ply",
        PLY,
        "3 0 2 3",
        "3 0 2 9",
        ("F002.ply-corner", 15, {"face": 1, "last": 3, "found": 9.0}),
        "triangles",
        [1],
    ),
    (
        skel,
        "a.skel",
        SKEL,
        "offset 0 1 0",
        "offset 0 nan 0",
        (
            "F003.number",
            10,
            {
                "item": Phrase("of", item="offset", owner=Phrase("joint", name="arm")),
                "found": b"nan",
            },
        ),
        "joints",
        [1],
    ),
    (
        skel,
        "a.skel",
        SKEL,
        "offset 0 1 0",
        "offset 0 1",
        (
            "F002.width",
            10,
            {
                "item": Phrase("of", item="offset", owner=Phrase("joint", name="arm")),
                "expected": 3,
                "found": 2,
            },
        ),
        "joints",
        [1],
    ),
    (
        skel,
        "a.skel",
        SKEL,
        "pose 0.5",
        "pose up",
        (
            "F002.number",
            8,
            {"item": Phrase("of", item="pose", owner=Phrase("joint", name="root")), "found": b"up"},
        ),
        "items",
        [0],
    ),
    (
        bvh,
        "a.bvh",
        BVH,
        "0.1 0.0 0.0",
        "0.1 nan 0.0",
        (
            "F003.number",
            8,
            {
                "item": Phrase("of", item="OFFSET", owner=Phrase("joint", name="LeftUpLeg")),
                "found": b"nan",
            },
        ),
        "joints",
        [1],
    ),
    (
        anim,
        "a.anim",
        ANIM,
        "0.5 1",
        "0.5 nan",
        (
            "F003.number",
            6,
            {
                "where": Phrase("anim-key", channel=0, index=1),
                "found": b"nan",
                "begins": None,
                "item": Phrase(
                    "anim-item", where=Phrase("anim-key", channel=0, index=1), item="value"
                ),
            },
        ),
        "channels",
        [0],
    ),
    (
        anim,
        "a.anim",
        ANIM,
        "keys 3",
        "keys 4",
        (
            "F002.anim-keys",
            4,
            {"where": Phrase("anim-channel", channel=0), "found": 3, "begins": None, "expected": 4},
        ),
        "channels",
        [0],
    ),
    (
        anim,
        "a.anim",
        ANIM,
        "channels 1",
        "channels 2",
        (
            "F002.anim-channels",
            3,
            {"where": Phrase("animation"), "found": 1, "begins": None, "expected": 2},
        ),
        "",
        [],
    ),
]


@pytest.mark.parametrize("case", ONE, ids=lambda case: f"{case[1]}, {case[4]!r}"[:40])
def test_one_fault_is_noted_with_its_place(case: tuple[Any, ...]) -> None:
    module, name, text, old, new, fault, part, places = case
    assert old in text
    broken = text.replace(old, new, 1)
    assert gone_on(module, broken, name)[1] == [(fault, 1, part, places)]
    with pytest.raises(ViewerError):  # without the list, the reader still refuses
        module.read(Source(name, broken.encode()))


@pytest.mark.parametrize(
    ("module", "name", "text"),
    [(skin, "a.skin", SKIN), (obj, "a.obj", OBJ), (ply, "a.ply", PLY), (skel, "a.skel", SKEL),
     (bvh, "a.bvh", BVH), (anim, "a.anim", ANIM)],
)  # fmt: skip
def test_good_files_have_no_faults(module: Any, name: str, text: str) -> None:
    assert gone_on(module, text, name)[1] == []
