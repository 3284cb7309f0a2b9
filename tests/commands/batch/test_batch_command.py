"""``viewer batch``: results that equal single runs, exit codes, and early refusals."""

import csv
import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from app.tiny import SKEL, skin_text, write_rig
from formats.bvh_text import person
from formats.synthetic_smpl import model

import viewer
from viewer.batching.engines._cluster_text import parse_cluster
from viewer.batching.items import Item
from viewer.batching.naming import template_of
from viewer.batching.report import read_results
from viewer.batching.running import shard_of
from viewer.cli import run
from viewer.commands import render
from viewer.commands._batch import jobs
from viewer.commands._batch.jobs import JOBS, CommandJob, job_parser
from viewer.errors import ViewerError

BROKEN = "balljoint root {\noffset 0 zero 0\n}"


@pytest.fixture
def rigs(tmp_path, monkeypatch) -> Path:
    """Return a folder with three skeletons in two folders, the last of them broken."""
    for name, text in (("a/one", SKEL), ("b/two", SKEL), ("b/bad", BROKEN)):
        (tmp_path / "in" / f"{name}.skel").parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "in" / f"{name}.skel").write_text(text)
    (tmp_path / "tiny.skin").write_text(skin_text())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_items_are_written_as_by_the_command(rigs, capsys):
    assert run(["convert", "in/a/one.skel", "tiny.skin", "-o", "one.npz"]) == 0
    command = ["batch", "convert", "in", "--with", "tiny.skin", "--to", "npz", "-o", "out"]
    assert run(command) == 1
    out = capsys.readouterr().out
    assert "3 items" in out and "2 done, 1 failed" in out
    assert "b/bad.skel" in out and "report: out/report.jsonl" in out
    with (
        np.load("one.npz") as one,
        np.load("out/a/one.npz") as same,
        np.load("out/b/two.npz") as two,
    ):
        for name in one.files:
            assert (one[name] == same[name]).all() and (one[name] == two[name]).all()
    by_name = {one.item.name: one for one in read_results(Path("out/report.jsonl"))}
    bad = by_name.pop("b/bad.skel")
    assert (bad.status, bad.exit_code, bad.outputs) == ("failed", 2, ())
    assert bad.message.startswith("in/b/bad.skel:2: ")
    assert bad.diagnostics[-1]["line"] == 2
    assert {one.outputs for one in by_name.values()} == {("out/a/one.npz",), ("out/b/two.npz",)}


def test_joint_maps_are_named_by_their_items(rigs, capsys):
    for name in ("walk", "run"):
        (rigs / f"{name}.bvh").write_text(person(100.0))
    command = ["batch", "convert", "walk.bvh", "run.bvh", "--body", "--to", "bvh", "-o", "out"]
    named = [*command, "--save-joint-map", "maps/{stem}.txt"]
    assert run(named) == 0
    for name in ("walk", "run"):
        assert "left_knee = left_knee\n" in (rigs / "maps" / f"{name}.txt").read_text()
    for folder in ("out", "other"):
        capsys.readouterr()
        assert run([*named[:-3], folder, *named[-2:]]) != 0
        said = capsys.readouterr().err
        assert ("4" if folder == "out" else "2") + " outputs already exist: " in said
    assert not (rigs / "other").exists()


def test_items_do_not_fill_the_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("VIEWER_CACHE", str(tmp_path / "cache"))
    points = " ".join(f"{n}.25 {n}.5 1" for n in range(4000))
    normals, weights = "0 0 1 " * 4000, "1 0 1 " * 4000
    bind = "bindings 1 { matrix { 1 0 0 0 1 0 0 0 1 0 0 0 } }"
    sections = f"positions 4000 {{ {points} }} normals 4000 {{ {normals} }} "
    sections += f"skinweights 4000 {{ {weights} }} triangles 1 {{ 0 1 2 }} {bind}"
    for name in "ab":
        (tmp_path / f"{name}.skin").write_text(sections)
    assert run(["batch", "info", str(tmp_path / "*.skin")]) == 0
    assert not (tmp_path / "cache").exists()
    assert run(["info", str(tmp_path / "a.skin")]) == 0
    assert (tmp_path / "cache").exists()


def test_resume_runs_only_unfinished_items(rigs, capsys):
    command = [
        "batch",
        "convert",
        "in/**/*.skel",
        "--with",
        "tiny.skin",
        "-o",
        "{parent}-{stem}.obj",
    ]
    assert run([*command, "--report", "r.jsonl"]) == 1
    written = Path("a-one.obj").stat().st_mtime_ns
    capsys.readouterr()
    assert run([*command, "--report", "r.jsonl"]) == 5
    assert "2 outputs already exist" in capsys.readouterr().err
    Path("in/b/bad.skel").write_text(SKEL)
    assert run([*command, "--report", "r.jsonl", "--resume"]) == 0
    assert "1 done, 2 unchanged" in capsys.readouterr().out
    assert Path("a-one.obj").stat().st_mtime_ns == written and Path("b-bad.obj").exists()
    # Other options or shared files lead to other results.
    assert run([*command, "--report", "r.jsonl", "--resume", "--dof", "arm.x=0.5"]) == 0
    assert "3 done" in capsys.readouterr().out
    Path("tiny.skin").write_text(skin_text() + "\n")
    assert run([*command, "--report", "r.jsonl", "--resume", "--dof", "arm.x=0.5"]) == 0
    assert "3 done" in capsys.readouterr().out


def test_resume_notices_a_changed_model_of_each_gender(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    models = tmp_path / "models"
    models.mkdir()
    assert run(["models", "--model-path", str(models)]) == 0
    for gender in ("NEUTRAL", "FEMALE"):
        np.savez(models / f"SMPLH_{gender}.npz", **model("smplh"))
    np.savez(
        "walk.npz",
        poses=np.zeros((2, 156)),
        trans=np.zeros((2, 3)),
        mocap_framerate=30.0,
        gender="female",
    )
    command = ["batch", "convert", "walk.npz", "--model", "smplh", "--to", "bvh", "-o", "out"]
    command += ["--report", "r.jsonl", "--resume"]
    for summary in ("1 done", "1 unchanged"):
        capsys.readouterr()
        assert run(command) == 0
        assert summary in capsys.readouterr().out
    changed = model("smplh")
    changed["v_template"] = 2.0 * changed["v_template"]
    np.savez(models / "SMPLH_FEMALE.npz", **changed)
    assert run(command) == 0
    assert "1 done" in capsys.readouterr().out


def test_text_is_printed_in_the_order_of_the_inputs(rigs, capsys):
    assert run(["batch", "lint", "in/*/*.skel", "--report", "r.jsonl"]) == 1
    out = capsys.readouterr().out
    assert out.index("a/one.skel:\n") < out.index("b/bad.skel:\n") < out.index("b/two.skel:\n")
    assert "3 done, 1 with findings" in out
    by_name = {one.item.name: one for one in read_results(Path("r.jsonl"))}
    assert by_name["b/bad.skel"].exit_code == 1
    assert by_name["b/bad.skel"].values["counts"]["error"] == 1
    assert by_name["a/one.skel"].values["counts"]["error"] == 0


def test_diff_compares_folders_with_one_reference(rigs, capsys):
    for name in ("same", "moved", "empty"):
        (rigs / "all" / name).mkdir(parents=True)
    write_rig(rigs / "all" / "same")
    write_rig(rigs / "all" / "moved")
    moved = rigs / "all" / "moved" / "tiny.skel"
    moved.write_text(SKEL.replace("offset 0 1 0", "offset 0 2 0"))
    command = ["batch", "diff", "all/same", "all/*", "--tolerance", "1e-6", "--report", "r.jsonl"]
    assert run(command) == 1
    by_name = {one.item.name: one for one in read_results(Path("r.jsonl"))}
    found = {name: (one.status, one.exit_code) for name, one in by_name.items()}
    assert found == {"same": ("done", 0), "moved": ("done", 1), "empty": ("failed", 2)}
    assert "all/empty" in by_name["empty"].message
    measures = by_name["moved"].values["comparisons"][0]["actors"][0]["measures"]
    assert max(each["maximum"] for each in measures) == pytest.approx(1.0, abs=1e-9)


def test_warnings_are_recorded_as_data(rigs, capsys):
    (rigs / "in" / "a" / "one.skel").write_text(SKEL.rstrip().removesuffix("}"))
    assert run(["batch", "info", "in/a", "--report", "r.jsonl"]) == 0
    said = capsys.readouterr()
    assert not said.err and "warning" not in said.out
    (found,) = read_results(Path("r.jsonl"))[0].diagnostics
    assert found["code"] == "F006" and found["severity"] == "warning"
    assert run(["info", "in/a/one.skel", "--json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["diagnostics"] == [found]
    assert said.err == f"warning: in/a/one.skel: {found['message']}\n"


@pytest.mark.slow
def test_workers_draw_pictures(rigs):
    from PIL import Image

    command = ["batch", "render", "in/a", "--with", "tiny.skin", "-o", "out", "--size", "32x24"]
    assert run([*command, "--quality", "draft", "--workers", "1"]) == 0
    with Image.open("out/one.png") as picture:
        assert picture.size == (32, 24)


def test_interrupted_batch_reports_how_to_resume(rigs, capsys, monkeypatch, ctrl_c):
    from viewer.commands import info

    monkeypatch.setattr(info, "run", lambda arguments: ctrl_c() or 0)
    assert run(["batch", "info", "in"]) == 130
    assert "2 items left; only batches with --report" in capsys.readouterr().out


def test_shards_write_separate_tables(rigs):
    for shard in ("0/2", "1/2"):
        run(["batch", "lint", "in", "--shard", shard, "--table", "t.csv"])
    rows = [len(Path(f"t.{n}-of-2.csv").read_text().splitlines()) for n in range(2)]
    assert rows == [3, 2] and not Path("t.csv").exists()


def test_additional_sheets_replace_no_file(rigs, capsys, monkeypatch):
    from viewer.batching import overview as sheet

    monkeypatch.setattr(sheet, "PER_SHEET", 2)
    Path("s-2.png").write_text("mine")
    command = ["batch", "render", "in", "-o", "out", "--overview"]
    assert run([*command, "s.png"]) == 5
    assert "s-2.png: already exists" in capsys.readouterr().err
    (rigs / "in" / "b" / "p-2.skel").write_text(SKEL)
    assert run([*command, "out/b/p.png"]) == 2
    assert "sheet 2: out/b/p-2.png: expected a separate file" in capsys.readouterr().err


@pytest.mark.parametrize(
    "options", [["--shard", "0/2"], ["--report", "r.jsonl"], ["--force"], ["stray"], "--json"]
)
def test_python_refuses_options_without_effect(rigs, options):
    with pytest.raises(ViewerError, match="options: expected"):
        viewer.batch("in", "info", options=options)


@pytest.mark.parametrize(
    "wrong", [{"workers": -1}, {"retries": -1}, {"memory": -5}, {"timeout": float("nan")}]
)
def test_python_refuses_limits_below_zero(rigs, wrong):
    with pytest.raises(ViewerError, match=f"{next(iter(wrong))}: expected"):
        viewer.batch("in", "info", **wrong)


@pytest.mark.parametrize(
    ("words", "part"),
    [
        ([], "expected a job"),
        (["conver", "in"], "did you mean convert?"),
        (["convert", "in"], "expected -o OUT"),
        (["convert", "-o", "out", "--to", "obj"], "found none"),
        (["convert", "in", "-o", "out"], "--to SUFFIX"),
        (["convert", "in", "-o", "out", "--to", "zzz"], 'no exporter for ".zzz"; supported: .obj'),
        (["convert", "in", "-o", "{stem}.zzz"], 'no exporter for ".zzz"; supported: .obj'),
        (["render", "in", "-o", "out", "--to", "zzz"], "{stem}.zzz: expected an image (.png"),
        (["rig", "in", "-o", "out", "--to", "obj"], 'cannot be written as ".obj"; supported'),
        (
            ["convert", "in", "-o", "all.obj", "--to", "obj", "--with", "no.skin"],
            "no.skin: no such",
        ),
        (["convert", "in", "-o", "{suffix}.obj"], "2 outputs would be written twice"),
        (["convert", "in", "-o", "out", "--to", "bvh", "--report", "out"], "the output folder"),
        (["convert", "in", "-o", "{suffix}.obj"], "a template with {parent}, {name} or {index}"),
        (["convert", "in/a", "-o", "{folder}/{name}"], "1 output is an input: in/a/one.skel"),
        (
            ["convert", "in", "-o", "out", "--to", "bvh", "--save-joint-map", "map.txt"],
            "--save-joint-map: 2 outputs would be written twice: map.txt",
        ),
        (
            ["convert", "in", "-o", "{stem}.bvh", "--save-joint-map", "{stem}.bvh"],
            "--save-joint-map: 3 outputs would be written twice",
        ),
        (
            ["convert", "in", "-o", "out", "--to", "bvh", "--save-joint-map", "{stam}.txt"],
            "--save-joint-map: no field is called {stam}; did you mean stem?",
        ),
        (["lint", "in", "--resume"], "--report FILE"),
        (["info", "in", "--limit-memory", "0"], "--limit-memory: expected"),
        (["info", "in", "--report", "in/a/one.skel", "--force"], "--report: in/a/one.skel: exp"),
        (["render", "in", "-o", "out", "--overview", "out/a/one.png"], "the output of a/one.skel"),
        (["lint", "in", "--table", "t.csv", "--report", "t.csv"], "the file of --report"),
        (["lint", "in", "--workers", "-1"], "expected a number"),
        (["lint", "in", "--workers", "0", "--timeout", "3"], "--workers 1 or more"),
        (["lint", "in", "--timeout", "-3"], "--timeout: expected 0 or more"),
        (["lint", "in", "--limit-memory", "5X"], "--limit-memory: expected"),
        (["lint", "in", "--shard", "2/2"], "--array=0-1"),
        (["lint", "in", "--shard", "0/2", "--up", "w"], "expected one of"),
        (["lint", "in", "--sharp"], "did you mean"),
    ],
)
def test_invalid_usage_is_refused_before_the_start(rigs, capsys, words, part):
    assert run(["batch", *words]) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1 and part in said.err, said.err
    assert not said.out and not (rigs / "out").exists()


def test_json_is_one_line_per_input(rigs, capsys):
    assert run(["batch", "info", "in", "--json"]) == 1
    said = capsys.readouterr()
    lines = [json.loads(line) for line in said.out.splitlines()]
    assert [line["name"] for line in lines] == ["a/one.skel", "b/bad.skel", "b/two.skel"]
    assert [line["status"] for line in lines] == ["done", "failed", "done"]
    assert lines[1]["content"] is None and "in/b/bad.skel:2: " in lines[1]["message"]
    assert run(["info", "in/a/one.skel", "--json"]) == 0
    assert lines[0]["content"] == json.loads(capsys.readouterr().out)
    assert "3 items" in said.err


def test_braces_in_names_of_inputs_are_replaced_by_parentheses(rigs):
    (rigs / "in/a{frame}.skel").write_text(SKEL)
    assert run(["batch", "convert", "in/a{frame}.skel", "--to", "bvh", "-o", "out"]) == 0
    assert (rigs / "out/a(frame).bvh").is_file()


def test_resumption_removes_temporary_files_of_killed_runs(rigs):
    command = ["batch", "convert", "in/a", "in/b/two.skel", "--to", "bvh", "-o", "out"]
    assert run(command) == 0
    (rigs / "out/a/one.bvh").unlink()
    # After SIGKILL, there are an unfinished file of an output, and files of other programs.
    left = rigs / "out/a/.one.bvh.tmpa1_b2c3d"
    names = ".one.bvh", ".one.bvh.a1_b2c3d", ".two.bvh.tmpa1_b2c3d", "one.tmpa1_b2c3d"
    others = [rigs / "out/a" / name for name in names]
    for path in (left, *others):
        path.write_text("x")
    assert run([*command, "--resume"]) == 0
    assert not left.exists() and all(path.exists() for path in others)
    assert (rigs / "out/a/one.bvh").is_file()


def test_report_is_short_in_an_interpreter(rigs):
    report = viewer.batch("in", "convert", "out", to="bvh")
    assert repr(report).startswith("<Report of 3 items: 2 done, 1 failed; ")


def test_help_of_a_job_has_the_options_of_its_command(capsys):
    with pytest.raises(SystemExit):
        run(["batch", "render", "--help"])
    out = capsys.readouterr().out
    assert "--turntable" in out and "--shard" in out and "PATHS" in out


def test_table_of_info_has_a_row_per_figure(rigs, capsys):
    """The inputs are three frames of a BVH at 50 fps, two skeletons, and a broken file."""
    (rigs / "in" / "walk.bvh").write_text(
        "HIERARCHY\nROOT hips\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\n"
        "JOINT knee\n{\nOFFSET 0 1 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
        "End Site\n{\nOFFSET 0 1 0\n}\n}\n}\n"
        "MOTION\nFrames: 3\nFrame Time: 0.02\n" + "0 0 0 0 0 0\n" * 3
    )
    assert run(["batch", "info", "in", "--table", "t.csv"]) == 1
    assert "t.csv: table of 4 items" in capsys.readouterr().out
    rows = {row["name"]: row for row in csv.DictReader(Path("t.csv").read_text().splitlines())}
    walk, rig, bad = rows["walk.bvh"], rows["a/one.skel"], rows["b/bad.skel"]
    shown = ("figure", "figures", "frames", "frame_rate", "duration", "vertices", "animations")
    assert [walk[name] for name in shown] == ["walk", "1", "3", "50", "0.04", "", "0"]
    assert [rig[name] for name in shown] == ["one", "1", "", "", "", "", "0"]
    assert [bad[name] for name in shown] == [""] * len(shown)
    assert bad["status"] == "failed" and bad["message"]


def test_every_job_writes_a_page_and_sheets_without_images_are_refused_first(rigs, capsys):
    convert = ["batch", "convert", "in/a", "--with", "tiny.skin", "--to", "npz", "-o", "out"]
    assert [run([*convert, "--overview", name]) for name in ("c.html", "c.png")] == [0, 2]
    assert "c.html: overview of 1 item" in (said := capsys.readouterr()).out
    assert (
        "--overview: contact sheets show the images of render and diff: expected a page (.html) of "
        'convert, found ".png"; viewer batch render draws the outputs' in said.err
    )
    assert '<td class="name">one.skel</td>' in Path("c.html").read_text()
    for job in ("info", "lint", "rig"):
        output = ["-o", "new"] if job == "rig" else []
        assert run(["batch", job, "in", *output, "--overview", "o.png"]) == 2
        assert f'expected a page (.html) of {job}, found ".png"' in capsys.readouterr().err
    assert not Path("new").exists() and not Path("c.png").exists()
    assert run(["batch", "info", "in/a", "--overview", "o.html"]) == 0
    assert "one: 2 joints" in Path("o.html").read_text()


def test_workers_that_render_use_separate_devices_unless_one_is_given(monkeypatch):
    used = []
    monkeypatch.setattr(render, "run", lambda arguments: used.append(arguments.gpu) or 0)
    monkeypatch.setattr(jobs, "_device", lambda: 3)
    item = Item(0, ("a.glb",), "", "a.glb")
    for given in (None, 1):
        job = CommandJob("render", {"files": [], "gpu": given})
        assert job(item).status == "done" and job.uses_gpu
    assert used == [3, 1]


def test_process_of_the_batch_uses_the_default_device():
    assert jobs._device() is None


PAGE = Path(viewer.__file__).parent / "manual" / "batches.md"


def commands() -> list[str]:
    """Return the command lines in the page's blocks, with continued lines joined."""
    blocks = re.findall(r"```sh\n(.*?)```", PAGE.read_text(), re.DOTALL)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    return [line for line in lines if line.startswith("viewer batch ")]


def test_page_has_a_command_of_each_kind():
    assert {line.split()[2] for line in commands()} == JOBS.keys() - {"rig"}


@pytest.mark.parametrize("line", commands())
def test_command_of_the_page_is_valid(line):
    line = line.replace("$SLURM_ARRAY_TASK_ID", "0").replace("$SLURM_ARRAY_TASK_COUNT", "8")
    words = shlex.split(line, comments=True)[2:]
    parser = job_parser(words[0])
    parser.check_options(words)
    arguments = parser.parse_intermixed_args(words)
    if arguments.cluster:
        parse_cluster(arguments.cluster)
    if arguments.shard:
        assert shard_of(range(8), arguments.shard) == [0]
    if getattr(arguments, "output", None):
        assert template_of(arguments.output, arguments.to or JOBS[words[0]].suffix)
