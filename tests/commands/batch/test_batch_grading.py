"""Grading: ``viewer batch diff`` of folders and archives against one reference."""

import csv
import errno
import os
import zipfile
from pathlib import Path

import pytest

import viewer
from viewer.cli import run
from viewer.commands._input_files import input_files

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


def test_every_submission_has_a_row_and_failures_do_not_stop_the_others(course, capsys) -> None:
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


def test_python_grading_with_expected_names_is_equal_in_workers(course) -> None:
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
def test_files_that_cannot_be_written_are_refused_first(course, options, message, capsys) -> None:
    Path("grades.csv").write_text("keep")
    assert run(["batch", "diff", "solution", "subs", *options]) in (2, 5)
    caught = capsys.readouterr()
    assert message in caught.err and not caught.out
    assert Path("grades.csv").read_text() == "keep"


def test_plus_sign_separates_files_unless_it_is_part_of_a_name(course) -> None:
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
