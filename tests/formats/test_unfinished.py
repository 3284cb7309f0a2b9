"""Temporary files, which are removed when the process is terminated."""

import pytest

from viewer.formats import save_bytes
from viewer.media.saving import Replacement, save_parts
from viewer.media.unfinished import remove_leftovers, remove_unfinished


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
