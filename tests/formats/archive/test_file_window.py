"""Large pickles, of which only the required bytes are read."""

from pathlib import Path

import numpy as np
import pytest
from formats.archive.joblib_bytes import joblib_file
from formats.npz_bytes import cost
from numpy.testing import assert_array_equal

from viewer.errors import FormatError
from viewer.formats._archive.opening import open_archive
from viewer.formats._archive.zip import FileWindow, StoredFile
from viewer.formats._pickle.machine import Machine
from viewer.formats._pickle.reading import named_archive
from viewer.formats._source import Source
from viewer.rig.arrays import Deferred

PAGE = 1 << 16
SIZE = 3 * PAGE + 5


@pytest.fixture
def data() -> bytes:
    return np.random.default_rng(0).bytes(SIZE)


def window(data: bytes, folder: Path) -> FileWindow:
    path = folder / "a.pkl"
    path.write_bytes(data)
    return FileWindow(StoredFile(Source.open(path)))


def test_windows_have_the_bytes_of_the_file(data: bytes, tmp_path: Path) -> None:
    found = window(data, tmp_path)
    assert len(found) == SIZE
    for place in (0, 7, PAGE - 1, PAGE, 2 * PAGE + 3, 5, SIZE - 1):
        assert found[place] == data[place]
    for start, stop in ((0, 9), (PAGE - 3, PAGE + 3), (1, 3 * PAGE), (SIZE - 2, SIZE + 9), (9, 9)):
        assert found[start:stop] == data[start:stop]


@pytest.mark.parametrize("place", [3, (1 << 20) - 1, (1 << 20) + 9])
def test_bytes_are_found_across_page_borders(place: int, tmp_path: Path) -> None:
    text = bytearray((1 << 20) + 99)
    text[place : place + 2] = b"ab"
    found = window(bytes(text), tmp_path)
    assert found.find(b"ab", 0, len(found)) == place
    assert found.find(b"ab", place + 1, len(found)) == -1
    assert found.find(b"ab", 0, place + 1) == -1


def test_pickles_are_read_through_a_window(tmp_path: Path) -> None:
    rows = np.arange(6.0).reshape(2, 3)
    found = window(joblib_file({"v": rows, "t": "text", "n": [1.5, 7]}), tmp_path)
    source = Source.open(tmp_path / "a.pkl")
    machine = Machine(source, found)
    archive = named_archive(source, "pickle", len(found), machine.run())
    assert_array_equal(archive.array("v").values(), rows)
    assert (archive.get("t"), archive.get("n")) == ("text", [1.5, 7])


def test_unused_arrays_of_large_files_are_not_read(tmp_path: Path) -> None:
    path = tmp_path / "a.pkl"
    path.write_bytes(joblib_file({"verts": np.zeros(34 << 20, np.uint8), "v": np.arange(3)}))

    def look() -> None:
        assert open_archive(Source.open(path)).array("v").values().tolist() == [0, 1, 2]

    assert cost(look) < 4 << 20


def test_files_that_change_while_open_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.pkl"
    path.write_bytes(joblib_file({"v": np.zeros(34 << 20, np.uint8)}))
    later = open_archive(Source.open(path)).get("v")
    path.write_bytes(b"short")
    assert isinstance(later, Deferred)
    with pytest.raises(FormatError) as caught:
        later.values()
    assert caught.value.diagnostic is not None
    assert caught.value.diagnostic.key == "F002.changed"
