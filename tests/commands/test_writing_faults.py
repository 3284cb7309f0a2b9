"""Every output format on a full disk, with failures at each write and each fill level."""

import errno
import os
from itertools import count
from pathlib import Path

import pytest
from commands.writing_runs import (
    Inputs,
    contents,
    converting,
    drawing,
    into,
    write_inputs,
)

from viewer.cli import run
from viewer.media import saving

pytestmark = pytest.mark.slow

CONVERTING = [*converting(Inputs()), "people as a folder"]
PICTURES = [case for case in drawing(Inputs()) if not case.startswith("v.")]
FULL = os.strerror(errno.ENOSPC)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    return write_inputs(tmp_path_factory.mktemp("inputs"))


def command_of(inputs: Inputs, case: str, folder: Path) -> list[str]:
    if case == "people as a folder":
        return ["convert", *inputs.recording, "-o", str(folder / "new"), "--force"]
    return into(folder, (converting(inputs) | drawing(inputs))[case], "--force")


class FullDisk:
    """A disk that is full from the n-th write on, half of which is written."""

    def __init__(self, monkeypatch, number: int) -> None:
        self.calls, self.number = 0, number
        opened, write_text = os.fdopen, Path.write_text
        monkeypatch.setattr(saving.os, "fdopen", lambda *a: _Stream(opened(*a), self))

        def written(path, text, **settings):  # frames in a folder are written without a rename
            self.meet(lambda half: write_text(path, half, **settings), text)
            return write_text(path, text, **settings)

        monkeypatch.setattr(Path, "write_text", written)

    @property
    def has_struck(self) -> bool:
        return self.calls >= self.number

    def meet(self, write, data) -> None:
        self.calls += 1
        if self.has_struck:
            if self.calls == self.number:
                write(data[: len(data) // 2])
            raise OSError(errno.ENOSPC, FULL)


class _Stream:
    def __init__(self, stream, disk: FullDisk) -> None:
        self.stream, self.disk = stream, disk
        self.flush, self.fileno = stream.flush, stream.fileno

    def __enter__(self):
        return self

    def __exit__(self, *problem):
        self.stream.close()

    def write(self, data):
        self.disk.meet(self.stream.write, data)
        return self.stream.write(data)


def refused(code: int, capsys, folder: Path) -> None:
    captured = capsys.readouterr()
    lines = [
        one for one in captured.err.splitlines() if not one.startswith(("warning: ", "note: "))
    ]
    assert code == 5 and len(lines) == 1, captured
    assert lines[0].startswith(f"viewer: {folder}") and lines[0].endswith(f": {FULL}"), lines


@pytest.mark.parametrize("is_there", [False, True], ids=["new", "replaced"])
@pytest.mark.parametrize("case", CONVERTING + PICTURES)
def test_failure_at_any_write_changes_no_file(
    inputs, tmp_path, monkeypatch, capsys, case, is_there
):
    folder = tmp_path / "out"
    folder.mkdir()
    command = command_of(inputs, case, folder)
    if is_there:
        assert run(command) == 0
        for name in contents(folder):
            if Path(name).suffix not in (".png", ".mtl"):  # these names depend on their contents
                (folder / name).write_bytes(f"precious {name}".encode())
    before = contents(folder)
    for number in count(1):
        capsys.readouterr()
        with monkeypatch.context() as patch:
            disk = FullDisk(patch, number)
            code = run(command)
        if not disk.has_struck:
            break
        refused(code, capsys, folder)
        found = contents(folder)
        if case.startswith("f_"):
            # Finished numbered images are kept, and no image is incomplete.
            found = {name: before.get(name, data) for name, data in found.items()}
            assert {name for name in found if name.startswith(".")} == set()
            found = {name: data for name, data in found.items() if name in before}
        assert found == before
    assert code == 0 and number > 1


@pytest.mark.parametrize("case", CONVERTING)
def test_every_disk_fill_level_keeps_existing_files(inputs, tiny_disk, capsys, case):
    folder, codes = tiny_disk / "out", []
    command = command_of(inputs, case, folder)
    for level in range(0, 17, 2):
        folder.mkdir()
        # tmpfs counts only the blocks of file contents.
        (tiny_disk / "fill").write_bytes(bytes(4096 * level))
        capsys.readouterr()
        codes.append(run(command))
        if codes[-1]:
            refused(codes[-1], capsys, folder)
            assert contents(folder) == {}
        names = [path.name for path in folder.rglob(".*")]
        assert names == []
        for path in sorted(folder.rglob("*"), reverse=True):
            path.rmdir() if path.is_dir() else path.unlink()
        folder.rmdir()
        (tiny_disk / "fill").unlink()
    # No run succeeds with less space than a failed run.
    assert codes == sorted(codes) and codes[-1] == 5
