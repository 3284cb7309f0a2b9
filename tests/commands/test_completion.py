"""Shell completion, tested in a real bash."""

import shutil
import subprocess
import sys

import pytest

from viewer.cli import run
from viewer.commands import COMMANDS
from viewer.commands._batch.jobs import JOBS

BASH = shutil.which("bash")


@pytest.fixture(scope="module")
def script(tmp_path_factory) -> str:
    """The file of the script that bash sources."""
    command = [sys.executable, "-m", "viewer", "completion", "bash"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
    path = tmp_path_factory.mktemp("completion") / "viewer.bash"
    path.write_text(done.stdout)
    return str(path)


def completed(script: str, *words: str, cwd=None) -> list[str]:
    """Return the completions that bash offers for the last word."""
    listed = " ".join(f'"{word}"' for word in ("viewer", *words))
    code = (
        f'source "{script}"; COMP_WORDS=({listed}); COMP_CWORD={len(words)}; '
        '_shtab_viewer viewer "${COMP_WORDS[COMP_CWORD]}"; printf "%s\\n" "${COMPREPLY[@]}"'
    )
    done = subprocess.run(
        [BASH, "--norc", "-c", code], capture_output=True, text=True, timeout=60, cwd=cwd
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


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


@pytest.mark.parametrize("shell", ["zsh", "tcsh", "fish"])
def test_scripts_of_other_shells_list_all_commands(capsys, shell):
    assert run(["completion", shell]) == 0
    out = capsys.readouterr().out
    assert all(command in out for command in COMMANDS)


def test_unknown_shell_is_refused(capsys):
    assert run(["completion", "bahs"]) == 2
    assert 'found "bahs"; did you mean bash?' in capsys.readouterr().err
