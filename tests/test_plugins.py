"""Plug-ins: the package that ``viewer new-plugin`` writes, installed and used, and broken ones."""

import importlib
import json
import pickle
import re
import runpy
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rendering.drawn_figures import random_figure, random_pose

import viewer
from viewer.cli import run
from viewer.commands.doctor import examine
from viewer.diagnostics import CODES
from viewer.errors import PluginError
from viewer.exporters import EXPORTERS, usable_exporters
from viewer.formats import FORMATS, all_suffixes
from viewer.plugins import _installed, plugins_of, without_plugins
from viewer.progress import Cancelled
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.gpu.program import Programs
from viewer.rigs import scalars
from viewer.rigs.inspection.explanation import explain, explanation_text
from viewer.rigs.kinematics import posed_skeleton
from viewer.rigs.skinning import METHODS, Skinning

MANUAL = Path(viewer.__file__).parent / "manual" / "plugins.md"
TRIANGLE = "OFF\n3 1 3\n0 0 0\n1 0 0\n0 2 0\n3 0 1 2\n"


def manual_code(heading):
    """Return the example of a section of the manual, which runs as it is printed."""
    section = MANUAL.read_text("utf-8").split(f"\n## {heading}\n")[1]
    return re.search(r"```python\n(.*?)```", section, re.DOTALL)[1]


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Return a function that installs a package: a folder with its metadata counts as that."""
    tables, place = (scalars.SCALARS, EXPORTERS, CODES, METHODS), tmp_path / "site"
    known = [dict(table) for table in tables]
    place.mkdir()
    monkeypatch.syspath_prepend(place)

    def installed(name, points, version="0.1"):
        info = place / f"{name.replace('-', '_')}-{version}.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
        lines = [f"[viewer.{group}]\n{key} = {value}\n" for group, key, value in points]
        (info / "entry_points.txt").write_text("".join(lines))
        importlib.invalidate_caches()
        _installed.cache_clear()
        return place

    modules = {*sys.modules}
    yield installed
    for name in {*sys.modules} - modules:
        if str(place) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]
    _installed.cache_clear()
    scalars._PLUGGED.clear()
    for table, rows in zip(tables, known, strict=True):
        table.clear()
        table.update(rows)


@pytest.fixture
def written(install, tmp_path, monkeypatch, capsys):
    """The package that the command writes, installed."""
    monkeypatch.chdir(tmp_path)
    assert run(["new-plugin", "viewer-off"]) == 0
    assert "pip install -e viewer-off" in capsys.readouterr().out
    folder = tmp_path / "viewer-off"
    project = tomllib.loads((folder / "pyproject.toml").read_text())
    assert project["project"]["name"] == "viewer-off"
    own = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())
    assert own["project"]["name"] in project["project"]["dependencies"]
    points = [
        (group.removeprefix("viewer."), key, value)
        for group, rows in project["project"]["entry-points"].items()
        for key, value in rows.items()
    ]
    (folder / "viewer_off").rename(install("viewer-off", points) / "viewer_off")
    (tmp_path / "a.off").write_text(TRIANGLE)
    return folder


def test_tests_of_a_new_plugin_pass(written, tmp_path):
    tests = runpy.run_path(str(written / "tests" / "test_plugin.py"))
    functions = [value for name, value in tests.items() if name.startswith("test_")]
    assert len(functions) == 4
    for number, function in enumerate(functions):
        folder = tmp_path / str(number)
        folder.mkdir()
        function(*[folder] * function.__code__.co_argcount)


@pytest.mark.slow
def test_modules_are_imported_when_their_rows_are_used(written, capsys):
    viewer.load("fox")
    assert ".off" in all_suffixes() and "off" not in FORMATS
    assert not [name for name in sys.modules if name.startswith("viewer_off")]
    assert run(["info", "a.off"]) == 0
    assert "3 vertices" in capsys.readouterr().out
    assert "viewer_off.off" in sys.modules and "viewer_off.scalars" not in sys.modules
    image = viewer.render(viewer.load("a.off"), (32, 24), scalar="height", background="white")
    assert "viewer_off.scalars" in sys.modules and len(np.unique(image.reshape(-1, 4), axis=0)) > 9


@pytest.mark.parametrize("name", ["PTS", ".pts"])
def test_suffixes_may_have_a_dot_and_capitals(name, install, tmp_path):
    text = "import viewer\ndef read(source): return viewer.figure([[0, 0, 0]] * 3, [[0, 1, 2]])\n"
    (install("points", [("formats", name, "points_one")]) / "points_one.py").write_text(text)
    for file in ("a.pts", "b.PTS"):
        (tmp_path / file).write_text("x\n")
        assert viewer.load(tmp_path / file)[0].figure.mesh.n_vertices == 3


def test_quantities_follow_the_pose(written):
    body = viewer.load("body")[0]
    body["left_shoulder"] = [0.0, 0.0, 1.2]  # the arm goes up
    values = scalars.compute("height", body.figure, body.pose, viewer.Skinning())
    heights = body.vertices()[0][:, 1]
    np.testing.assert_allclose(values, heights - heights.min(), atol=1e-9)


def test_switch_ignores_plugins(written, capsys):
    assert run(["--no-plugins", "info", "a.off"]) == run(["info", "a.off", "--no-plugins"]) == 2
    assert "expected a" in capsys.readouterr().err
    assert run(["info", "a.off"]) == 0
    report = Path("report.jsonl")
    words = ["batch", "info", "a.off", "--workers", "0", "--report", str(report), "--force"]
    assert run([*words, "--no-plugins"]) == 1 and run(words) == 0
    with without_plugins():
        assert plugins_of("formats") == ()


def test_doctor_lists_them(written, install):
    (broken, old, listed) = plugin_lines(install)
    assert listed == ("ok", "viewer-off 0.1: formats off, scalars height, checks budget")
    assert broken[0] == "missing" and broken[1].startswith("plug-in bad 2.0 (formats xyz): cannot")
    assert old == ("note", "bad 2.0: scalars area is not used: this program has its own")


def test_of_two_packages_with_one_name_the_first_by_name_is_used(install):
    install("zeta", [("formats", "xyz", "json")])
    install("alpha", [("formats", ".XYZ", "no_such_module")])
    (found,) = plugins_of("formats")
    assert found.distribution == "alpha 0.1"
    lines = [each.found for each in examine() if each.subject == "plug-in"]
    assert lines[0].startswith("plug-in alpha 0.1 (formats xyz): cannot be imported")
    assert lines[1:] == ["zeta 0.1: formats xyz is not used: that of alpha 0.1 is"]


def plugin_lines(install):
    points = [("formats", "xyz", "no_such_module"), ("scalars", "area", "json:dumps")]
    install("bad", points, version="2.0")
    found = []
    for finding in examine():
        if finding.subject == "plug-in":
            found.append((finding.state, finding.found))
        elif found:
            return found
    return found


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("import nothing_like_this", "cannot be imported: ModuleNotFoundError: No module named"),
        ("def read(source): return 1 / 0", "cannot read a.xyz: ZeroDivisionError: division by"),
        ("def read(source): return 3", "expected a Figure from read, found int"),
        ("x = 1", "expected a module with read, found none"),
        (
            "class Panic(BaseException): ...\nraise Panic('index')",
            "cannot be imported: Panic: index",
        ),
    ],
    ids=["import", "exception", "result", "function", "panic"],
)
def test_error_of_a_plugin_is_one_line_with_its_package(text, message, install, tmp_path,
                                                        monkeypatch, capsys):  # fmt: skip
    monkeypatch.chdir(tmp_path)
    (install("bad", [("formats", "xyz", "bad_one")]) / "bad_one.py").write_text(text)
    Path("a.xyz").write_text("x y z\n")
    assert run(["info", "a.xyz"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"viewer: plug-in bad 0.1 (formats xyz): {message}")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("ONE = 1", "expected a Scalar, found int"),
        ("from viewer.rigs.scalars import Scalar\nONE = Scalar(max, 'One', kind='x')",
         "expected a kind of sequential or diverging, found 'x'"),
        ("from viewer.rigs.scalars import Scalar\nONE = Scalar(lambda f, v: v, 'One')",
         r"expected finite values of shape \(7813,\), found shape \(7813, 3\)"),
        ("from viewer.rigs.scalars import Scalar\n"
         "ONE = Scalar(lambda f, v: [*[0] * 5, *[float('nan')] * 7808], 'One')",
         r"expected finite values of shape \(7813,\), found nan at vertex 5"),
    ],
    ids=["type", "kind", "shape", "nan"],
)  # fmt: skip
def test_wrong_quantities_are_refused(text, message, install):
    (install("bad", [("scalars", "one", "bad_two:ONE")]) / "bad_two.py").write_text(text)
    figure = viewer.load("body")[0].figure
    with pytest.raises(PluginError, match=rf"plug-in bad 0\.1 \(scalars one\): {message}"):
        scalars.compute("one", figure, None, viewer.Skinning())
    with pytest.raises(viewer.ViewerError, match=r"did you mean one\?"):
        _installed.cache_clear()
        scalars.SCALARS.pop("one", None)
        scalars.split_name("onne")


def test_command_of_a_plugin_runs(install, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    place = install("tools", [("commands", "count-joints", "tool_one")])
    (place / "tool_one.py").write_text(manual_code("A command"))
    assert run(["count-joints", "body"]) == 0
    assert capsys.readouterr().out == f"{viewer.load('body')[0]}\n"
    assert run(["--no-plugins", "count-joints", "body"]) == 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("def run(a): return 1 / 0", "failed: ZeroDivisionError: division by zero"),
        ("def run(a): open('no/file')", "failed: FileNotFoundError: "),
        ("def run(a): return 'done'", "expected an exit code from run, found str"),
        ("raise SystemExit(7)", "cannot be imported: SystemExit: 7"),
        ("run = 1\ndef add_arguments(p): p.nothing()", "failed: AttributeError: "),
    ],
    ids=["exception", "file", "text", "script", "arguments"],
)
def test_error_of_a_command_is_one_line_with_its_package(text, message, install, capsys):
    place = install("tools", [("commands", "fail2", "tool_two")])
    (place / "tool_two.py").write_text(f"def add_arguments(p): pass\n{text}\n")
    assert run(["fail2"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"viewer: plug-in tools 0.1 (commands fail2): {message}")


def test_overview_lists_commands_of_plugins(install, capsys):
    install("tools%", [("commands", "tidy", "tool_nine"), ("commands", "info", "tool_nine")])
    assert run(["--help"]) == 0
    text = capsys.readouterr().out
    listed = text[text.index("commands of plug-ins") :]
    assert re.search(r"tidy +tools% 0\.1", listed) and "info" not in listed
    assert "tool_nine" not in sys.modules
    assert run(["--help", "--no-plugins"]) == 0
    assert "tidy" not in capsys.readouterr().out


WRITE = "path.write_text(json.dumps(places.tolist()))"
STORES = 'frozenset({"pose"})'


def write_exporter(place, stores=STORES, write=WRITE):
    text = manual_code("An exporter")
    assert STORES in text and WRITE in text
    (place / "lists.py").write_text(text.replace(STORES, stores).replace(WRITE, write))


def test_exporter_of_a_plugin_writes_its_suffix(install, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_exporter(install("lists", [("exporters", "vl", "lists"), ("exporters", "glb", "lists")]))
    actor = viewer.load("fox")[0]
    viewer.export(actor, "a.glb")
    assert Path("a.glb").read_bytes()[:4] == b"glTF" and "lists" not in sys.modules
    notes = viewer.export(actor, "a.vl")
    assert str(notes[0]).endswith("a.vl: 7561 vertices")
    np.testing.assert_allclose(json.loads(Path("a.vl").read_text()), actor.vertices(0.0))
    assert run(["convert", "fox", "-o", "b.vl"]) == 0 and Path("b.vl").stat().st_size
    assert run(["convert", "fox", "-o", "c.vm"]) == 2
    assert ", .vl" in capsys.readouterr().err
    assert run(["convert", "fox", "-o", "c.vl", "--no-plugins"]) == 2
    assert not Path("c.vl").exists()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"write": "places[0, 9]"}, "cannot write a.vl: IndexError: "),
        ({"write": "pass"}, "expected export to write a.vl and to return notes"),
        ({"stores": "frozenset({'pose'}), joints='smpl'"}, "expected EXPORTER to be an Exporter"),
    ],
    ids=["exception", "nothing", "row"],
)
def test_error_of_an_exporter_names_its_package(changes, message, install, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_exporter(install("lists", [("exporters", "vl", "lists")]), **changes)
    with pytest.raises(PluginError) as problem:
        viewer.export(viewer.load("fox")[0], "a.vl")
    assert str(problem.value).startswith(f"plug-in lists 0.1 (exporters vl): {message}")
    assert not Path("a.vl").exists()
    Path("a.vl").write_text("of before")  # is no sign that something was written, and is kept
    with pytest.raises(PluginError, match=re.escape(message)):
        viewer.export(viewer.load("fox")[0], "a.vl")
    assert Path("a.vl").read_text() == "of before"


def test_broken_module_is_imported_once(install):
    """Menus list the exporters in every frame."""
    place = install("lists", [("exporters", "vl", "lists"), ("panels", "notes", "lists")])
    (place / "lists.py").write_text("import sys\nsys.imports_of_lists.append(1)\n1 / 0\n")
    sys.imports_of_lists = tries = []
    try:
        for _ in range(3):
            assert ".vl" not in {suffix for kind in usable_exporters() for suffix in kind.suffixes}
        with pytest.raises(PluginError, match="vl\\): cannot be imported: ZeroDivisionError"):
            viewer.export(viewer.load("fox")[0], "a.vl")
        assert len(tries) == 1
        (panel,) = plugins_of("panels")
        for _ in range(2):
            with pytest.raises(PluginError, match="notes\\): cannot be imported: ZeroDivision"):
                panel.load()
        assert len(tries) == 2
    finally:
        del sys.imports_of_lists


CHECK = """
from viewer.linting import Code
CODES = {"{CODE}": Code("error", "a wrong name", "rename it")}
def check(subject):
    {BODY}
    yield subject.found("{CODE}.here: {name} is no name", name=subject.actor.name)
"""


def install_check(install, name, code="PNAME", body="pass"):
    Path("fox.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    place = install(name, [("checks", name, f"check_{name}")])
    text = CHECK.replace("{CODE}", code).replace("{BODY}", body)
    (place / f"check_{name}.py").write_text(text)


def test_check_of_a_plugin_is_run_and_listed(install, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    install_check(install, "names")
    assert run(["lint", "fox.obj"]) == 1
    assert "fox is no name" in capsys.readouterr().out
    assert (
        run(["lint", "fox.obj", "--ignore", "PNAME"])
        == run(["lint", "fox.obj", "--no-plugins"])
        == 0
    )
    assert "is no name" not in capsys.readouterr().out
    assert run(["lint", "--codes"]) == 0
    assert re.search(r"PNAME +error +a wrong name: rename it", capsys.readouterr().out)
    (row,) = [row for row in viewer.lint("fox.obj").to_dicts() if row["code"] == "PNAME"]
    assert (row["severity"], row["message"]) == ("error", "fox is no name")


@pytest.mark.parametrize(
    ("code", "body", "message"),
    [
        ("W001", "pass", 'expected codes of "P" and other capitals'),
        ("PNAME2", "1 / 0", "failed: ZeroDivisionError"),
        ("PNAME3", "yield 3", "expected findings of its own codes, found 3"),
        ("PNAME4", "yield subject.found('PNAME4: {x} is no name')", "failed: KeyError: 'x'"),
    ],
    ids=["taken", "exception", "result", "value"],
)
def test_error_of_a_check_names_its_package_and_stops_no_other(
    code, body, message, install, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    install_check(install, "names", code, body)
    Path("fox.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 5 5\nf 1 2 3\nf 1 2 2\n")
    own = viewer.lint("fox.obj")
    (failed,) = [row for row in own.to_dicts() if row["code"] == "P000"]
    assert failed["message"].startswith(f"plug-in names 0.1 (checks names): {message}")
    assert failed["severity"] == "error"
    with without_plugins():
        alone = viewer.lint("fox.obj").to_dicts()
    assert alone and [row for row in own.to_dicts() if row != failed] == alone
    # Two figures, one line for the plug-in.
    Path("hen.obj").write_text(Path("fox.obj").read_text())
    assert run(["lint", "fox.obj", "hen.obj"]) == 1
    assert capsys.readouterr().out.count("P000") == 1
    assert (
        run(["lint", "fox.obj", "--ignore", "P000,M001,M002,M003,M004,M005", "--fail-on", "error"])
        == 0
    )


@pytest.mark.parametrize(
    ("codes", "message"),
    [
        ("3", "expected CODES to be a dict, found 3"),
        (
            "{'PSOME': 3}",
            "expected a Code with a severity of note, warning, error for 'PSOME', fou",
        ),
        ("{'PSOME': Code('bad', 'a', 'b')}", "expected a Code with a severity of note, warning"),
        ("{5: Code('note', 'a', 'b')}", 'expected codes of "P" and other capitals'),
    ],
    ids=["table", "row", "severity", "name"],
)
def test_wrong_codes_of_a_check_are_refused(codes, message, install, tmp_path, capsys):
    place = install("names", [("checks", "names", "check_names")])
    text = f"from viewer.linting import Code\nCODES = {codes}\ndef check(subject): return []\n"
    (place / "check_names.py").write_text(text)
    assert run(["lint", "--codes"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"viewer: plug-in names 0.1 (checks names): {message}")


def test_tool_of_a_plugin_reads_its_results(install, tmp_path):
    place = install("mine", [("tools", "mine", "tool_mine"), ("tools", "romp", "tool_mine")])
    (place / "tool_mine.py").write_text(manual_code("A tool of video motion capture"))
    turns = np.zeros((5, 72))
    turns[:, 3 * 16 + 2] = np.linspace(0.0, 1.0, 5)  # joint 16 of SMPL is the left shoulder
    np.savez(tmp_path / "a.npz", my_turns=turns)
    actor = viewer.load(tmp_path / "a.npz", model="body")[0]
    assert actor.person == 7 and actor.vertices().shape[0] == 5
    np.testing.assert_allclose(actor.at(0.08).pose["left_shoulder"], [0, 0, 1], atol=1e-6)
    with without_plugins(), pytest.raises(viewer.ViewerError):
        viewer.load(tmp_path / "a.npz")


def test_wrong_results_of_a_tool_are_refused(install, tmp_path):
    (install("mine", [("tools", "mine", "tool_bad")]) / "tool_bad.py").write_text(
        re.sub(r"return Results.*", "return 3", manual_code("A tool of video motion capture"))
    )
    np.savez(tmp_path / "a.npz", my_turns=np.zeros((5, 72)))
    with pytest.raises(PluginError, match=r"mine 0.1 \(tools mine\): expected Results from read"):
        viewer.load(tmp_path / "a.npz")


@pytest.mark.slow
def test_panel_of_a_plugin_is_drawn_once_it_is_opened(install, monkeypatch):
    from app.driver import Driver

    from viewer.app.layout import is_open, set_open

    place = install("mine", [("panels", "notes", "panel_notes"), ("panels", "bad", "panel_bad")])
    (place / "panel_notes.py").write_text(manual_code("A panel"))
    (place / "panel_bad.py").write_text(
        "from imgui_bundle import imgui\n"
        "def draw(state):\n    imgui.begin_child('x', (0, 0)); imgui.tree_push('y'); 1 / 0\n"
    )
    hand = Driver("fox")
    try:
        assert "panel_notes" not in sys.modules and not is_open(hand.state, "notes")
        hand.menu("menu Window", "notes (mine 0.1)")
        hand.step(3)
        assert is_open(hand.state, "notes") and not hand.state.error
        texts, panel = [], sys.modules["panel_notes"]
        monkeypatch.setattr(
            panel, "imgui", SimpleNamespace(text=texts.append, button=lambda _: len(texts) == 1)
        )
        hand.step(3)
        assert texts == ["fox"] * 3
        np.testing.assert_allclose(hand.state.actor["pelvis"], [0.0, 0.5, 0.0], atol=1e-12)
        hand.key("z", "ctrl")
        hand.step(2)
        np.testing.assert_allclose(hand.state.actor["pelvis"], 0.0, atol=1e-12)
        set_open(hand.state, "bad", True)
        hand.step(3)
        assert "plug-in mine 0.1 (panels bad): cannot be drawn: ZeroDivision" in hand.state.error
        assert not is_open(hand.state, "bad")
        hand.state.error = ""
        hand.step(2)
    finally:
        hand.close()


@pytest.mark.parametrize("end", [Cancelled(), KeyboardInterrupt(), viewer.ViewerError("own words")])
def test_ends_of_the_work_are_no_errors_of_a_plugin(end, install):
    install("good", [("formats", "xyz", "json")])
    (plugin,) = plugins_of("formats")
    with pytest.raises(type(end)) as caught, plugin.guarded("failed"):
        raise end
    assert caught.value is end


def test_commands_may_exit(install):
    place = install("tools", [("commands", "leave", "tool_four")])
    (place / "tool_four.py").write_text(
        "def add_arguments(p): pass\ndef run(a): raise SystemExit(7)"
    )
    with pytest.raises(SystemExit, match="7"):
        run(["leave"])


def test_help_of_a_command_shows_its_usage(install, capsys):
    place = install("tools", [("commands", "tidy", "tool_three")])
    (place / "tool_three.py").write_text(
        "def add_arguments(p): p.add_argument('file'); p.add_argument('--100%')\ndef run(a): pass"
    )
    with pytest.raises(SystemExit):
        run(["tidy", "--help"])
    assert "usage: viewer tidy [-h] [--100% 100%] file" in capsys.readouterr().out
    assert run(["tidyy"]) == 2
    assert "did you mean tidy?" in capsys.readouterr().err


@pytest.mark.parametrize(
    "name", ["Off", "a b", "-x", "viewer", "a--b", "1a", "class", "json", "numpy"]
)
def test_names_of_new_plugins_are_checked(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(["new-plugin", "--", name]) == 2
    assert not [*tmp_path.iterdir()]


def test_existing_folders_are_kept(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine").mkdir()
    assert run(["new-plugin", "other", "-o", "mine"]) == 2
    assert "mine: exists; expected a new folder" in capsys.readouterr().err


def strongest_method():
    return manual_code("A skinning method")


def add_method(install, text, name="strongest"):
    (install("viewer-skinning", [("skinning", name, "own_method")]) / "own_method.py").write_text(
        text
    )


def test_skinning_method_of_the_manual_deforms_and_draws_alike(install, ctx):
    add_method(install, strongest_method())
    assert "own_method" not in sys.modules
    figure = random_figure(np.random.default_rng(0), 7, n_vertices=300)
    pose = random_pose(figure.skeleton, np.random.default_rng(1))
    how = Skinning("strongest")
    found, normals = viewer.deform(figure, pose, how)
    skin, palette = figure.skin, posed_skeleton(figure.skeleton, pose).palette(figure.skin)
    for vertex, place in enumerate(figure.mesh.positions):
        ties = range(skin.starts[vertex], skin.starts[vertex + 1])
        if ties:
            strongest = skin.joints[max(ties, key=lambda tie: skin.weights[tie])]
            place = (palette[strongest] @ [*place, 1.0])[:3]
        np.testing.assert_allclose(found[vertex], place, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-12)
    stored = pickle.dumps(how)
    del METHODS["strongest"]  # as in another process
    np.testing.assert_array_equal(viewer.deform(figure, pose, pickle.loads(stored))[0], found)
    with pytest.raises(KeyError):
        METHODS["weakest"]
    programs = Programs(ctx)
    posed = PosedMesh(ctx, programs, MeshBuffers(ctx, figure, []))
    posed.update(pose, how)
    drawn, drawn_normals = posed.read()
    size = np.ptp(figure.mesh.positions, axis=0).max()
    np.testing.assert_allclose(drawn, found, rtol=0, atol=1e-5 * size)
    np.testing.assert_allclose(drawn_normals, normals, rtol=0, atol=1e-5)
    told = explanation_text(explain(figure, pose, how, 5))
    assert told[0] == "vertex 5: Strongest joint only"
    assert any(line.startswith("strongest joint") for line in told)
    for owner in (posed, posed.mesh, programs):
        owner.release()


def test_skinning_method_of_a_plugin_is_one_of_all(install, tmp_path):
    add_method(install, strongest_method())
    picture, page = tmp_path / "a.png", tmp_path / "a.html"
    assert run(["render", "--method", "strongest", "--size", "64x64", "-o", str(picture)]) == 0
    assert run(["convert", "fox", "--method", "strongest", "-o", str(page)]) == 0
    assert "influence(in_bindings.x).x" in page.read_text("utf-8")
    assert [each.found for each in examine() if each.subject == "plug-in"] == [
        "viewer-skinning 0.1: skinning strongest"
    ]
    with without_plugins():
        assert run(["render", "--method", "strongest", "-o", str(picture)]) == 2


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            ("METHOD = Method(", "METHOD = (lambda *a, **b: a)("),
            "expected METHOD to be a Method without ends",
        ),
        (('SHADER = """', 'SHADER = b"""'), "expected SHADER to be a text, found bytes"),
        (("SHADER =", "TEXT ="), "expected a module with SHADER, found none"),
        (("return moved,", "return moved[1:],"), "expected finite positions of shape"),
        (("return moved,", "return moved * np.nan,"), "from deform, found others"),
        (("return moved,", "return 1 / 0,"), "cannot deform: ZeroDivisionError"),
        (("position = vec3(", "position = oops("), "the driver rejected a shader (skin/rejected"),
        (
            ('SHADER = """', 'SHADER = """#pragma needs oops\n'),
            'no "oops" for #pragma needs; there are 3: lbs, dqs, mix',
        ),
        (
            ('SHADER = """', 'SHADER = """#pragma needs rejected\n'),
            'no "rejected" for #pragma needs; ',
        ),
        (
            ('SHADER = """', 'SHADER = """\n#pragma include oops\n'),
            'no "oops" for #pragma include; ',
        ),
    ],
    ids=lambda value: str(value)[:20],
)
def test_error_of_a_skinning_method_names_its_package(changes, message, install, tmp_path, capsys):
    # A program is compiled once for each name, in all tests.
    name = "rejected" if "oops" in changes[1] or "#pragma" in changes[1] else "broken"
    add_method(install, strongest_method().replace(*changes), name)
    picture = tmp_path / "a.png"
    options = ["--method", name, "--size", "64x64", "-o", str(picture)]
    assert run(["render", "--scalar", "stretch", *options]) == 2
    error = capsys.readouterr().err
    assert f"plug-in viewer-skinning 0.1 (skinning {name}): " in error
    assert message in error
    assert "Traceback" not in error
    assert not picture.exists()


@pytest.mark.parametrize(
    ("group", "text", "message"),
    [
        ("scalars", "", "expected a Scalar, found module"),
        ("exporters", "EXPORTER = export = 3", "expected EXPORTER to be an Exporter"),
        ("checks", "CODES = {'X1': 2}\ndef check(subject): ...", "expected a Code with a severity"),
        ("skinning", "METHOD = SHADER = deform = 3", "expected METHOD to be a Method"),
    ],
)
def test_doctor_finds_rows_that_their_registry_refuses(group, text, message, install):
    place = install("viewer-wrong", [(group, "strange", "strange_row")])
    (place / "strange_row.py").write_text(text)
    (found,) = (each for each in examine() if each.subject == "plug-in")
    assert found.state == "missing"
    assert found.found.startswith(f"plug-in viewer-wrong 0.1 ({group} strange): {message}")
