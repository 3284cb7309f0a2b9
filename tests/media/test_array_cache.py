"""Cached arrays, which are used only for exactly the bytes from which they were computed."""

import os
import struct
import threading
from pathlib import Path

import numpy as np
import pytest

from viewer.cli import run
from viewer.formats._text import numbers
from viewer.formats._text.numbers import parse_numbers
from viewer.media import array_cache, image
from viewer.media.array_cache import Slot, cache_folder, cache_use, slot_of
from viewer.media.image import decode_picture
from viewer.media.png import encode_png

TEXT = b"".join(b"%d.5 -%d\n" % (number, number) for number in range(4000))
VALUES = np.stack([np.arange(4000) + 0.5, -np.arange(4000.0)], axis=1).ravel()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("VIEWER_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def slot(text: bytes = TEXT) -> Slot:
    found = slot_of("numbers-1", text, 0, len(text))
    assert found is not None
    return found


def entry(folder: Path) -> Path:
    (path,) = folder.iterdir()
    return path


def forbid(monkeypatch: pytest.MonkeyPatch, module: object, name: str) -> None:
    """Make a function fail if it is called."""
    monkeypatch.setattr(module, name, lambda *_, **__: pytest.fail(f"{name} was called"))


def test_second_run_uses_the_cached_array(folder, monkeypatch):
    data = b"positions " + TEXT + b"}"
    for _ in range(2):
        values, bad = parse_numbers(data, 10, 10 + len(TEXT))
        assert bad == -1
        np.testing.assert_array_equal(values, VALUES)
        forbid(monkeypatch, numbers, "_parse")
    values[0] = 7.0  # callers own the returned array
    assert parse_numbers(TEXT, 0, len(TEXT))[0][0] == 0.5


def test_changed_text_is_parsed_again(folder):
    parse_numbers(TEXT, 0, len(TEXT))
    changed = TEXT.replace(b"17.5", b"18.5", 1)
    assert len(changed) == len(TEXT)
    assert parse_numbers(changed, 0, len(changed))[0][34] == 18.5


def test_equal_checksum_and_length_are_not_sufficient(folder):
    slot().store(VALUES)
    other = slot(TEXT.replace(b"17.5", b"18.5", 1))
    other.path = entry(folder)  # as if the checksums of both texts were equal
    assert other.load("<f8", 1) is None


def test_invalid_text_is_not_cached(folder):
    faulty = TEXT + b"x 1"
    for _ in range(2):
        assert parse_numbers(faulty, 0, len(faulty))[1] == len(VALUES)
    assert not folder.exists()


def test_short_texts_are_not_cached(folder):
    parse_numbers(b"1 2 3", 0, 5)
    assert not folder.exists()


@pytest.mark.parametrize("place", [0, 17, 24, 33, 40, 60, -9, -1])
def test_damaged_entry_is_ignored_and_replaced(folder, place):
    slot().store(VALUES)
    data = bytearray(entry(folder).read_bytes())
    data[place] ^= 1
    entry(folder).write_bytes(data)
    assert slot().load("<f8", 1) is None
    parse_numbers(TEXT, 0, len(TEXT))
    np.testing.assert_array_equal(slot().load("<f8", 1), VALUES)


@pytest.mark.parametrize("size", [0, 10, 56, 1000, -1])
def test_truncated_entry_is_ignored(folder, size):
    slot().store(VALUES)
    entry(folder).write_bytes(entry(folder).read_bytes()[:size])
    assert slot().load("<f8", 1) is None


def test_entry_of_a_different_version_type_or_shape_is_ignored(folder, monkeypatch):
    slot().store(VALUES)
    assert slot().load("|u1", 1) is None
    assert slot().load("<f8", 2) is None
    monkeypatch.setattr(array_cache, "_MAGIC", b"viewer 99".ljust(16, b"\0"))
    assert slot().load("<f8", 1) is None


def test_only_the_user_may_read_or_write_entries(folder):
    slot().store(VALUES)
    assert folder.stat().st_mode & 0o777 == 0o700
    assert entry(folder).stat().st_mode & 0o777 == 0o600
    entry(folder).chmod(0o622)
    assert slot().load("<f8", 1) is None


def test_different_shapes_of_equal_size_are_ignored(folder):
    slot().store(VALUES.reshape(4000, 2))
    data = entry(folder).read_bytes()
    for axes in ((2, 4000), (1 << 62, 0)):
        cut = data[: 56 + len(TEXT)] if 0 in axes else data
        entry(folder).write_bytes(cut[:32] + struct.pack("<2Q", *axes) + cut[48:])
        assert slot().load("<f8", 2) is None
    entry(folder).write_bytes(data)
    assert slot().load("<f8", 2) is not None


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_pipes_are_ignored_without_waiting(folder):
    folder.mkdir()
    os.mkfifo(slot().path)
    assert slot().load("<f8", 1) is None


def test_links_are_not_followed(folder, tmp_path):
    slot().store(VALUES)
    path = entry(folder)
    path.rename(tmp_path / "moved")
    path.symlink_to(tmp_path / "moved")
    assert slot().load("<f8", 1) is None


@pytest.mark.parametrize("what", ["file", "below a file", "no room"])
def test_unusable_folder_silently_disables_the_cache(what, tmp_path, monkeypatch, tiny_disk):
    (tmp_path / "file").write_text("")
    places = {"file": tmp_path / "file", "below a file": tmp_path / "file/x", "no room": tiny_disk}
    monkeypatch.setenv("VIEWER_CACHE", str(places[what]))
    values, bad = parse_numbers(TEXT, 0, len(TEXT))
    assert (len(values), bad) == (len(VALUES), -1)
    assert not [*tiny_disk.iterdir()]
    assert cache_use() == (0, 0)


def test_oldest_entries_are_removed_if_there_are_too_many(folder, monkeypatch):
    size = 56 + len(TEXT) + VALUES.nbytes
    monkeypatch.setattr(array_cache, "LIMIT", 4 * size)
    texts = [TEXT[:-5] + b"%04d\n" % number for number in range(5)]
    for age, text in enumerate(texts[:4]):
        slot(text).store(VALUES)
        os.utime(slot(text).path, (1000 + age, 1000 + age))
    assert slot(texts[0]).load("<f8", 1) is not None  # now it is the most recently used one
    slot(texts[4]).store(VALUES)
    kept = [slot(text).load("<f8", 1) is not None for text in texts]
    assert kept == [True, False, False, True, True]
    assert cache_use() == (3, 3 * size)


def test_concurrent_threads_leave_one_valid_entry(folder):
    threads = [threading.Thread(target=slot().store, args=(VALUES,)) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    np.testing.assert_array_equal(slot().load("<f8", 1), VALUES)
    assert entry(folder) == slot().path


def test_pixels_of_an_image_are_cached(folder, monkeypatch):
    pixels = np.random.default_rng(0).integers(0, 256, (100, 120, 4), dtype=np.uint8)
    data = encode_png(pixels)
    for _ in range(2):
        found = decode_picture(Path("a.png"), data)
        np.testing.assert_array_equal(found, pixels)
        assert not found.flags.writeable
        forbid(monkeypatch, image, "decode_pictures")


def test_option_and_variable_disable_the_cache(folder, tmp_path, monkeypatch, capsys):
    rows = {
        "positions": [f"{n}.25 {n}.5 1" for n in range(4000)],
        "normals": ["0 0 1"] * 4000,
        "skinweights": ["1 0 1"] * 4000,
        "triangles": ["0 1 2"],
        "bindings": ["matrix { 1 0 0 0 1 0 0 0 1 0 0 0 }"],
    }
    sections = (f"{name} {len(lines)} {{ {' '.join(lines)} }}" for name, lines in rows.items())
    (tmp_path / "a.skin").write_text("\n".join(sections))
    command = ["info", str(tmp_path / "a.skin")]
    assert run([*command, "--no-cache"]) == 0
    plain = capsys.readouterr().out
    monkeypatch.setenv("VIEWER_CACHE", "off")
    assert run(command) == 0
    assert cache_folder() is None
    assert not folder.exists()
    monkeypatch.setenv("VIEWER_CACHE", str(folder))
    for _ in range(2):
        assert run(command) == 0
        assert [*folder.iterdir()]
    assert capsys.readouterr().out == 3 * plain


@pytest.mark.skipif(os.name != "posix", reason="locations on Linux")
def test_default_folder_is_that_of_platformdirs(tmp_path, monkeypatch):
    import platformdirs

    monkeypatch.delenv("VIEWER_CACHE")
    for value in (str(tmp_path), "", "  "):
        monkeypatch.setenv("XDG_CACHE_HOME", value)
        expected = Path(platformdirs.user_cache_dir("viewer", appauthor=False)) / "arrays"
        assert cache_folder() == expected


def test_folder_may_be_relative_or_below_the_home_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path))
    for value in ("kept", "~/kept"):
        monkeypatch.setenv("VIEWER_CACHE", value)
        assert cache_folder() == tmp_path / "kept"


def test_doctor_shows_the_folder_and_its_size(folder, monkeypatch):
    from viewer.commands import doctor

    slot().store(VALUES)
    found = doctor._examine_cache().found
    assert str(folder) in found
    assert "1 array, 0.1 of at most 537 MB" in found
    monkeypatch.setenv("VIEWER_CACHE", "off")
    assert "VIEWER_CACHE" in doctor._examine_cache().found
