"""Reports of batches: complete and incomplete lines, several writers, and keys for --resume."""

import json
from dataclasses import replace

import numpy as np
import pytest

from viewer.batching.items import Item, Result
from viewer.batching.report import Report, ReportFile, read_results
from viewer.batching.running import item_key
from viewer.errors import OutputError, ViewerError

ITEM = Item(3, ("d/a\udcff.npz",), "out/a.bvh", "a.npz")
RESULT = Result(
    ITEM, "failed", 2, 0.25, 3, "why", [{"code": "F001"}], ("out/a.bvh",), "text\n", {"n": 1}, "key"
)


def test_results_are_read_back_from_the_report(tmp_path):
    with ReportFile(tmp_path / "new" / "report.jsonl") as file:
        file.add(RESULT)
    line = json.loads((tmp_path / "new" / "report.jsonl").read_text())
    assert (
        line["name"] == "a.npz" and line["status"] == "failed" and line["outputs"] == ["out/a.bvh"]
    )
    assert read_results(tmp_path / "new" / "report.jsonl") == [RESULT]


def test_last_result_of_an_item_is_used(tmp_path):
    path = tmp_path / "report.jsonl"
    for status in ("crashed", "done"):
        with ReportFile(path) as file:
            file.add(Result(ITEM, status))
    assert [one.status for one in read_results(path)] == ["done"]


@pytest.mark.parametrize("kept", [1, 30, -2])
def test_incomplete_line_of_a_killed_process_is_terminated_and_skipped(tmp_path, kept):
    path = tmp_path / "report.jsonl"
    other = Item(4, ("b",), "", "b")
    with ReportFile(path) as file:
        file.add(RESULT)
        end = path.stat().st_size
        file.add(Result(other, "done"))
    whole = path.read_bytes()
    path.write_bytes(whole[: end + kept] if kept > 0 else whole[:kept])
    assert [one.item for one in read_results(path)] == [ITEM]
    with ReportFile(path) as file:
        file.add(Result(other, "done"))
    assert [one.item for one in read_results(path)] == [ITEM, other]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("outputs", None), ("outputs", [1]), ("output", [1]), ("name", {}), ("time", "x")),
        *(("key", [1]), ("files", 5), ("values", []), ("status", None)),
    ],
)
def test_lines_with_values_of_other_types_are_skipped(tmp_path, name, value):
    path = tmp_path / "report.jsonl"
    with ReportFile(path) as file:
        file.add(RESULT)
    line = json.loads(path.read_text()) | {name: value}
    path.write_text(f"{path.read_text()}{json.dumps(line)}\n")
    assert read_results(path) == [RESULT]


def test_several_writers_append_whole_lines(tmp_path):
    path = tmp_path / "report.jsonl"
    with ReportFile(path) as first, ReportFile(path) as second:
        for index in range(20):
            for file in (first, second):
                name = f"{index}{'x' * 5000}{file is first}"
                file.add(Result(Item(index, (), "", name), "done"))
    assert len(read_results(path)) == 40 == path.read_bytes().count(b"\n")


def test_numbers_that_json_cannot_store_are_written_as_text(tmp_path):
    with ReportFile(tmp_path / "r.jsonl") as file:
        file.add(Result(ITEM, "done", values={"worst": [1.5, float("nan")]}))

    def refuse(name):
        raise AssertionError(name)

    line = json.loads((tmp_path / "r.jsonl").read_text(), parse_constant=refuse)
    assert line["values"] == {"worst": [1.5, "nan"]}


def test_other_files_are_refused_as_reports(tmp_path):
    (tmp_path / "a.txt").write_text("1\n2\n")
    with pytest.raises(ViewerError, match="expected the report"):
        read_results(tmp_path / "a.txt")
    with pytest.raises(OutputError, match=r"a\.txt"):
        ReportFile(tmp_path / "a.txt" / "report.jsonl")


def test_report_counts_and_sorts_failures():
    results = [
        Result(Item(i, (), "", ""), s) for i, s in ((2, "failed"), (0, "crashed"), (1, "done"))
    ]
    report = Report(results, n_items=3)
    assert [one.item.index for one in report.failures] == [0, 2]
    assert report.counts == {"failed": 1, "crashed": 1, "done": 1}
    assert not report.is_complete
    assert Report(results[2:], n_items=1).is_complete and not Report(n_items=1).is_complete


def test_key_depends_only_on_content_options_and_output(tmp_path):
    one, two, shared = tmp_path / "one", tmp_path / "two", tmp_path / "shared"
    for path in (one, two, shared):
        path.write_text("content")
    item = Item(0, (str(one),), "out", "one")
    key = item_key(item, "options", [str(shared)])
    assert item_key(Item(7, (str(two),), "out", "two"), "options", [str(shared)]) == key
    others = [
        item_key(Item(0, (str(one),), "other", "one"), "options", [str(shared)]),
        item_key(item, "other", [str(shared)]),
        item_key(item, "options"),
    ]
    two.write_text("contents")
    others.append(item_key(Item(0, (str(two),), "out", "one"), "options", [str(shared)]))
    shared.write_text("changed")
    others.append(item_key(item, "options", [str(shared)]))
    assert len({key, *others}) == 6


def test_key_of_folders_and_archives_depends_on_files_and_names(tmp_path):
    (tmp_path / "take" / "smpl").mkdir(parents=True)
    frame = tmp_path / "take" / "smpl" / "0.json"
    frame.write_text("[]")
    item = Item(0, (str(tmp_path / "take"),), "", "take")
    keys = [item_key(item, "")]
    frame.write_text("[1]")
    keys.append(item_key(item, ""))
    frame.rename(frame.with_name("1.json"))
    keys.append(item_key(item, ""))
    (tmp_path / "a.zip").write_bytes(b"PK")
    for member in ("x/a.skel", "y/a.skel"):
        keys.append(item_key(Item(0, (str(tmp_path / "a.zip" / member),), "", ""), ""))
    assert len(set(keys)) == 5
    with pytest.raises(OSError):
        item_key(Item(0, (str(tmp_path / "missing"),), "", ""), "")


def test_key_of_a_shared_folder_follows_its_files(tmp_path):
    (tmp_path / "one").write_text("1")
    (tmp_path / "model").mkdir()
    (tmp_path / "model" / "a.txt").write_text("old")
    keys = []
    for text in ("old", "newer"):  # writing a file does not change the time of its folder
        (tmp_path / "model" / "a.txt").write_text(text)
        item = Item(0, (str(tmp_path / "one"),), "", "one")
        keys.append(item_key(item, "", [str(tmp_path / "model")]))
    assert keys[0] != keys[1]


def test_key_reads_no_devices(tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "endless").symlink_to("/dev/zero")
    (tmp_path / "in" / "lost").symlink_to("nowhere")
    assert item_key(Item(0, (str(tmp_path / "in"),), "", ""), "")
    with pytest.raises(OSError, match="not a file"):
        item_key(Item(0, (str(tmp_path / "in" / "endless"),), "", ""), "")


def test_arrays_and_other_keys_returned_by_functions_are_written(tmp_path):
    values = {"size": np.float32(2.5), "ids": np.arange(3)}
    with ReportFile(tmp_path / "r.jsonl") as file:
        file.add(Result(ITEM, "done", values=values))
        file.add(Result(replace(ITEM, name="b"), "done", values={"n": {(1, 2): np.arange(2)}}))
    found = [one.values for one in read_results(tmp_path / "r.jsonl")]
    assert found == [{"size": 2.5, "ids": [0, 1, 2]}, {"n": {"(1, 2)": [0, 1]}}]
