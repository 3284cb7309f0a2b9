"""Every command of README and manual runs, with small files in place of the reader's own."""

import os
import re
import shutil
import subprocess
from collections.abc import Callable
from contextlib import nullcontext
from functools import cache, partial
from pathlib import Path

import pytest
from live_screen import screen_at
from manual.stand_ins import HOME, make_all
from manual.test_pages import PATHS, blocks

import viewer.commands.view
from viewer.cli import run
from viewer.commands import COMMANDS

pytestmark = [
    pytest.mark.slow,
    pytest.mark.usefixtures("quick_fits", "_coarse_voxels", "_no_display"),
]

NOT_RUN = {
    "make": "sets up the checkout, or runs these tests",
    "pip install": "installs packages",
    "#": "options of a batch system, in a script for it",
    "viewer models add anny": "downloads 48 MB",
    "viewer serve": "opens a window, which tests/test_live_window.py does",
    "viewer doctor --bench": "measures this machine for a minute",
    "viewer batch render models/ -o out/ --cluster tcp": "needs a running scheduler",
    "viewer batch convert 'amass/**/*.npz' --to bvh -o out/ --cluster local": "starts processes; "
    "tests/batching runs it",
    "viewer batch convert 'amass/**/*.npz' --to bvh -o out/ --workers 64": "needs SLURM",
    "viewer batch render models/ -o out/ --workers 8 --cluster slurm": "needs SLURM",
}
"""Beginnings of lines that are not run, each with the reason; ``test_pages`` parses them."""

OWN = {
    "batches.md": {"walk.anim": None, "scan.obj": None, "spider.obj": None},
    "bodies.md": {"scan.obj": "anny"},
    "characters.md": {"scan.obj": "hero.glb"},
    "weights.md": {"submissions/eve.zip": None},
}
"""Files of a page that differ from those of the others, and what they are converted from, or None
for files that the page does not have. A scan must resemble its template."""

OUTPUTS = ("-o", "--save-joint-map", "--table", "--overview")

FINDINGS = ("lint", "diff", "batch diff", "batch lint")
"""Commands whose exit code may be 1."""


_SPAN = re.compile(r"`(viewer [^`…]*\.[a-z]{2,4}\b[^`…]*)`")


def lines() -> list[tuple[str, str]]:
    """Return the lines of blocks and the commands with files within the text, with their pages.
    Continued lines are one.
    """
    found = []
    for path in PATHS:
        text = "\n".join(blocks(path, "sh")).replace("\\\n", " ")
        found += [(path.name, line.strip()) for line in text.splitlines() if line.strip()]
        found += [(path.name, line) for line in _SPAN.findall(path.read_text("utf-8"))]
    return found


RUN = {
    line.partition(" #")[0].rstrip(): page
    for page, line in lines()
    if not line.startswith(tuple(NOT_RUN))
}
"""Commands without their comments, each once, with a page that has it."""


@pytest.fixture
def _no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write a tiny picture instead of opening a window."""
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(viewer.commands.view, "SIZE", (64, 36))


@pytest.fixture
def _coarse_voxels(monkeypatch: pytest.MonkeyPatch) -> None:
    """Find skeletons with 96 voxels along the longest side instead of 160: much faster."""
    monkeypatch.setattr("viewer.autorig.curve_skeleton._FINEST", 96)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("files")
    before = Path.cwd()
    os.chdir(folder)
    try:
        make_all(folder)
    finally:
        os.chdir(before)
    return folder


@pytest.fixture(scope="module")
def converted(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, str], list[Path]]:
    """A function that returns the files of a conversion, which runs once."""

    @cache
    def files_of(source: str, name: str) -> list[Path]:
        folder = tmp_path_factory.mktemp("own")
        assert run(["convert", source, "-o", str(folder / name)]) == 0
        return sorted(folder.iterdir())

    return files_of


@pytest.mark.parametrize("line", RUN)
def test_command_runs(line, files, converted, tmp_path, monkeypatch, capsys):
    folder = tmp_path / "work"
    shutil.copytree(files, folder, copy_function=os.link)
    monkeypatch.chdir(folder)
    monkeypatch.setenv("HOME", str(folder / HOME))
    monkeypatch.setenv("SLURM_ARRAY_TASK_ID", "0")
    monkeypatch.setenv("SLURM_ARRAY_TASK_COUNT", "2")
    assert run(["models", "--model-path", str(folder / HOME / "models")]) == 0
    for name, source in OWN.get(RUN[line], {}).items():
        (folder / name).unlink()
        for path in converted(source, name) if source else ():
            (folder / path.name).unlink(missing_ok=True)
            os.link(path, folder / path.name)
    words = words_of(line)
    outputs = [words[at + 1] for at, word in enumerate(words) if word in OUTPUTS]
    for output in outputs:
        remove(folder / output)
    before = set(folder.rglob("*"))
    capsys.readouterr()
    code = run([*words, *cheaper(words)])
    printed = capsys.readouterr()
    allowed = (0, 1) if " ".join(words[:2]).startswith(FINDINGS) else (0,)
    assert code in allowed, printed.err
    assert "no effect" not in printed.err
    new = {path.suffix for path in folder.rglob("*") if path not in before}
    assert {Path(output).suffix for output in outputs} <= new


@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)
def test_python_examples_run_as_printed(path, files, tmp_path, monkeypatch):
    examples = blocks(path, "python")
    if not examples:
        return
    if any("viewer.widget" in example for example in examples):
        pytest.importorskip("anywidget")
    folder = tmp_path / "work"
    shutil.copytree(files, folder, copy_function=os.link)
    monkeypatch.chdir(folder)
    for name, source in OWN.get(path.name, {}).items():
        if source is None:
            (folder / name).unlink()
    monkeypatch.setattr("viewer.show", shown_without_display)
    monkeypatch.setattr("viewer.rig", partial(viewer.rig, method="nearest"))
    monkeypatch.setenv("VIEWER_CONNECTION_FILE", str(tmp_path / "window.json"))
    is_live = any("viewer.connect" in example for example in examples)
    names: dict[str, object] = {}
    with screen_at(tmp_path / "window.json") if is_live else nullcontext():
        for example in examples:
            exec(compile(example, path.name, "exec"), names)


def shown_without_display(scene, block=True):
    """Return a connection to the screen in place of a window."""
    if block:
        return None
    live = viewer.connect()
    live.show(scene)
    return live


def words_of(line: str) -> list[str]:
    """Return the arguments of a command as a shell passes them."""
    script = f'viewer() {{ printf "%s\\0" "$@"; }}; {line}'
    done = subprocess.run(["sh", "-c", script], capture_output=True, check=True)
    return done.stdout.decode().split("\0")[:-1]


def cheaper(words: list[str]) -> list[str]:
    """Return options that let a command draw little and work in this process."""
    command = words[0] if words else ""
    job = words[1] if command == "batch" else command
    more = ["--workers", "0"] if command == "batch" else []
    if "--frames" in words:
        more += ["--frames", "0:8"]
    if "--trim" in words:
        more += ["--trim", "98:102"]
    if "--turntable" in words:
        more += ["--fps", "2"]
    binds = not {"--skeleton", "--auto", "--bones"}.isdisjoint(words)
    if job == "rig" and not binds and not any("frames" in word for word in words):
        more += ["--method", "nearest"]
    if job == "render":
        size = "200x200" if "--panels" in words else "160x90"
        more += ["--size", size]
    if job == "render" or job not in COMMANDS:
        more += ["--quality", "draft"]
    return more


def remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)


def test_lines_that_are_not_run_exist():
    """A reason without a line is out of date."""
    assert [
        begin for begin in NOT_RUN if not any(line.startswith(begin) for _, line in lines())
    ] == []
