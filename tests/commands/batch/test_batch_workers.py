"""Runs of `viewer batch`: progress, workers, functions of users and graded files."""

import csv
import errno
import io
import os
import re
import sys
import zipfile
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import viewer
from viewer.batching.items import Item, Result
from viewer.cli import run
from viewer.commands import _progress
from viewer.commands import batch as batch_command
from viewer.commands._batch.calling import identity_of
from viewer.commands._batch.planning import Request, plan_of
from viewer.commands._input_files import input_files
from viewer.commands.batch import Display
from viewer.errors import ViewerError

ITEMS = [Item(index, (), "", f"{index}.anim") for index in range(100)]


class Clock:
    """A clock that tests set."""

    now = 1000.0

    def monotonic(self) -> float:
        return self.now


def shown(monkeypatch, is_terminal, statuses):
    """Return what is written to the error stream if an item finishes every two seconds."""
    stream, clock = io.StringIO(), Clock()
    stream.isatty = lambda: is_terminal
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setattr(batch_command, "time", clock)
    monkeypatch.setattr(_progress, "time", clock)
    if is_terminal:
        bar = _progress._bar()
        bar.get_time = clock.monotonic
        monkeypatch.setattr(_progress, "_bar", lambda: bar)
    with Display("convert", ITEMS, prints=False) as batch:
        for item, status in zip(ITEMS, statuses, strict=False):
            clock.now += 2.0
            batch.show(Result(item, status))
    return stream.getvalue()


def test_bar_shows_rate_failures_and_time_left(monkeypatch):
    text = shown(monkeypatch, True, ["done", "failed", *["done"] * 18])
    last = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", text).strip().splitlines()[-1]
    assert " 20/100 0.5/s, 1 failed " in last
    # 80 items at 0.5 per second.
    assert last.rstrip().endswith("0:02:40")


def test_bar_is_shown_before_the_first_item_finishes(monkeypatch):
    assert "  0/100" in shown(monkeypatch, True, [])
    assert shown(monkeypatch, False, []) == ""


def test_lines_without_a_terminal_have_rate_and_time_left(monkeypatch):
    text = shown(monkeypatch, False, ["unchanged"] * 10 + ["done"] * 40)
    # In the first minute, ten items of 31 are skipped: 21 in 62 s. Later, all are run.
    assert text == "31 of 100, 0.339/s, 3 min 24 s left\n"


def test_rate_is_that_of_the_last_minute(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(batch_command, "time", clock)
    rate = batch_command._Rate()
    for count in range(1, 101):
        clock.now += 10.0
        slow = rate.at(count)
    assert slow == 0.1
    for count in range(101, 201):
        clock.now += 2.0
        fast = rate.at(count)
    assert fast == 0.5


def test_results_are_counted_although_standard_output_is_closed(monkeypatch):
    monkeypatch.setattr(sys, "stdout", None)
    with Display("lint", ITEMS[:2], prints=True) as batch:
        for item in ITEMS[:2]:
            batch.show(Result(item, "done", text="no findings"))
        assert batch._n_done == 2


def plan(folder, count, **options):
    """Return the plan of a batch with a number of files."""
    for number in range(count):
        (folder / f"{number}.bvh").touch()
    return plan_of(Request(paths=[str(folder)], **options))


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"workers": 3}, ("processes", 3)),
        ({"workers": 64}, ("processes", 20)),
        ({"workers": 0}, ("sequential", 5)),
        ({}, ("processes", 5)),
        ({"cluster": "local"}, ("dask_cluster", 5)),
        ({"cluster": "slurm:partition=a"}, ("dask_cluster", 1)),
        ({"cluster": "slurm:cpus=16"}, ("dask_cluster", 16)),
        ({"cluster": "slurm:cpus=16", "workers": 64}, ("dask_cluster", 20)),
    ],
)
def test_number_of_workers(tmp_path, monkeypatch, options, expected):
    monkeypatch.delenv("SLURM_CPUS_PER_TASK", raising=False)
    monkeypatch.delenv("SLURM_CPUS_ON_NODE", raising=False)
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: range(5), raising=False)
    settings = plan(tmp_path, 20, **options).settings
    assert (settings.engine, settings.limits.workers) == expected


def test_tasks_of_slurm_use_their_own_cores_only(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: range(64), raising=False)
    monkeypatch.setenv("SLURM_CPUS_ON_NODE", "8")
    assert plan(tmp_path, 20).settings.limits.workers == 8
    monkeypatch.setenv("SLURM_CPUS_PER_TASK", "4")
    assert plan(tmp_path, 20).settings.limits.workers == 4
    assert plan(tmp_path, 20, workers=10).settings.limits.workers == 10


def test_workers_that_have_no_effect_are_noted(tmp_path):
    notes = plan(tmp_path, 2, cluster="tcp://node:8786", workers=3).notes
    assert notes == ("--workers has no effect: all workers of tcp://node:8786 are used",)
    with pytest.raises(ViewerError, match="--cluster: expected --workers 1 or more, found 0"):
        plan(tmp_path, 2, cluster="local", workers=0)


def test_reports_in_python_have_the_notes(tmp_path):
    (tmp_path / "a.bvh").touch()
    (tmp_path / "b.unknown").touch()
    found = viewer.batch(tmp_path, "info", workers=0)
    assert found.notes == ["1 file in folders skipped: unknown suffix"]


def defined(source: str) -> Any:
    """Return a newly compiled function, as in another process."""
    names: dict[str, object] = {"__name__": "jobs"}
    exec(source, names)
    return names["job"]


def test_changed_functions_have_different_identities():
    sources = [
        "def job(item): return max(item.files)",
        "def job(item): return min(item.files)",
        "def job(item): return min(item.files, key=lambda one: one[0])",
        "def job(item): return min(item.files, key=lambda one: one[1])",
        "def job(item, scale=1.0): return min(item.files)",
        "def job(item, scale=2.0): return min(item.files)",
        "def outer(n):\n def job(item): return n\n return job\njob = outer(1)",
        "def outer(n):\n def job(item): return n\n return job\njob = outer(2)",
        "def outer(n):\n def job(item): return job(n)\n return job\njob = outer(2)",
    ]
    assert len({identity_of(defined(source)) for source in sources}) == len(sources)
    # Nested code and sets remain equal when they are created again.
    assert all(identity_of(defined(one)) == identity_of(defined(one)) for one in sources)


def scaled(factor, item):
    return factor


def test_bound_arguments_and_objects_are_included():
    class Job:
        def __init__(self, factor):
            self.factor = factor

        def run(self, item):
            return self.factor

    jobs = [partial(scaled, 1), partial(scaled, 2), partial(print, 1), scaled, Job(1).run]
    assert len({identity_of(job) for job in jobs}) == len(jobs)
    assert identity_of(partial(scaled, 2)) == identity_of(jobs[1])


def test_identity_does_not_depend_on_the_order_of_sets():
    # Small integers that collide in a set are stored in the order in which they are added.
    one, other = set(range(0, 17, 8)), set(range(16, -1, -8))
    assert [*one] != [*other]
    assert identity_of(partial(scaled, one)) == identity_of(partial(scaled, other))
    nested = [partial(scaled, {"a": (each,)}) for each in (one, other, {0, 8})]
    assert len({identity_of(job) for job in nested}) == 2
    sources = (f"def job(item, kinds=set({each})): return 1" for each in ("[0, 8]", "[8, 0]"))
    assert len({identity_of(defined(source)) for source in sources}) == 1


SKEL = "balljoint base {{\n  offset 0 0 0\n  balljoint tip {{\n    offset {tip} 0 0\n  }}\n}}\n"
SKIN = """positions 3 {{ 0 0 0  3 0 0  0 4 {depth} }}
normals 3 {{ 0 0 1  0 0 1  0 0 1 }}
skinweights 3 {{ 1 0 1  1 1 1  1 0 1 }}
triangles 1 {{ 0 1 2 }}
bindings 2 {{
  matrix {{ 1 0 0  0 1 0  0 0 1  0 0 0 }}
  matrix {{ 1 0 0  0 1 0  0 0 1  3 0 0 }}
}}
"""


def rig(tip: float = 3.0, depth: float = 0.0) -> dict[str, str]:
    return {"arm.skel": SKEL.format(tip=tip), "arm.skin": SKIN.format(depth=depth)}


def written(folder: Path, files: dict[str, str]) -> Path:
    folder.mkdir(parents=True)
    for name, text in files.items():
        (folder / name).write_text(text)
    return folder


def zipped(path: Path, files: dict[str, str], inside: str = "") -> None:
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in files.items():
            archive.writestr(f"{inside}{name}", text)


@pytest.fixture
def course(tmp_path, monkeypatch) -> Path:
    """Return a folder with a reference and six submissions."""
    monkeypatch.chdir(tmp_path)
    written(tmp_path / "solution", rig())
    subs = tmp_path / "subs"
    written(subs / "ann", rig() | {"notes.txt": "."})
    written(subs / "bob + co" / "project", rig(depth=0.5))
    written(subs / "cy", {"arm.skel": rig()["arm.skel"]})
    zipped(subs / "dee.zip", rig(), "dee/")
    zipped(subs / "eve.zip", rig() | {"arm.skin": "positions 1 { 0 0 }\n"})
    zipped(subs / "fay.zip", {"../arm.skel": "x", "arm.skin": "x"})
    (subs / "grades.json").write_text("{}")
    return subs


def rows_of(path: Path) -> dict[str, dict[str, str]]:
    with path.open(encoding="utf-8-sig", newline="") as stream:
        return {row["name"]: row for row in csv.DictReader(stream)}


def test_every_submission_has_a_row_and_failures_do_not_stop_the_others(course, capsys):
    code = run(["batch", "diff", "solution/arm.skel+solution/arm.skin", "subs", "--poses", "0",
                "--tolerance", "1e-6", "--table", "t.csv", "--overview", "o.html"])  # fmt: skip
    assert code == 1
    caught = capsys.readouterr()
    assert "ignored because they are neither folders nor archives: grades.json" in caught.err
    assert caught.out.splitlines()[-2:] == [
        "t.csv: table of 6 items",
        "o.html: overview of 6 items",
    ]
    rows = rows_of(Path("t.csv"))
    assert [*rows] == ["ann", "bob + co", "cy", "dee.zip", "eve.zip", "fay.zip"]
    found = {name: (row["status"], row["exit_code"], row["within"]) for name, row in rows.items()}
    assert found == {
        "ann": ("done", "0", "yes"),
        "bob + co": ("done", "1", "no"),
        "cy": ("failed", "2", ""),
        "dee.zip": ("done", "0", "yes"),
        "eve.zip": ("failed", "2", "no"),
        "fay.zip": ("failed", "2", ""),
    }
    # The displacement of the third vertex is 0.5.
    assert float(rows["bob + co"]["vertices_max"]) == pytest.approx(0.5, abs=1e-6)
    assert rows["bob + co"]["vertices_worst"] == "vertex 2"
    assert rows["cy"]["message"] == "subs/cy: expected 1 file matching *.skin, found arm.skel"
    assert rows["eve.zip"]["message"].startswith("subs/eve.zip/arm.skin:1: positions: expected")
    assert "found one that leads outside" in rows["fay.zip"]["message"]
    assert '<td class="name">bob + co</td>' in Path("o.html").read_text()
    assert not Path("arm.skel").exists()


def test_python_grading_with_expected_names_is_equal_in_workers(course):
    zipped(course / "gus.zip", rig() | {"old.skel": "x", "old.skin": "x"})
    names = [str(course / "dee.zip"), str(course / "gus.zip")]
    options = ["solution", "--expect", "arm.skel", "--expect", "arm.skin", "--poses", "0"]
    report = viewer.batch(names, "diff", options=options, workers=0, table="t.csv")
    assert [result.status for result in report.results] == ["done", "done"]
    assert {row["vertices_max"] for row in rows_of(Path("t.csv")).values()} == {"0"}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--table", "t.xls"], '--table: t.xls: expected .csv, found ".xls"'),
        (["--overview", "o.pdf"], "--overview: o.pdf: expected .html, .png"),
        (["--overview", "o.png"], "--overview: o.png: expected -o OUT"),
        (["--table", "no/t.csv"], "no/t.csv: the folder no does not exist"),
        (["--table", "grades.csv"], "grades.csv: already exists (--force replaces it)"),
    ],
)
def test_files_that_cannot_be_written_are_refused_first(course, options, message, capsys):
    Path("grades.csv").write_text("keep")
    assert run(["batch", "diff", "solution", "subs", *options]) in (2, 5)
    caught = capsys.readouterr()
    assert message in caught.err and not caught.out
    assert Path("grades.csv").read_text() == "keep"


def test_plus_sign_separates_files_unless_it_is_part_of_a_name(course):
    folder = course / "bob + co" / "project"
    files = [folder / "arm.skel", folder / "arm.skin"]
    assert input_files("+".join(map(str, files))) == files
    assert input_files(str(folder)) == files


def test_full_disk_is_not_reported_as_an_error_of_the_archive(course, capsys, monkeypatch):
    from viewer.batching import submissions as unpacking

    def fill(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(unpacking.shutil, "copyfileobj", fill)
    assert (
        run(["batch", "diff", "solution/arm.skel+solution/arm.skin", "subs", "--table", "t.csv"])
        == 5
    )
    rows = rows_of(Path("t.csv"))
    full = {
        row["exit_code"] for row in rows.values() if row["message"] == os.strerror(errno.ENOSPC)
    }
    assert full == {"5"} and len(rows) == 6
    assert any(row["status"] == "done" for row in rows.values())
