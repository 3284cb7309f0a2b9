import errno
import os
import stat
from pathlib import Path

import pytest

from viewer.errors import OutputError
from viewer.media import saving
from viewer.media.saving import as_words, save_bytes, save_text


def refused(path, data=b"new"):
    with pytest.raises(OutputError) as caught:
        save_bytes(path, data)
    assert caught.value.exit_code == 5
    return str(caught.value)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_save_creates_a_file(tmp_path):
    save_bytes(tmp_path / "a.skel", b"new")
    assert (tmp_path / "a.skel").read_bytes() == b"new"
    assert names(tmp_path) == ["a.skel"]


def test_save_replaces_a_file(tmp_path):
    (tmp_path / "a.skel").write_bytes(b"something longer")
    save_bytes(str(tmp_path / "a.skel"), b"new")
    assert (tmp_path / "a.skel").read_bytes() == b"new"
    assert names(tmp_path) == ["a.skel"]


def test_save_text_writes_utf8_lf_and_preserves_invalid_bytes(tmp_path):
    save_text(tmp_path / "a.skel", "é\n\udce9\n")
    assert (tmp_path / "a.skel").read_bytes() == b"\xc3\xa9\n\xe9\n"


def test_save_accepts_unusual_names(tmp_path):
    for name in ["with blank {}%s.skel", "new\nline.skel", "é\udcff.skel", "x" * 250 + ".skel"]:
        save_bytes(tmp_path / name, b"new")
        assert (tmp_path / name).read_bytes() == b"new"


def test_save_keeps_permissions(tmp_path):
    path = tmp_path / "a.skel"
    path.write_bytes(b"old")
    path.chmod(0o640)
    save_bytes(path, b"new")
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


@pytest.mark.parametrize(("mask", "mode"), [(0o022, 0o644), (0o077, 0o600), (0o002, 0o664)])
def test_save_applies_the_umask_to_a_new_file(tmp_path, mask, mode):
    before = os.umask(mask)
    try:
        save_bytes(tmp_path / "a.skel", b"new")
        assert os.umask(mask) == mask  # the umask is unchanged
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a.skel").stat().st_mode) == mode


def test_save_follows_a_link(tmp_path):
    (tmp_path / "folder").mkdir()
    target, link = tmp_path / "folder" / "real.skel", tmp_path / "link.skel"
    target.write_bytes(b"old")
    link.symlink_to("folder/real.skel")
    save_bytes(link, b"new")
    assert link.is_symlink()
    assert target.read_bytes() == b"new"
    assert names(tmp_path / "folder") == ["real.skel"]


def test_save_through_a_dangling_link_creates_its_target(tmp_path):
    (tmp_path / "link.skel").symlink_to("real.skel")
    save_bytes(tmp_path / "link.skel", b"new")
    assert (tmp_path / "link.skel").is_symlink()
    assert (tmp_path / "real.skel").read_bytes() == b"new"


def test_save_refuses_a_folder(tmp_path):
    assert refused(tmp_path) == f"{tmp_path}: is a folder"
    assert names(tmp_path) == []


def test_save_refuses_a_missing_folder(tmp_path):
    path = tmp_path / "missing" / "a.skel"
    assert refused(path) == f"{path}: the folder {path.parent} does not exist"
    assert names(tmp_path) == []


def test_save_refuses_a_path_through_a_file(tmp_path):
    (tmp_path / "a").write_bytes(b"old")
    assert refused(tmp_path / "a" / "b.skel") == f"{tmp_path / 'a' / 'b.skel'}: Not a directory"
    assert (tmp_path / "a").read_bytes() == b"old"


def test_save_refuses_a_circular_link(tmp_path):
    (tmp_path / "loop").symlink_to("loop")
    text = refused(tmp_path / "loop")
    assert text.startswith(f"{tmp_path / 'loop'}: ")
    assert names(tmp_path) == ["loop"]


def test_save_refuses_an_invalid_name(tmp_path):
    text = refused(f"{tmp_path}/a\0b.skel")
    assert text.startswith(f"{tmp_path}/a\\x00b.skel: ")
    assert "embedded null" in text
    assert "\n" not in refused(tmp_path / ("x" * 300))


def test_save_shows_an_unusual_name_on_one_line(tmp_path):
    assert refused(tmp_path / "new\nline" / "a") == (
        f"{tmp_path}/new\\nline/a: the folder {tmp_path}/new\\nline does not exist"
    )


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has /dev/full")
def test_save_reports_a_full_device():
    assert refused("/dev/full") == "/dev/full: No space left on device"
    assert stat.S_ISCHR(Path("/dev/full").stat().st_mode)


def test_save_writes_through_a_device():
    save_bytes("/dev/null", b"new")
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)


def test_save_writes_through_a_pipe(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    try:
        save_bytes(tmp_path / "pipe", b"new")
        assert os.read(reader, 10) == b"new"
    finally:
        os.close(reader)
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


def test_save_refuses_a_folder_that_cannot_be_written(tmp_path):
    folder = tmp_path / "locked"
    folder.mkdir()
    folder.chmod(0o555)
    if os.access(folder, os.W_OK):
        # Only kernel file systems are not writable for root.
        assert refused("/proc/a.skel").startswith("/proc/a.skel: ")
    else:
        assert refused(folder / "a.skel") == f"{folder / 'a.skel'}: Permission denied"


@pytest.mark.parametrize("step", ["fsync", "fdopen"])
def test_failure_before_the_rename_keeps_the_old_file(tmp_path, monkeypatch, step):
    (tmp_path / "a.skel").write_bytes(b"old")

    def fail(*args):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(saving.os, step, fail)
    assert refused(tmp_path / "a.skel") == f"{tmp_path / 'a.skel'}: Input/output error"
    assert (tmp_path / "a.skel").read_bytes() == b"old"
    assert names(tmp_path) == ["a.skel"]


@pytest.mark.parametrize("step", ["replace", "chmod"])
def test_failure_of_the_rename_keeps_the_old_file(tmp_path, monkeypatch, step):
    (tmp_path / "a.skel").write_bytes(b"old")

    def fail(*args):
        raise PermissionError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(Path, step, fail)
    assert refused(tmp_path / "a.skel") == f"{tmp_path / 'a.skel'}: Operation not permitted"
    assert (tmp_path / "a.skel").read_bytes() == b"old"
    assert names(tmp_path) == ["a.skel"]


def test_interrupt_leaves_no_temporary_file(tmp_path, monkeypatch):
    (tmp_path / "a.skel").write_bytes(b"old")

    def interrupt(*args):
        raise KeyboardInterrupt

    monkeypatch.setattr(saving.os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        save_bytes(tmp_path / "a.skel", b"new")
    assert (tmp_path / "a.skel").read_bytes() == b"old"
    assert names(tmp_path) == ["a.skel"]


def test_file_size_limit_keeps_the_old_file(tmp_path):
    resource = pytest.importorskip("resource")
    path = tmp_path / "a.skel"
    path.write_bytes(b"old")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        # Python ignores SIGXFSZ, so the write itself fails.
        text = refused(path, b"x" * 100_000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert text == f"{path}: File too large"
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == ["a.skel"]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("", []),
        ("left leg", [b"left", b"leg"]),
        ("a\xa0b", [b"a\xc2\xa0b"]),
        ("\udce9", [b"\xe9"]),
        (" leg", None),
        ("left  leg", None),
        ("left\tleg", None),
        ("a{b", None),
        ("}", None),
        ("\ud800", None),
        ("\udcc3\udca9", None),  # these bytes would be read back as a UTF-8 letter
    ],
)
def test_as_words_accepts_only_text_that_round_trips(name, words):
    assert as_words(name) == words
