"""Runs of batches, in which no item is lost or run twice after any kind of end."""

import os
import signal
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
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
from viewer.batching.engines import Limits
from viewer.batching.execution import FunctionJob, attempt
from viewer.batching.items import Item, Result
from viewer.batching.report import read_results
from viewer.batching.running import Settings, run_batch, shard_of
from viewer.errors import ViewerError

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
    limits = {"workers": 2, "retries": 1, "timeout": 0.4, "memory": 600 << 20}
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
