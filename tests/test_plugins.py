"""Plug-ins: the package that ``viewer new-plugin`` writes, installed and used, and broken ones."""

import importlib
import runpy
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import viewer
from viewer.cli import run
from viewer.commands.doctor import examine
from viewer.errors import PluginError
from viewer.formats import FORMATS, all_suffixes
from viewer.plugins import _installed, plugins_of, without_plugins
from viewer.rigs import scalars

TRIANGLE = "OFF\n3 1 3\n0 0 0\n1 0 0\n0 2 0\n3 0 1 2\n"


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Return a function that installs a package: a folder with its metadata counts as that."""
    known, place = dict(scalars.SCALARS), tmp_path / "site"
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
    scalars.SCALARS.clear()
    scalars.SCALARS.update(known)


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
    assert len(functions) == 3
    for number, function in enumerate(functions):
        folder = tmp_path / str(number)
        folder.mkdir()
        function(folder)


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
    assert listed == ("ok", "viewer-off 0.1: formats off, scalars height")
    assert broken[0] == "missing" and broken[1].startswith("plug-in bad 2.0 (formats xyz): cannot")
    assert old == ("note", "bad 2.0: scalars area is not used: this program has its own")


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
        ("x = 1", "cannot read a.xyz: AttributeError: module 'bad_one' has no attribute 'read'"),
    ],
    ids=["import", "exception", "result", "function"],
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
        ("from viewer.rigs.scalars import Scalar\nONE = Scalar(lambda f, v: v, 'One')",
         r"expected finite values of shape \(7813,\), found shape \(7813, 3\)"),
        ("from viewer.rigs.scalars import Scalar\n"
         "ONE = Scalar(lambda f, v: [*[0] * 5, *[float('nan')] * 7808], 'One')",
         r"expected finite values of shape \(7813,\), found nan at vertex 5"),
    ],
    ids=["type", "shape", "nan"],
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
    (place / "tool_one.py").write_text(
        "import viewer\n"
        "def add_arguments(parser):\n    parser.add_argument('files', nargs='*')\n"
        "def run(arguments):\n"
        "    print(viewer.load(*arguments.files)[0].figure.skeleton.n_joints)\n    return 0\n"
    )
    assert run(["count-joints", "body"]) == 0
    assert capsys.readouterr().out == "24\n"
    assert run(["--no-plugins", "count-joints", "body"]) == 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("def run(a): return 1 / 0", "failed: ZeroDivisionError: division by zero"),
        ("def run(a): open('no/file')", "failed: FileNotFoundError: "),
        ("raise SystemExit(7)", "cannot be imported: SystemExit: 7"),
        ("run = 1\ndef add_arguments(p): p.nothing()", "failed: AttributeError: "),
    ],
    ids=["exception", "file", "script", "arguments"],
)
def test_error_of_a_command_is_one_line_with_its_package(text, message, install, capsys):
    place = install("tools", [("commands", "fail2", "tool_two")])
    (place / "tool_two.py").write_text(f"def add_arguments(p): pass\n{text}\n")
    assert run(["fail2"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"viewer: plug-in tools 0.1 (commands fail2): {message}")


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
