"""Tables of a batch: numbers, order, and text that spreadsheets must not execute."""

import csv
import math

import numpy as np

import viewer
from viewer.batching.items import Item, Result
from viewer.batching.tables import save_table


def measure(name, maximum, mean, relative, item, step):
    return {"name": name, "maximum": maximum, "mean": mean, "relative": relative, "item": item,
            "step": step}  # fmt: skip


def compared(*measures, within=True, mismatches=(), **others):
    actor = {"name": "arm", "size": 2.0, "unit": "m", "mismatches": [*mismatches],
             "measures": [*measures]}  # fmt: skip
    row = {"name": "x", "error": None, "within": within, "mismatches": [], "actors": [actor]}
    return {"comparisons": [row | others]}


def saved(path, job, results):
    assert save_table(path, job, results) == len(results)
    with path.open(encoding="utf-8-sig", newline="") as stream:
        return list(csv.DictReader(stream))


def test_rows_of_diff_list_the_worst_vertex_and_pose(tmp_path):
    worse = measure("vertices", 0.5, 0.125, 0.25, "vertex 7", "pose 3")
    better = measure("surface, from the first", 0.25, 0.0, 0.125, "vertex 1", "pose 1")
    rotated = measure("joint orientations", math.pi / 2, math.pi / 4, 0.0, "elbow", "own pose")
    same = measure("weights", 0.0, 0.0, 0.0, "vertex 0", "")
    values = compared(better, worse, rotated, same, within=False, mismatches=["1 joint"])
    rows = saved(
        tmp_path / "t.csv",
        "diff",
        [
            Result(Item(1, (), "", "bob.zip"), "done", 1, 0.25, values=values),
            Result(Item(0, (), "", "ann"), "failed", 2, message="expected a .skin file"),
        ],
    )
    assert [row["name"] for row in rows] == ["ann", "bob.zip"]
    ann, bob = rows
    assert (ann["status"], ann["exit_code"], ann["message"]) == (
        *("failed", "2"),
        "expected a .skin file",
    )
    assert ann["vertices_max"] == ann["size"] == ann["within"] == ann["mismatches"] == ""
    assert (bob["within"], bob["mismatches"], bob["differs_in"]) == ("no", "1", "1 joint")
    assert (bob["vertices_max"], bob["vertices_mean"]) == ("0.5", "0.125")
    assert bob["vertices_max_percent_of_size"] == "25"
    assert (bob["vertices_worst"], bob["vertices_worst_pose"]) == ("vertex 7", "pose 3")
    assert (bob["orientations_max_degrees"], bob["orientations_mean_degrees"]) == ("90", "45")
    assert (bob["weights_max"], bob["weights_worst"]) == ("0", "")
    assert bob["joints_max"] == ""
    assert (bob["size"], bob["unit"], bob["seconds"]) == ("2", "m", "0.25")


def test_input_that_cannot_be_compared_has_its_message(tmp_path):
    values = compared(error="a.skin:3: expected 3 numbers") | {}
    values["comparisons"][0]["actors"] = []
    result = Result(Item(0, (), "", "x"), "failed", 2, message="last line", values=values)
    assert saved(tmp_path / "t.csv", "diff", [result])[0]["message"].startswith("a.skin:3")


def test_names_are_not_written_as_formulas_and_keep_their_characters(tmp_path):
    names = ["=cmd|'/c calc'!A0", "-2+3", "@x", 'Zoë, "Z"']
    results = [Result(Item(n, (), "", name), "done") for n, name in enumerate(names)]
    rows = saved(tmp_path / "t.csv", "convert", results)
    assert [row["name"] for row in rows] == [*(f"'{name}" for name in names[:3]), names[3]]
    assert (tmp_path / "t.csv").read_bytes().startswith(b"\xef\xbb\xbf")


def test_rows_of_lint_count_findings(tmp_path):
    findings = [{"code": "W002"}, {"code": "S004"}, {"code": "W002"}]
    values = {"findings": findings, "counts": {"error": 2, "warning": 1, "note": 0}}
    result = Result(Item(0, (), "", "x"), "done", 1, values=values)
    row = saved(tmp_path / "t.csv", "lint", [result])[0]
    assert (row["errors"], row["warnings"], row["notes"]) == ("2", "1", "0")
    assert row["codes"] == "S004 W002"


def test_rows_of_info_are_figures_and_each_cell_is_one_value(tmp_path):
    base = {"size": 2.5, "unit": "m", "model": {}}
    clip = {"range": [1.0, 3.5], "frames": 6, "present_frames": 4, "frame_rate": 2.0,
            "gender": "female", "model": "SMPL-H"}  # fmt: skip
    keys = {"range": [0.0, 1.0], "frame_rate": 30.0, "regular": False}
    actors = [
        base | {"name": "ann", "clip": clip, "skeleton": {"joints": 24}},
        base | {"name": "fox", "clip": keys, "animations": [{}, {}],
                "mesh": {"vertices": 8, "triangles": 12}},
        base | {"name": "body", "unit": None,
                "model": {"facts": {"model": "SMPL", "gender": "male"}}},
    ]  # fmt: skip
    results = [
        Result(Item(0, (), "", "x"), "done", values={"actors": actors}),
        Result(Item(1, (), "", "y"), "failed", 2, message="cannot be read"),
    ]
    assert save_table(tmp_path / "t.csv", "info", results) == 2
    with (tmp_path / "t.csv").open(newline="") as stream:
        ann, fox, body, failed = csv.DictReader(stream)
    motion = ("frames", "present_frames", "frame_rate", "duration", "gender", "model")
    assert [ann[key] for key in motion] == ["6", "4", "2", "2.5", "female", "SMPL-H"]
    assert [fox[key] for key in motion] == ["", "", "", "1", "", ""]
    assert [body[key] for key in motion] == ["", "", "", "", "male", "SMPL"]
    counts = ("figure", "figures", "joints", "vertices", "triangles", "animations", "unit")
    assert [ann[key] for key in counts] == ["ann", "3", "24", "", "", "0", "m"]
    assert [fox[key] for key in counts] == ["fox", "3", "", "8", "12", "2", "m"]
    assert (failed["name"], failed["figures"], failed["message"]) == ("y", "", "cannot be read")


def test_values_of_a_function_are_columns_with_all_digits(tmp_path, monkeypatch):
    returned = {
        "a.txt": {"height": 0.1234567890123, "n": np.int64(3), "seconds": 9, "list": [1, 2],
                  "inner": {"x": np.float32(0.5), "word": "=1"}},
        "b.txt": -2.5,
    }  # fmt: skip
    for name in returned:
        (tmp_path / name).write_text("x")
    monkeypatch.chdir(tmp_path)
    viewer.batch([*returned], lambda item: returned[item.name], workers=0, table="t.csv")
    with (tmp_path / "t.csv").open(newline="") as stream:
        first, second = csv.DictReader(stream)
    assert (first["height"], first["n"], first["value.seconds"]) == ("0.1234567890123", "3", "9")
    assert (first["inner.x"], first["inner.word"], first["value"]) == ("0.5", "'=1", "")
    assert (second["height"], second["n"], second["value"]) == ("", "", "-2.5")
    assert "list" not in first and float(first["seconds"]) < 9.0


def test_infinite_values_are_the_same_after_a_resumed_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.txt").write_text("x")
    for is_resumed in (False, True):
        viewer.batch(["a.txt"], _infinite, workers=0, table="t.csv", report="r.jsonl",
                     resume=is_resumed)  # fmt: skip
        with (tmp_path / "t.csv").open(newline="") as stream:
            (row,) = csv.DictReader(stream)
        assert row["status"] == ("unchanged" if is_resumed else "done")
        assert (row["low"], row["high"], row["none"]) == ("-inf", "inf", "nan")


def _infinite(item) -> dict[str, float]:
    return {"low": -np.inf, "high": np.inf, "none": np.nan}
