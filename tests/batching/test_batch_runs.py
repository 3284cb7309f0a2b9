"""Runs of batches, in which no item is lost or run twice after any kind of end."""

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from app.tiny import SKEL
from batching.batch_jobs import (
    add_numbers,
    crash_after_writing,
    items_called,
    kill_while_writing,
    misbehave,
    write_numbers,
)

import viewer
from viewer import interrupts
from viewer.batching.engines import ENGINES, IN_FLIGHT, Limits, load_engine
from viewer.batching.execution import FunctionJob, attempt
from viewer.batching.items import Item, Result
from viewer.batching.report import Report, ReportFile, read_results
from viewer.batching.running import Settings, item_key, run_batch, shard_of
from viewer.errors import OutputError, ViewerError
from viewer.formats import Source, read
from viewer.formats._figure_cache import keeping_figures

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_two_thousand_files_with_one_in_twenty_broken_are_processed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    broken = write_numbers(tmp_path / "in", 2000)
    report = viewer.batch("in/*.txt", add_numbers, "out", to="sum", workers=0)
    assert report.counts == {"done": 1900, "failed": 100}
    assert sorted(one.item.name for one in report.failures) == sorted(broken)
    assert all(".txt:1: expected" in one.message for one in report.failures)
    assert len({one.item.index for one in report.results}) == 2000
    assert len(list((tmp_path / "out").glob("*.sum"))) == 1900
    lines = read_results(tmp_path / "out" / "report.jsonl")
    assert Counter(one.status for one in lines) == report.counts
    assert (tmp_path / "out" / "pose1999.sum").read_text() == "2000"


@pytest.mark.slow
def test_workers_that_crash_hang_or_exhaust_memory_affect_no_other_item(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    broken = write_numbers(tmp_path / "in", 100)
    status = {"crash": "crashed", "hang": "timeout", "hog": "memory", "term": "crashed"}
    status["raise"] = "failed"
    for name in status:
        (tmp_path / "in" / f"{name}.txt").write_text("1")
    limits = {"workers": 2, "retries": 1, "timeout": 1.0, "memory": 600 << 20}
    report = viewer.batch("in/*.txt", misbehave, "out", to="sum", **limits)
    assert sorted(one.item.index for one in report.results) == list(range(105))
    by_name = {Path(one.item.name).stem: one for one in report.results}
    assert {name: by_name[name].status for name in status} == status
    attempts = {"crash": 2, "hang": 2, "hog": 2, "term": 2, "raise": 1}
    assert {name: by_name[name].attempts for name in status} == attempts
    assert {one.item.name for one in report.failures} == {*broken, *(f"{n}.txt" for n in status)}
    assert os.getpid() not in {one.values.get("process") for one in report.results}
    assert len(list((tmp_path / "out").glob("*.sum"))) == 95
    assert len((tmp_path / "out" / "report.jsonl").read_text().splitlines()) == 105


@pytest.mark.slow
def test_outputs_of_killed_workers_are_replaced_but_no_others(tmp_path):
    items = [Item(n, (), str(tmp_path / f"{n}.txt"), str(n)) for n in range(3)]
    # The file of another program, which appeared after the batch had been planned.
    (tmp_path / "1.txt").write_text("other")
    report = run_batch(items, FunctionJob(crash_after_writing), Settings("processes", Limits(1)))
    found = {one.item.index: (one.status, one.attempts) for one in report.results}
    assert found == {0: ("done", 2), 1: ("failed", 1), 2: ("done", 2)}
    assert (tmp_path / "1.txt").read_text() == "other"


KILLED = """
import os, signal, sys
sys.path.insert(0, {tests!r})
import viewer
from batching.batch_jobs import add_numbers
done = []
def strike(result):
    done.append(result)
    if len(done) == 30:
        os.kill(os.getpid(), signal.SIGKILL)
viewer.batch("in/*.txt", add_numbers, "out", to="sum", workers=0, on_result=strike)
"""


@pytest.mark.slow
def test_killed_batch_is_resumed(tmp_path, monkeypatch):
    write_numbers(tmp_path / "in", 60)
    program = KILLED.format(tests=str(ROOT / "tests"))
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    ended = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, env=env)
    assert ended.returncode == -signal.SIGKILL
    path = tmp_path / "out" / "report.jsonl"
    assert len(read_results(path)) == 30
    # The process may also be killed while writing a line, or between an output and its line.
    path.write_bytes(path.read_bytes()[:-20])
    monkeypatch.chdir(tmp_path)
    report = viewer.batch("in/*.txt", add_numbers, "out", to="sum", workers=0, resume=True)
    n_broken_before = sum(index % 20 == 7 for index in range(30))
    assert report.counts["unchanged"] == 29 - n_broken_before
    assert report.counts["unchanged"] + report.counts["done"] == 57
    assert len(read_results(path)) == 60


def test_changed_inputs_and_lost_outputs_are_processed_again(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_numbers(tmp_path / "in", 5)
    viewer.batch("in/*.txt", add_numbers, "out", to="sum")
    (tmp_path / "in" / "pose1.txt").write_text("0 1 2 3")
    report = viewer.batch("in/*.txt", add_numbers, "out", to="sum", resume=True)
    assert {one.item.name for one in report.results if one.status == "done"} == {"pose1.txt"}
    assert (tmp_path / "out" / "pose1.sum").read_text() == "6"


def test_numbers_and_outputs_of_functions_are_recorded(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_numbers(tmp_path / "in" / "deep", 1)
    (tmp_path / "in" / "top.txt").write_text("1")

    def count(item: Item) -> int:
        Path(item.output).write_text("3")
        return 120  # a value, not an exit code

    call = {"job": count, "out": "out", "to": "sum", "workers": 0}
    report = viewer.batch(["in/deep/pose0.txt", "in/top.txt"], **call)
    assert [one.values for one in report.results] == [{"value": 120}] * 2
    assert {one.outputs for one in report.results} == {("out/deep/pose0.sum",), ("out/top.sum",)}
    Path("out/top.sum").unlink()
    report = viewer.batch(["in/deep/pose0.txt", "in/top.txt"], **call, resume=True)
    assert {one.item.name: one.status for one in report.results} == {
        "deep/pose0.txt": "unchanged",
        "top.txt": "done",
    }


def test_report_is_not_replaced_by_mistake(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_numbers(tmp_path / "in", 3)
    viewer.batch("in/*.txt", add_numbers, report="r.jsonl")
    with pytest.raises(ViewerError, match=r"r\.jsonl: already exists"):
        viewer.batch("in/*.txt", add_numbers, report="r.jsonl")
    viewer.batch("in/*.txt", add_numbers, report="r.jsonl", force=True)
    assert len((tmp_path / "r.jsonl").read_text().splitlines()) == 3


def test_shards_cover_all_items_and_share_a_report(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_numbers(tmp_path / "in", 10)
    for shard in ("0/3", "1/3", "2/3"):
        viewer.batch("in/*.txt", add_numbers, shard=shard, report="r.jsonl")
    assert sorted(one.item.index for one in read_results(Path("r.jsonl"))) == list(range(10))
    items = items_called(*"abcdefg")
    assert [one.name for one in shard_of(items, "1/3")] == ["b", "e"]
    assert shard_of(items, "7/9") == []


def test_outputs_that_another_shard_replaced_are_written_again(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_numbers(tmp_path / "in", 3)

    def negative(item: Item) -> None:
        Path(item.output).write_text("-1")

    call = {"out": "out", "to": "sum", "workers": 0, "resume": True}
    viewer.batch("in/*.txt", add_numbers, **call)
    viewer.batch("in/*.txt", negative, **call, shard="0/2")
    report = viewer.batch("in/*.txt", add_numbers, **call)
    assert report.counts == {"done": 2, "unchanged": 1}
    assert Path("out/pose2.sum").read_text() == "3"


@pytest.mark.parametrize("text", ["3/3", "1", "a/b", "-1/3", "1/0", "1/3/2"])
def test_invalid_shards_are_refused(text):
    with pytest.raises(ViewerError, match="--shard: expected"):
        shard_of([], text)


def struck(ctrl_c, at: str, times: int = 1) -> FunctionJob:
    """Return a job that interrupts its own process during one item."""

    def strike(item: Item) -> None:
        for _ in range(times * (item.name == at)):
            ctrl_c()

    return FunctionJob(strike)


def test_first_signal_finishes_the_running_item(tmp_path, ctrl_c):
    settings = Settings(report=tmp_path / "r.jsonl")
    report = run_batch(items_called(*"abcd"), struck(ctrl_c, "b"), settings)
    assert [one.item.name for one in report.results] == ["a", "b"]
    assert all(one.status == "done" for one in report.results)
    assert report.signal == signal.SIGINT and not report.is_complete
    assert len(read_results(tmp_path / "r.jsonl")) == 2


def test_second_signal_cancels_the_running_item(tmp_path, monkeypatch, ctrl_c):
    monkeypatch.setattr(interrupts, "_SAME", -1.0)  # signals in quick succession count separately
    settings = Settings(report=tmp_path / "r.jsonl")
    with pytest.raises(interrupts.Interrupted):
        run_batch(items_called(*"abcd"), struck(ctrl_c, "b", 2), settings)
    assert [one.item.name for one in read_results(tmp_path / "r.jsonl")] == ["a"]


def test_python_callers_get_their_interrupt_after_running_items_are_done(
    tmp_path, monkeypatch, ctrl_c
):
    monkeypatch.chdir(tmp_path)
    write_numbers(tmp_path / "in", 3)
    found: list[Result] = []
    with pytest.raises(KeyboardInterrupt):
        viewer.batch("in/*.txt", struck(ctrl_c, "pose1.txt").function, on_result=found.append)
    assert [one.item.name for one in found] == ["pose0.txt", "pose1.txt"]


@pytest.mark.slow
def test_temporary_files_of_killed_workers_are_removed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_numbers(tmp_path / "in", 1)
    limits = {"workers": 1, "retries": 1}
    report = viewer.batch("in/*.txt", kill_while_writing, "out", to="sum", **limits)
    assert [(one.status, one.attempts) for one in report.results] == [("crashed", 2)]
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["report.jsonl"]


def test_attempts_turn_every_failure_into_a_result():
    item = Item(0, (), "", "")

    def fail(problem: BaseException) -> Result:
        def call(_: Item) -> None:
            print("before")
            raise problem

        return attempt(item, call)

    assert fail(MemoryError()).status == "memory"
    full = fail(OSError(28, "No space left on device", "out/a.bvh"))
    assert (full.status, full.exit_code) == ("failed", 5)
    assert full.message == "out/a.bvh: No space left on device" and full.text == "before\n"
    assert fail(ViewerError("no")).message == "no" and fail(SystemExit(3)).status == "failed"
    assert attempt(item, lambda _: 1).status == "done" and attempt(item, lambda _: 2).exit_code == 2
    assert attempt(item, lambda _: {"n": 1}).values == {"n": 1}


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


JOB = FunctionJob(misbehave)


@pytest.mark.parametrize("name", ENGINES)
def test_engines_can_be_loaded(name):
    assert callable(load_engine(name).run)


def test_sequential_engine_runs_items_in_order_in_this_process():
    items = items_called("a", "raise.txt", "b")
    found = list(load_engine("sequential").run(items, JOB, Limits()))
    assert [one.item for one in found] == items
    assert [one.status for one in found] == ["done", "failed", "done"]
    assert found[1].message == "KeyError: 'left knee'" and "misbehave" in found[1].text
    assert found[0].values == found[2].values == {"process": os.getpid()}


def test_functions_that_workers_cannot_import_are_refused():
    job = FunctionJob(lambda item: None)
    with pytest.raises(ViewerError, match="top level of a module, or workers=0"):
        list(load_engine("processes").run(items_called("a"), job, Limits()))


@pytest.mark.slow
def test_workers_receive_few_items_and_stop_on_request():
    taken = count()
    finished = []

    def endless():
        for index in taken:
            yield Item(index, (), "", str(index))

    limits = Limits(workers=1, is_stopping=lambda: len(finished) >= 5)
    for result in load_engine("processes").run(endless(), JOB, limits):
        finished.append(result)
    assert all(one.status == "done" for one in finished)
    assert 5 <= len(finished) <= next(taken) <= 5 + IN_FLIGHT


@pytest.mark.slow
def test_worker_may_end_before_its_last_message_is_read(monkeypatch):
    pool = pytest.importorskip("pebble.pool.process").PoolManager
    read = pool.process_next_message

    def read_late(manager, timeout):
        if manager.worker_manager.pool_channel.poll(timeout):
            time.sleep(0.3)  # three times as long as the other thread sleeps
            read(manager, 0.0)

    monkeypatch.setattr(pool, "process_next_message", read_late)
    monkeypatch.setattr("viewer.batching.engines.processes._LAST_WORDS", 2.0)
    items = items_called("crash.txt", "a")
    found = load_engine("processes").run(items, JOB, Limits(workers=1, retries=0))
    assert {one.item.name: (one.status, one.message) for one in found} == {
        "crash.txt": ("crashed", "the worker process exited with 3"),
        "a": ("done", ""),
    }


@pytest.fixture
def skel(tmp_path) -> Path:
    """Return a skeleton with a missing last brace, which is reported as a warning."""
    path = tmp_path / "tiny.skel"
    path.write_text(SKEL.rstrip().removesuffix("}"))
    return path


def opened(path: Path):
    source = Source.open(path)
    return read(source), [found.key for found in source.diagnostics]


def test_figure_is_read_once_and_its_warnings_are_repeated(skel):
    with keeping_figures([skel]):
        first, warnings = opened(skel)
    assert warnings
    with keeping_figures([skel.parent / "." / skel.name]):
        again, repeated = opened(skel)
    assert again is first and repeated == warnings


def test_changed_file_is_read_again(skel):
    with keeping_figures([skel]):
        first, _ = opened(skel)
        skel.write_text(SKEL.replace("arm", "leg"))
        second, warnings = opened(skel)
        assert second.skeleton.names[-1] == "leg" and not warnings
        # Neither size nor name reveals the change.
        skel.write_text(SKEL)
        os.utime(skel, ns=(1, 1))
        assert opened(skel)[0].skeleton.names == first.skeleton.names


def test_files_are_cached_until_others_are_requested(skel, tmp_path):
    first, _ = opened(skel)
    assert opened(skel)[0] is not first
    with keeping_figures([tmp_path / "other"]):
        assert opened(skel)[0] is not opened(skel)[0]
    with keeping_figures([skel]):
        first, _ = opened(skel)
    with keeping_figures([]):
        pass
    with keeping_figures([skel]):
        assert opened(skel)[0] is not first


def test_figures_are_read_again_with_different_options(skel):
    with keeping_figures([skel]):
        first, _ = opened(skel)
        source = Source.open(skel)
        source.options = {"rig": "mixamo"}
        assert read(source) is not first
