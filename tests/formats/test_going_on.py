"""Readers that go on: every fault is noted, and what is neutral stands in place of what is lost."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest
from bvh_text import GOOD as BVH
from faults import Fault, fault_of, warnings_of
from skel_text import GOOD as SKEL
from skin_text import BINDINGS
from skin_text import GOOD as SKIN
from synthetic_smpl import model
from test_mutations import FILES, mutate

from viewer.diagnostics import Collector, Phrase
from viewer.errors import ViewerError
from viewer.formats import Source, anim, bvh, obj, ply, read, skel, skin, smpl

OBJ = """v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vn 0 0 1
f 1//1 2//1 3//1 4//1
f 1 2 3
"""
PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
1 1 0
0 1 0
3 0 1 2
3 0 2 3
"""
ANIM = """animation {
range 0 1
numchannels 1
channel { extrapolate constant constant keys 3 {
0 0 flat flat
0.5 1 flat flat
1 2 flat flat } }
}
"""


def gone_on(
    module: Any, text: str, name: str
) -> tuple[Any, list[tuple[Fault, int, str, list[int]]]]:
    """Return what is read in spite of faults, and each fault with its count, part and places."""
    source = Source(name, text.encode(), diagnostics=Collector(keeps_errors=True))
    content = module.read(source)
    faults = [
        (fault_of(f), f.count, f.part, [] if f.places is None else f.places.tolist())
        for f in source.diagnostics.errors
    ]
    return content, faults


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


def test_a_lost_vertex_lies_between_its_neighbours() -> None:
    figure, _ = gone_on(skin, SKIN.replace("2 0 0", "2 nan 0", 1), "a.skin")
    # The middle of (0, 0, 0) and (0, 2, 0).
    assert figure.mesh.positions.tolist() == [[0, 0, 0], [0, 1, 0], [0, 2, 0]]
    assert figure.mesh.n_triangles == 1 and figure.skin.weights.tolist() == [1, 0.25, 0.75, 1]


def test_a_lost_weight_is_0_and_the_others_stay() -> None:
    figure, _ = gone_on(skin, SKIN.replace("2 0 0.25 1", "2 0 nan 1", 1), "a.skin")
    assert figure.skin.weights.tolist() == [1, 0, 0.75, 1]
    assert figure.skin.joints.tolist() == [0, 0, 1, 1]


def test_a_line_of_weights_that_cannot_be_told_costs_no_other() -> None:
    figure, _ = gone_on(skin, SKIN.replace("2 0 0.25 1", "3 0 0.25 1", 1), "a.skin")
    assert figure.skin.starts.tolist() == [0, 1, 1, 2]
    assert figure.skin.weights.tolist() == [1, 1]


def test_a_lost_corner_is_another_of_its_triangle() -> None:
    figure, _ = gone_on(skin, SKIN.replace("0 1 2\n}", "0 1 7\n}", 1), "a.skin")
    assert figure.mesh.triangles.tolist() == [[0, 1, 0]]
    figure, _ = gone_on(obj, OBJ.replace("f 1 2 3", "f x 2 3"), "a.obj")
    assert figure.mesh.triangles[2].tolist() == [1, 1, 2]


def test_a_singular_matrix_leaves_its_joint_where_it_was_bound() -> None:
    broken = SKIN.replace("0 1 0\n  0 0 1\n  5", "0 0 0\n  0 0 1\n  5")
    figure, _ = gone_on(skin, broken, "a.skin")
    assert figure.skin.inverse_bind[0, :3, 3].tolist() == [-5, -6, -7]
    assert figure.skin.inverse_bind[0, :3, :3].tolist() == np.eye(3).tolist()


def test_normals_that_are_lost_are_computed() -> None:
    figure, _ = gone_on(obj, OBJ.replace("vn 0 0 1", "vn 0 inf 1"), "a.obj")
    assert figure.mesh.normals.tolist() == [[0, 0, 1]] * 4


def test_several_faults_of_one_block_are_one_for_each_kind() -> None:
    text = SKIN.replace("0 0 0\n  2 0 0", "nan inf 0\n  up 0 0")
    first, second = (Phrase("of-vertex", section="positions", index=vertex) for vertex in (0, 1))
    assert [fault[0::2] for fault in gone_on(skin, text, "a.skin")[1]] == [
        (("F003.number", 2, {"item": first, "found": b"nan"}), "positions"),
        (("F002.number", 3, {"item": second, "found": b"up"}), "positions"),
    ]
    assert [fault[1] for fault in gone_on(skin, text, "a.skin")[1]] == [2, 1]


def frames(*rows: str) -> str:
    head = BVH[: BVH.index("MOTION")]
    text = "\n".join(rows)
    return f"{head}MOTION\nFrames: {len(rows)}\nFrame Time: 0.1\n{text}\n"


@pytest.mark.parametrize(
    ("item", "below"),
    [("boxmin -0.2 inf -0.4", 0), ("offset 1 x", 0), ("pose 0 0 0 0", 0), ("pose 0 up\n0 1", 1),
     ("boxmin nan\nnan\n0", 2), ("boxmin 0 x 0 and more", 0)],
)  # fmt: skip
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_a_lost_item_of_a_skeleton_takes_no_line_with_it(item: str, below: int, end: str) -> None:
    text = f"balljoint a {{\n{item}\ncolour red\nballjoint b {{ }} }}".replace("\n", end)
    source = Source("a.skel", text.encode(), diagnostics=Collector(keeps_errors=True))
    figure = skel.read(source)
    assert len(source.diagnostics.errors) == 1 and figure.skeleton.names == ("a", "b")
    assert warnings_of(source.diagnostics) == [("F006.unknown", 3 + below, {"found": b"colour"})]


def test_a_frame_that_is_lost_is_as_the_one_before() -> None:
    good = [f"{k} 1 0" + " 0" * 12 for k in range(5)]
    bad = [good[0], good[1].replace("1", "nan", 1), good[2], good[3] + " 7", good[4]]
    motion, faults = gone_on(bvh, frames(*bad), "a.bvh")
    assert [(fault[2], fault[3]) for fault in faults] == [("frames", [1]), ("frames", [3])]
    assert faults[1][0][::2] == ("F002.bvh-row", {"frame": 3, "expected": 15, "found": 16})
    assert motion.clip.translations[:, 0, 0].tolist() == [0, 0, 2, 2, 4]


def test_a_key_that_is_lost_is_left_out() -> None:
    clip, _ = gone_on(anim, ANIM.replace("0.5 1", "0.5 nan"), "a.anim")
    assert clip.channels[0].times.tolist() == [0, 1]


def test_faults_of_a_body_model_are_noted_by_vertex_and_joint(tmp_path: Any) -> None:
    arrays = model("smpl")
    arrays = {key: np.array(values) for key, values in arrays.items()}
    arrays["v_template"][3, 0] = np.nan
    arrays["weights"][4, 2] = np.inf
    arrays["weights"][5] *= 0.5
    arrays["kintree_table"][0, 5] = 9
    arrays["f"][1, 0] = 99
    np.savez(tmp_path / "m.npz", **arrays)
    source = Source.open(tmp_path / "m.npz", diagnostics=Collector(keeps_errors=True))
    figure = smpl.read(source)
    found = {
        (f.part, () if f.places is None else tuple(f.places.tolist()))
        for f in source.diagnostics.errors
    }
    assert found == {("positions", (3,)), ("weights", (4,)), ("", ()), ("joints", (5,)),
                     ("triangles", (1,))}  # fmt: skip
    assert figure.skeleton.parents[5] == 0
    texts = {str(f).split(": ", 1)[1] for f in source.diagnostics.errors}
    assert "v_template: expected finite numbers, found nan at vertex 3" in texts
    assert "weights: expected finite numbers, found inf at vertex 4" in texts
    assert "weights: vertex 5: expected weights with the sum 1, found 0.5" in texts
    # The others are scaled to a sum of exactly 1, the faulty ones are as in the file.
    sums = np.bincount(
        np.repeat(np.arange(figure.skin.n_vertices), np.diff(figure.skin.starts)),
        figure.skin.weights,
    )
    assert sums[5] == pytest.approx(0.5) and np.delete(sums, [4, 5]) == pytest.approx(1.0)


@pytest.mark.parametrize("seed", range(4))
def test_a_reader_goes_on_from_faults_alone(seed: int) -> None:
    """What the strict reader refuses has a fault; what it takes has none."""
    rng = random.Random(seed)
    texts = {**FILES, "dir/b.skin": SKIN.encode(), "dir/a.obj": OBJ.encode(),
             "dir/a.ply": PLY.encode(), "dir/a.bvh": BVH.encode()}  # fmt: skip
    for _ in range(250):
        name = rng.choice(list(texts))
        data = mutate(texts[name], rng)
        source = Source(name, data, diagnostics=Collector(keeps_errors=True))
        is_refused = had_end = False
        try:
            read(Source(name, data))
        except ViewerError:
            is_refused = True
        try:
            read(source)
        except ViewerError:
            had_end = True
        assert is_refused == bool(source.diagnostics.errors or had_end), data


@pytest.mark.parametrize("word", ["nan", "-inf", "Infinity", "1e39", "1.#QNAN", "-nan(ind)"])
def test_what_was_a_number_once_has_a_code_of_its_own(word: str) -> None:
    source = Source(
        "a.skin",
        SKIN.replace("2 0 0", f"2 {word} 0", 1).encode(),
        diagnostics=Collector(keeps_errors=True),
    )
    skin.read(source)
    assert [fault.code for fault in source.diagnostics.errors] == ["F003"]


def test_places_of_a_skin_are_lines() -> None:
    source = Source("a.skin", SKIN.encode())
    skin.read(source)
    found = {kind: source.place(kind, 1) for kind in ("positions", "normals", "weights")}
    assert {kind: place[1] for kind, place in found.items() if place} == {
        "positions": 3, "normals": 8, "weights": 13
    }  # fmt: skip
    assert source.place("triangles", 0) == (source.path, 17)
    assert source.place("bindings", 1) == (source.path, 26)
    assert source.place("joints", 0) is None
