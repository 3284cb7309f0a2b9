"""Readers that continue after errors and replace invalid values by neutral ones."""

import os
import random
import subprocess
import sys

import numpy as np
import pytest
from faults import warnings_of
from formats.broken_text import ANIM, OBJ, PLY, gone_on
from formats.bvh_text import GOOD as BVH
from formats.skin_text import GOOD as SKIN
from formats.synthetic_smpl import model
from test_mutations import FILES, mutate

from viewer.diagnostics import Collector, Phrase
from viewer.errors import ViewerError
from viewer.formats import Source, anim, bvh, obj, read, save_bytes, skel, skin, smpl
from viewer.media.saving import Replacement, save_parts
from viewer.media.unfinished import new_prefix, remove_leftovers, remove_unfinished


def test_invalid_vertex_is_placed_between_its_neighbours():
    figure, _ = gone_on(skin, SKIN.replace("2 0 0", "2 nan 0", 1), "a.skin")
    # This is the middle of (0, 0, 0) and (0, 2, 0).
    assert figure.mesh.positions.tolist() == [[0, 0, 0], [0, 1, 0], [0, 2, 0]]
    assert figure.mesh.n_triangles == 1 and figure.skin.weights.tolist() == [1, 0.25, 0.75, 1]


def test_invalid_weight_becomes_0_and_other_weights_are_unchanged():
    figure, _ = gone_on(skin, SKIN.replace("2 0 0.25 1", "2 0 nan 1", 1), "a.skin")
    assert figure.skin.weights.tolist() == [1, 0, 0.75, 1]
    assert figure.skin.joints.tolist() == [0, 0, 1, 1]


def test_invalid_line_of_weights_does_not_affect_other_lines():
    figure, _ = gone_on(skin, SKIN.replace("2 0 0.25 1", "3 0 0.25 1", 1), "a.skin")
    assert figure.skin.starts.tolist() == [0, 1, 1, 2]
    assert figure.skin.weights.tolist() == [1, 1]


def test_invalid_corner_repeats_another_corner():
    figure, _ = gone_on(skin, SKIN.replace("0 1 2\n}", "0 1 7\n}", 1), "a.skin")
    assert figure.mesh.triangles.tolist() == [[0, 1, 0]]
    figure, _ = gone_on(obj, OBJ.replace("f 1 2 3", "f x 2 3"), "a.obj")
    assert figure.mesh.triangles[2].tolist() == [1, 1, 2]


def test_singular_bind_matrix_keeps_the_bind_position_of_the_joint():
    broken = SKIN.replace("0 1 0\n  0 0 1\n  5", "0 0 0\n  0 0 1\n  5")
    figure, _ = gone_on(skin, broken, "a.skin")
    assert figure.skin.inverse_bind[0, :3, 3].tolist() == [-5, -6, -7]
    assert figure.skin.inverse_bind[0, :3, :3].tolist() == np.eye(3).tolist()


def test_invalid_normals_are_computed():
    figure, _ = gone_on(obj, OBJ.replace("vn 0 0 1", "vn 0 inf 1"), "a.obj")
    assert figure.mesh.normals.tolist() == [[0, 0, 1]] * 4


def test_several_errors_of_one_block_are_reported_once_per_code():
    text = SKIN.replace("0 0 0\n  2 0 0", "nan inf 0\n  up 0 0")
    first, second = (
        Phrase("{section} of vertex {index}", section="positions", index=vertex)
        for vertex in (0, 1)
    )
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
def test_invalid_skeleton_item_does_not_affect_other_lines(item, below, end):
    text = f"balljoint a {{\n{item}\ncolour red\nballjoint b {{ }} }}".replace("\n", end)
    source = Source("a.skel", text.encode(), diagnostics=Collector(keeps_errors=True))
    figure = skel.read(source)
    assert len(source.diagnostics.errors) == 1 and figure.skeleton.names == ("a", "b")
    assert warnings_of(source.diagnostics) == [("F006.unknown", 3 + below, {"found": b"colour"})]


def test_invalid_frame_repeats_the_previous_frame():
    good = [f"{k} 1 0" + " 0" * 12 for k in range(5)]
    bad = [good[0], good[1].replace("1", "up", 1), good[2], good[3] + " 7", good[4]]
    motion, faults = gone_on(bvh, frames(*bad), "a.bvh")
    assert [(fault[2], fault[3]) for fault in faults] == [("frames", [1]), ("frames", [3])]
    assert faults[1][0][::2] == ("F002.bvh-row", {"frame": 3, "expected": 15, "found": 16})
    assert motion.clip.translations[:, 0, 0].tolist() == [0, 0, 2, 2, 4]


def test_invalid_key_is_left_out():
    clip, _ = gone_on(anim, ANIM.replace("0.5 1", "0.5 nan"), "a.anim")
    assert clip.channels[0].times.tolist() == [0, 1]


def test_errors_of_body_models_state_vertex_and_joint(tmp_path):
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
    assert found == {("positions", (3,)), ("weights", (4,)), ("joints", (5,)),
                     ("triangles", (1,))}  # fmt: skip
    assert figure.skeleton.parents[5] == 0
    texts = {str(f).split(": ", 1)[1] for f in source.diagnostics.errors}
    assert "v_template: expected finite numbers, found nan at vertex 3" in texts
    assert "weights: expected finite numbers, found inf at vertex 4" in texts
    # Valid rows are normalised to a sum of exactly 1; invalid rows are as in the file.
    sums = np.bincount(
        np.repeat(np.arange(figure.skin.n_vertices), np.diff(figure.skin.starts)),
        figure.skin.weights,
    )
    assert sums[5] == pytest.approx(0.5) and np.delete(sums, [4, 5]) == pytest.approx(1.0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_readers_continue_only_after_recoverable_errors(seed):
    """Files refused by the strict reader have an error; files accepted by it have none."""
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
def test_non_finite_values_have_a_separate_code(word):
    source = Source(
        "a.skin",
        SKIN.replace("2 0 0", f"2 {word} 0", 1).encode(),
        diagnostics=Collector(keeps_errors=True),
    )
    skin.read(source)
    assert [fault.code for fault in source.diagnostics.errors] == ["F003"]


def test_locations_in_skin_files_are_lines():
    source = Source("a.skin", SKIN.encode())
    skin.read(source)
    found = {kind: source.place(kind, 1) for kind in ("positions", "normals", "weights")}
    assert {kind: place[1] for kind, place in found.items() if place} == {
        "positions": 3, "normals": 8, "weights": 13
    }  # fmt: skip
    assert source.place("triangles", 0) == (source.path, 17)
    assert source.place("bindings", 1) == (source.path, 26)
    assert source.place("joints", 0) is None


def test_finished_files_stay_and_unfinished_files_are_removed(tmp_path):
    save_bytes(tmp_path / "done.txt", b"whole")
    finished, begun = Replacement(tmp_path / "a.mp4"), Replacement(tmp_path / "b.mp4")
    finished.begin().write_bytes(b"video")
    finished.commit()
    begun.begin().write_bytes(b"half")
    assert len(list(tmp_path.iterdir())) == 3
    remove_unfinished()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mp4", "done.txt"]


def test_file_being_written_is_removed(tmp_path, monkeypatch):
    kept = tmp_path / "x.txt"
    kept.write_bytes(b"old")

    def end(handle):
        remove_unfinished()
        assert [path.name for path in tmp_path.iterdir()] == ["x.txt"]
        raise KeyboardInterrupt

    monkeypatch.setattr("os.fsync", end)
    with pytest.raises(KeyboardInterrupt):
        save_bytes(kept, b"new")
    assert kept.read_bytes() == b"old"


LONG = "2023-11-23_laboratory_capture_subject_seven_walk_0"


@pytest.mark.parametrize("name", ("walk.bvh", f"{LONG}1.bvh"))
def test_leftovers_of_a_file_are_removed(tmp_path, name, monkeypatch):
    target = tmp_path / name
    monkeypatch.setattr("os.unlink", lambda *_: None)  # as if the process had been killed
    with pytest.raises(KeyError):
        save_parts(target, failing())
    Replacement(target).begin().write_bytes(b"half")
    assert len(list(tmp_path.iterdir())) == 2
    monkeypatch.undo()
    remove_leftovers([str(target)])
    assert list(tmp_path.iterdir()) == []


def failing():
    yield b"half"
    raise KeyError


def test_leftovers_of_other_files_and_hidden_files_stay(tmp_path):
    """Another process may be writing a file whose long name begins with the same characters."""
    for name in (".walk.bvh.original", ".walk.bvh.12345678", ".walk.original.bvh"):
        (tmp_path / name).write_bytes(b"of the user")
    one, other = tmp_path / f"{LONG}1.bvh", tmp_path / f"{LONG}2.bvh"

    def parts():
        yield b"whole "
        remove_leftovers([str(other), str(tmp_path / "walk.bvh")])
        yield b"file"

    save_parts(one, parts())
    assert one.read_bytes() == b"whole file"
    assert len(list(tmp_path.iterdir())) == 4


WRITER = """
import os, sys
from pathlib import Path
from viewer.media.saving import Replacement, save_parts

def parts():
    yield b"half"
    Path(sys.argv[1], "begun").touch()
    os.kill(os.getpid(), 9)

Replacement(Path(sys.argv[1], "a.mp4")).begin()
save_parts(Path(sys.argv[1], "b.txt"), parts())
"""


@pytest.mark.skipif(os.name != "posix", reason="asks for processes")
def test_next_run_removes_what_a_killed_one_left_and_nothing_else(tmp_path):
    subprocess.run([sys.executable, "-c", WRITER, str(tmp_path)], check=False)
    left = [path.name for path in tmp_path.iterdir() if path.name != "begun"]
    assert len(left) == 2
    dead = next(name for name in left if name.startswith(".b.txt"))
    elsewhere = f"{dead[:10]}{'0' * 8}{dead[18:]}"  # a process of another machine
    alive = dead.replace(dead.split("-")[1], str(os.getpid()))
    assert dead.startswith(".b.txt.tmp") and elsewhere != dead != alive
    folder = tmp_path / dead.replace(".b.txt", ".smpl")
    (folder / "new").mkdir(parents=True)
    for name in (elsewhere, alive, ".b.txt.tmpabcd0123", dead[1:], ".notes.tmp"):
        (tmp_path / name).touch()
    save_bytes(tmp_path / "c.txt", b"whole")
    names = {path.name for path in tmp_path.iterdir()}
    kept = {elsewhere, alive, ".b.txt.tmpabcd0123", dead[1:], ".notes.tmp"}
    assert names == {"begun", "c.txt", *kept}
    # A folder is searched once: writing thousands of files takes no longer.
    (tmp_path / dead).touch()
    save_bytes(tmp_path / "d.txt", b"whole")
    assert (tmp_path / dead).exists() and new_prefix(tmp_path, "d.txt").startswith(".d.txt.tmp")
