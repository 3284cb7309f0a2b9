"""Temporary files, which are removed when the process is terminated."""

import pytest

from viewer.formats import save_bytes
from viewer.media.saving import Replacement
from viewer.media.unfinished import remove_unfinished


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
