"""Checks of output paths: refused targets, and several paths of one file."""

import os
from pathlib import Path

import pytest

from viewer.errors import OutputError
from viewer.formats import check_folder_target, check_targets
from viewer.media.output_checks import replacing_since
from viewer.media.saving import free_path


def refused(files, inputs=(), force=False, check=check_targets) -> str:
    with pytest.raises(OutputError) as caught:
        check(files, inputs, force)
    assert caught.value.exit_code == 5
    return str(caught.value)


@pytest.fixture
def old(tmp_path):
    path = tmp_path / "old"
    path.write_bytes(b"old")
    return path


def test_target_that_does_not_exist_is_accepted(tmp_path, old):
    check_targets([tmp_path / "a", tmp_path / "b"], [old, tmp_path / "missing"], False)
    check_targets([old], [], True)
    check_targets([], [old], False)


def test_existing_file_is_refused_even_through_a_link(tmp_path, old):
    (tmp_path / "link").symlink_to("old")
    assert refused([tmp_path / "a", old]).startswith(f"{old}: already exists")
    assert refused([tmp_path / "link"]).startswith(f"{tmp_path / 'link'}: already exists")


@pytest.mark.parametrize("make", [Path.symlink_to, Path.hardlink_to])
def test_input_is_refused_under_any_path(tmp_path, old, make):
    other = tmp_path / "other"
    make(other, old)
    for target, read in ((old, old), (other, old), (old, other)):
        assert refused([target], [read], True) == (f"{target}: input files are never overwritten")


def test_files_in_an_opened_folder_are_inputs(tmp_path):
    folder = tmp_path / "in"
    (folder / "out").mkdir(parents=True)
    (folder / "a").write_bytes(b"a")
    (folder / "out" / "a").write_bytes(b"a")
    (tmp_path / "link").symlink_to("in")
    assert "input" in refused([folder / "a"], [tmp_path / "link"], True)
    assert "input" in refused([tmp_path / "link" / "a"], [folder], True)
    check_targets([folder / "new", folder / "out" / "a"], [folder], True)


def test_one_file_under_two_paths_is_refused(tmp_path, old):
    (tmp_path / "link").symlink_to("old")
    (tmp_path / "nothing").symlink_to("new")
    os.link(old, tmp_path / "hard")
    for pair in (("old", "link"), ("old", "hard"), ("new", "nothing"), ("new", "new")):
        first, second = (tmp_path / name for name in pair)
        words = f"{second}: is the same file as {first}"
        assert refused([tmp_path / "a", first, second], force=True) == words


def test_folders_are_checked(tmp_path, old):
    assert refused([tmp_path]) == f"{tmp_path}: is a folder"
    for folder in (tmp_path / "no", old):
        assert refused([folder / "x"]) == f"{folder / 'x'}: the folder {folder} does not exist"
    (tmp_path / "loop").symlink_to("loop")
    assert refused([tmp_path / "loop"]).startswith(f"{tmp_path / 'loop'}: ")
    assert refused([Path("a\0b")]).startswith("a\\x00b: ")


def test_read_only_folder_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # root may write anywhere
    target = tmp_path / "x"
    assert refused([target]) == f"{target}: the folder {tmp_path} is not writable"


def test_devices_are_never_replaced_and_require_no_force(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    check_targets([Path("/dev/null"), Path("/dev/null"), tmp_path / "pipe"], [], False)


def test_writing_into_an_input_folder_is_refused_by_name(tmp_path):
    (tmp_path / "take" / "smpl").mkdir(parents=True)
    target = tmp_path / "take" / "smpl" / "smpl"
    words = refused(target, [tmp_path / "take" / "smpl"], True, check_folder_target)
    assert words.startswith(f"{tmp_path}/take/smpl: nothing is written into input folders")


@pytest.mark.parametrize("name", ["in", "in/smpl", "link"])
def test_input_folder_is_not_replaced(tmp_path, name):
    (tmp_path / "in" / "smpl").mkdir(parents=True)
    (tmp_path / "link").symlink_to("in")
    target = tmp_path / "in" / "smpl"
    words = refused(target, [tmp_path / name], True, check_folder_target)
    assert words.startswith(f"{target}: input folders are never overwritten")
    assert "input" in refused(tmp_path / "link" / "smpl", [target], True, check_folder_target)


def test_existing_folder_requires_force(tmp_path, old):
    target = tmp_path / "out" / "smpl"
    check_folder_target(target, [old], False)
    target.mkdir(parents=True)
    assert "already exists" in refused(target, [], False, check_folder_target)
    check_folder_target(target, [old], True)
    assert refused(old / "smpl", [], True, check_folder_target).startswith(f"{old}: ")


def test_free_path_avoids_dangling_links(tmp_path):
    (tmp_path / "fox.png").symlink_to("elsewhere.png")
    assert free_path(tmp_path, "fox", ".png") == tmp_path / "fox-2.png"


def test_outputs_of_an_earlier_try_are_replaced_but_nothing_older(tmp_path):
    new, old = tmp_path / "new.obj", tmp_path / "old.obj"
    folder = tmp_path / "smpl"
    folder.mkdir()
    inner = folder / "inner.npz"
    # A second is allowed for differences between clocks.
    for path, seconds in ((new, 1999), (old, 1998), (inner, 2000), (folder, 2000)):
        path.touch()
        os.utime(path, (seconds, seconds))
    with replacing_since(2000):
        check_targets([new], (), force=False)
        check_folder_target(folder, (), force=False)
        with pytest.raises(OutputError, match=r"old\.obj: already exists"):
            check_targets([new, old], (), force=False)
        with pytest.raises(OutputError, match="input files are never overwritten"):
            check_targets([new], [new], force=False)
        os.utime(inner, (1998, 1998))
        with pytest.raises(OutputError, match="smpl: already exists"):
            check_folder_target(folder, (), force=False)
    with pytest.raises(OutputError, match=r"new\.obj: already exists"):
        check_targets([new], (), force=False)
