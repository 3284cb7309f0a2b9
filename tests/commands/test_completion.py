"""Shell completion, tested in real shells."""

import os
import pty
import re
import select
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Self

import pytest

from viewer.cli import run
from viewer.commands import COMMANDS
from viewer.commands._batch.jobs import JOBS

BASH, ZSH, FISH = map(shutil.which, ("bash", "zsh", "fish"))


def script_of(shell: str, path: Path) -> str:
    """Write the script of a shell to a file, and return its path."""
    command = [sys.executable, "-m", "viewer", "completion", shell]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
    path.write_text(done.stdout)
    return str(path)


@pytest.fixture(scope="module")
def script(tmp_path_factory) -> str:
    """The file of the script that bash sources."""
    return script_of("bash", tmp_path_factory.mktemp("completion") / "viewer.bash")


@pytest.fixture
def models(tmp_path, monkeypatch) -> Path:
    """A model folder, and a folder to work in; the program is found by its name."""
    folder, work = tmp_path / "models", tmp_path / "work"
    folder.mkdir()
    for name in ("SMPLX_NEUTRAL", "SMPLX_FEMALE"):
        (folder / f"{name}.npz").touch()
    (work / "folder").mkdir(parents=True)
    (work / "smooth walk.bvh").touch()
    assert run(["models", "--model-path", str(folder)]) == 0
    monkeypatch.setenv("PATH", str(Path(sys.executable).parent), prepend=os.pathsep)
    return work


def completed(script: str, *words: str, cwd=None) -> list[str]:
    """Return the completions that bash offers for the last word, split as readline does."""
    line = " ".join(("viewer", *words))
    split = re.findall(r"[:=]+|[^:= ]+", line) + [""] * line.endswith(" ")
    listed = " ".join(f'"{word}"' for word in split)
    code = (
        f'source "{script}"; COMP_WORDS=({listed}); COMP_CWORD={len(split) - 1}; '
        f"COMP_LINE='{line}'; COMP_POINT={len(line)}; "
        '_viewer; printf "%s\\n" "${COMPREPLY[@]}"'
    )
    done = subprocess.run(
        [BASH, "--norc", "-c", code], capture_output=True, text=True, timeout=60, cwd=cwd
    )
    assert done.returncode == 0, done.stderr
    return sorted(reply for reply in done.stdout.split("\n") if reply)


@pytest.mark.slow
@pytest.mark.skipif(BASH is None, reason="needs bash")
def test_bash_completes_commands(script):
    assert set(completed(script, "")) == set(COMMANDS)
    assert completed(script, "re") == ["render"]
    assert completed(script, "com") == ["completion"]


@pytest.mark.skipif(BASH is None, reason="needs bash")
def test_bash_completes_options_of_a_command(script):
    found = completed(script, "render", "--")
    assert {"--output", "--size", "--pose"} <= set(found)
    assert completed(script, "lint", "--fail") == ["--fail-on"]


@pytest.mark.skipif(BASH is None, reason="needs bash")
def test_bash_completes_jobs_of_batch_and_their_options(script, tmp_path):
    (tmp_path / "walk.bvh").touch()
    assert set(completed(script, "batch", "")) >= set(JOBS)
    assert completed(script, "batch", "len") == []
    assert {"--to", "--workers", "--fps"} <= set(completed(script, "batch", "convert", "--"))
    assert "--to" not in completed(script, "batch", "lint", "--")
    assert "walk.bvh" in completed(script, "batch", "convert", "wa", cwd=tmp_path)


@pytest.mark.skipif(BASH is None, reason="needs bash")
def test_bash_completes_choices_and_files(script, tmp_path):
    (tmp_path / "walk.bvh").touch()
    assert "never" in completed(script, "lint", "--fail-on", "")
    assert "walk.bvh" in completed(script, "render", "", cwd=tmp_path)
    assert "walk.bvh" in completed(script, "render", "--output", "wa", cwd=tmp_path)


@pytest.mark.slow
@pytest.mark.skipif(BASH is None, reason="needs bash")
def test_bash_completes_names_of_models(script, models):
    """A reply replaces only what follows the last colon or equals sign."""
    names = ["anny", "body", "fox", "smplx", "smplx:female", "smplx:neutral"]
    every = completed(script, "convert", "--model", "", cwd=models)
    assert every == sorted([*names, "folder", "smooth walk.bvh"])
    assert completed(script, "convert", "--model", "smplx:", cwd=models) == ["female", "neutral"]
    assert completed(script, "convert", "--model", "smplx:n", cwd=models) == ["neutral"]
    assert completed(script, "convert", "--model=smplx:n", cwd=models) == ["neutral"]
    assert completed(script, "convert", "--model=fo", cwd=models) == ["folder", "fox"]
    assert completed(script, "rig", "x.obj", "--from", "b", cwd=models) == ["body"]
    assert completed(script, "batch", "convert", "--model", "fo", cwd=models) == ["folder", "fox"]
    assert completed(script, "models", "add", "", cwd=models) == ["anny"]


@pytest.mark.skipif(BASH is None, reason="needs bash")
def test_bash_completes_after_a_word_with_a_colon(script, models):
    assert completed(script, "convert", "--model", "smplx:neutral", "smoo", cwd=models) == [
        "smooth walk.bvh"
    ]
    assert "never" in completed(script, "lint", "--fail-on=", cwd=models)


@pytest.mark.slow
@pytest.mark.skipif(ZSH is None, reason="needs zsh")
def test_zsh_completes_names_of_models(tmp_path, models):
    (tmp_path / "functions").mkdir()
    script_of("zsh", tmp_path / "functions" / "_viewer")
    with Terminal([ZSH, "-f", "-i"], models) as zsh:
        zsh.send(f"fpath=({tmp_path / 'functions'} $fpath); autoload -Uz compinit; compinit -u -D")
        zsh.send("\necho be''gun\n")
        zsh.wait("begun")
        for words, rest in (
            ("convert --model smplx:n", "eutral"),
            ("rig x.obj --from bo", "dy"),
            ("batch convert --model smplx:f", "emale"),
            ("models add ", "anny"),
            ("rig x.obj --from smoo", "th\\ walk.bvh"),
        ):
            zsh.send(f"viewer {words}\t")
            zsh.wait(f"viewer {words}{rest}")
            zsh.send("\x15")  # clears the line


@pytest.mark.slow
@pytest.mark.skipif(FISH is None, reason="needs fish")
def test_fish_completes_names_of_models(tmp_path, models):
    script = script_of("fish", tmp_path / "viewer.fish")

    def offered(line: str) -> list[str]:
        code = f"source {script}; complete -C '{line}'"
        done = subprocess.run(
            [FISH, "--no-config", "-c", code], capture_output=True, text=True, cwd=models
        )
        assert (done.returncode, done.stderr) == (0, "")
        return sorted(reply.partition("\t")[0] for reply in done.stdout.splitlines())

    assert offered("viewer convert --model smplx:") == ["smplx:female", "smplx:neutral"]
    assert offered("viewer convert --model fo") == ["folder/", "fox"]
    assert offered("viewer rig x.obj --from bo") == ["body"]
    assert offered("viewer batch convert --model smplx:n") == ["smplx:neutral"]
    assert offered("viewer models add ") == ["anny"]


class Terminal:
    """A shell in a terminal of its own."""

    def __init__(self, command: list[str], folder: Path) -> None:
        self._seen = ""
        self._handle, inside = pty.openpty()
        self._process = subprocess.Popen(
            command,
            stdin=inside,
            stdout=inside,
            stderr=inside,
            cwd=folder,
            env=os.environ | {"TERM": "dumb", "PS1": "> "},
            start_new_session=True,
        )
        os.close(inside)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self._handle)

    def send(self, text: str) -> None:
        os.write(self._handle, text.encode())

    def wait(self, text: str) -> None:
        """Read until a text is shown, and forget what was shown before its end."""
        end = time.monotonic() + 60
        while text not in self._seen:
            assert time.monotonic() < end, self._seen
            if select.select([self._handle], [], [], 1.0)[0]:
                self._seen += os.read(self._handle, 1 << 16).decode(errors="replace")
        self._seen = self._seen.partition(text)[2]


@pytest.mark.parametrize("shell", ["zsh", "tcsh", "fish"])
def test_scripts_of_other_shells_list_all_commands(capsys, shell):
    assert run(["completion", shell]) == 0
    out = capsys.readouterr().out
    assert all(command in out for command in COMMANDS)


def test_unknown_shell_is_refused(capsys):
    assert run(["completion", "bahs"]) == 2
    assert 'found "bahs"; did you mean bash?' in capsys.readouterr().err
