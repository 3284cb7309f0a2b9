"""Temporary files, which are removed when the process is terminated."""

import os
import subprocess
import sys

import pytest

from viewer.formats import save_bytes
from viewer.media.saving import Replacement, save_parts
from viewer.media.unfinished import new_prefix, remove_leftovers, remove_unfinished


def test_finished_files_stay_and_unfinished_files_are_removed(tmp_path):
    save_bytes(tmp_path / "done.txt", b"whole")
    finished, begun = Replacement(tmp_path / "a.mp4"), Replacement(tmp_path / "b.mp4")
    finished.begin().write_bytes(b"video")
    finished.commit()
    begun.begin().write_bytes(b"half")
    assert len(list(tmp_path.iterdir())) == 3
    remove_unfinished()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mp4", "done.txt"]


def test_file_being_written_is_removed(tmp_path, monkeypatch):
    kept = tmp_path / "x.txt"
    kept.write_bytes(b"old")

    def end(handle):
        remove_unfinished()
        assert [path.name for path in tmp_path.iterdir()] == ["x.txt"]
        raise KeyboardInterrupt

    monkeypatch.setattr("os.fsync", end)
    with pytest.raises(KeyboardInterrupt):
        save_bytes(kept, b"new")
    assert kept.read_bytes() == b"old"


LONG = "2023-11-23_laboratory_capture_subject_seven_walk_0"


@pytest.mark.parametrize("name", ("walk.bvh", f"{LONG}1.bvh"))
def test_leftovers_of_a_file_are_removed(tmp_path, name, monkeypatch):
    target = tmp_path / name
    monkeypatch.setattr("os.unlink", lambda *_: None)  # as if the process had been killed
    with pytest.raises(KeyError):
        save_parts(target, failing())
    Replacement(target).begin().write_bytes(b"half")
    assert len(list(tmp_path.iterdir())) == 2
    monkeypatch.undo()
    remove_leftovers([str(target)])
    assert list(tmp_path.iterdir()) == []


def failing():
    yield b"half"
    raise KeyError


def test_leftovers_of_other_files_and_hidden_files_stay(tmp_path):
    """Another process may be writing a file whose long name begins with the same characters."""
    for name in (".walk.bvh.original", ".walk.bvh.12345678", ".walk.original.bvh"):
        (tmp_path / name).write_bytes(b"of the user")
    one, other = tmp_path / f"{LONG}1.bvh", tmp_path / f"{LONG}2.bvh"

    def parts():
        yield b"whole "
        remove_leftovers([str(other), str(tmp_path / "walk.bvh")])
        yield b"file"

    save_parts(one, parts())
    assert one.read_bytes() == b"whole file"
    assert len(list(tmp_path.iterdir())) == 4


WRITER = """
import os, sys
from pathlib import Path
from viewer.media.saving import Replacement, save_parts

def parts():
    yield b"half"
    Path(sys.argv[1], "begun").touch()
    os.kill(os.getpid(), 9)

Replacement(Path(sys.argv[1], "a.mp4")).begin()
save_parts(Path(sys.argv[1], "b.txt"), parts())
"""


@pytest.mark.skipif(os.name != "posix", reason="asks for processes")
def test_next_run_removes_what_a_killed_one_left_and_nothing_else(tmp_path):
    subprocess.run([sys.executable, "-c", WRITER, str(tmp_path)], check=False)
    left = [path.name for path in tmp_path.iterdir() if path.name != "begun"]
    assert len(left) == 2
    dead = next(name for name in left if name.startswith(".b.txt"))
    elsewhere = f"{dead[:10]}{'0' * 8}{dead[18:]}"  # a process of another machine
    alive = dead.replace(dead.split("-")[1], str(os.getpid()))
    assert dead.startswith(".b.txt.tmp") and elsewhere != dead != alive
    folder = tmp_path / dead.replace(".b.txt", ".smpl")
    (folder / "new").mkdir(parents=True)
    for name in (elsewhere, alive, ".b.txt.tmpabcd0123", dead[1:], ".notes.tmp"):
        (tmp_path / name).touch()
    save_bytes(tmp_path / "c.txt", b"whole")
    names = {path.name for path in tmp_path.iterdir()}
    kept = {elsewhere, alive, ".b.txt.tmpabcd0123", dead[1:], ".notes.tmp"}
    assert names == {"begun", "c.txt", *kept}
    # A folder is searched once: writing thousands of files takes no longer.
    (tmp_path / dead).touch()
    save_bytes(tmp_path / "d.txt", b"whole")
    assert (tmp_path / dead).exists() and new_prefix(tmp_path, "d.txt").startswith(".d.txt.tmp")
