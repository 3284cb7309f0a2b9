"""Opening of pickles, ``.npz`` and ``.npy``, and access to their values."""

import io
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from faults import Fault, fault_of
from formats.archive.joblib_bytes import joblib_file
from formats.npz_bytes import cost
from numpy.testing import assert_array_equal

from viewer.errors import FormatError
from viewer.formats._archive.checking import are_indices
from viewer.formats._archive.opening import is_archive, open_archive
from viewer.formats._archive.values import Archive, Opaque, Sparse
from viewer.formats._archive.zip import FileWindow, StoredFile
from viewer.formats._pickle.machine import Machine
from viewer.formats._pickle.reading import named_archive
from viewer.formats._source import Source
from viewer.rigs.arrays import Deferred

ROWS = np.arange(12.0).reshape(4, 3) / 8


def npz(**arrays: Any) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def npy(array: Any) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def opened(data: bytes, name: str = "x.npz") -> Archive:
    return open_archive(Source(name, data))


def refused(action: Any, *arguments: Any) -> Fault:
    """Return the refusal of a call, which must include the file name."""
    with pytest.raises(FormatError) as caught:
        action(*arguments)
    assert str(caught.value).isprintable() and caught.value.path is not None
    return fault_of(caught.value.diagnostic)


@pytest.mark.parametrize(
    ("data", "kind", "keys"),
    [
        (npz(v=ROWS), "npz", ("v",)),
        (npz(), "npz", ()),
        (npy(ROWS), "npy", ("arr_0",)),
        *((pickle.dumps({"v": ROWS}, protocol), "pickle", ("v",)) for protocol in range(6)),
        (b"(dp1\nS'v'\nI1\ns.", "pickle", ("v",)),
        (b"}.", "pickle", ()),
        (b"(d.", "pickle", ()),
    ],
)
def test_content_takes_precedence_over_the_file_name(data, kind, keys):
    assert is_archive(data[:64])
    for name in ("x.pkl", "x.npz", "x.txt"):
        archive = opened(data, name)
        assert (archive.kind, archive.keys, archive.source.path) == (kind, keys, Path(name))


@pytest.mark.parametrize("protocol", range(6))
@pytest.mark.parametrize("value", [{}, {"a": 1}, [1], ROWS, {1: 2}, []])
def test_pickles_are_recognised_by_their_first_bytes(value, protocol):
    assert is_archive(pickle.dumps(value, protocol)[:64])


@pytest.mark.parametrize(
    "head",
    [
        b"",
        b"positions 4 {",
        b"balljoint root {",
        b"animation {",
        b"HIERARCHY\nROOT Hips",
        b"glTF\x02\0\0\0",
        b'{"asset": {}}',
        b"{}",
        b"[]",
        b"[[0, 1]]",
        b"# obj\nv 0 0 0",
        b"cube\nof\n",
        b"<html>",
        b"\x89PNG\r\n",
        b"\x1f\x8b\x08",
        b"\x80\x06",
        b"\x80\x01",
        b"0.1 0.2 0.3\n",
        b"}\n",
        b"(1, 2)",
    ],
)
def test_other_files_are_not_archives(head):
    assert not is_archive(head)


@pytest.mark.parametrize(
    ("data", "found"),
    [
        (b"", ("F002.archive", None, {"found": "an empty file"})),
        (b" \n", ("F002.archive", None, {"found": "only white space"})),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 39\n",
         ("F002.archive-pointer", None, {})),
        (b"<!DOCTYPE html><html>Sign in</html>", ("F002.archive", None,
         {"found": "HTML or XML (a failed download?)"})),
        (b"\x1f\x8b\x08\0\0\0", ("F002.archive", None, {"found": "gzip data"})),
        (b"%PDF-1.7", ("F002.archive", None, {"found": "a PDF document"})),
        (bytes(1000), ("F002.archive", None, {"found": "zeros"})),
    ],
)  # fmt: skip
def test_unsuitable_files_are_described(data, found):
    assert refused(opened, data, "SMPL_MALE.pkl") == found


@pytest.mark.parametrize("protocol", [0, 1, 2])
def test_damage_by_text_mode_transfer_is_reported(protocol):
    data = pickle.dumps({"v": np.arange(13.0)}, protocol).replace(b"\n", b"\r\n")
    assert refused(opened, data, "x.pkl") == (("F002.pickle-line-ends", None, {}))


def test_text_that_is_not_a_pickle_is_refused():
    line = refused(opened, b"positions 4 {\n", "x.pkl")
    assert line == ("F002.archive", None, {"found": "an unknown format"})


def test_single_array_is_read(tmp_path):
    path = tmp_path / "x.npy"
    np.save(path, ROWS)
    for source in (Source.open(path), Source("x.npy", path.read_bytes())):
        found = open_archive(source).array("arr_0", ("V", 3)).values()
        assert_array_equal(found, ROWS)
        assert not found.flags.writeable


def test_single_array_may_end_like_text(tmp_path):
    """Byte 26 ends a text file, but may be part of an array."""
    path = tmp_path / "x.npy"
    np.save(path, np.array([1, 26], np.uint8))
    source = Source.open(path)
    assert source.data.endswith(b"\1")
    assert open_archive(source).array("arr_0").values().tolist() == [1, 26]


def test_opening_does_not_read_large_files(tmp_path):
    path = tmp_path / "x.npz"
    np.savez(path, v=ROWS)
    source = Source.open(path)
    open_archive(source).array("v").values()
    assert source._data is None


def test_missing_file_is_refused(tmp_path):
    path = tmp_path / "x.npz"
    np.savez(path, v=ROWS)
    source = Source.open(path)
    path.unlink()
    assert refused(open_archive, source) == (
        "F001.unreadable",
        None,
        {"reason": "No such file or directory", "near": ""},
    )


@pytest.mark.parametrize(
    ("shape", "kinds", "message"),
    [
        (None, "biuf", None),
        ((4, 3), "biuf", None),
        ((None, 3), "f", None),
        (("V", "C"), "biuf", None),
        ((4,), "biuf", ("F002.value", None, {"item": "v", "expected": "4 numbers",
         "found": "4 x 3 float64"})),
        ((), "biuf", ("F002.value", None, {"item": "v",
         "expected": "a single number", "found": "4 x 3 float64"})),
        (("V", 4), "biuf", ("F002.value", None, {"item": "v", "expected": "V x 4 numbers",
         "found": "4 x 3 float64"})),
        (("J", "J"), "biuf", ("F002.value", None, {"item": "v",
         "expected": "J x J numbers", "found": "4 x 3 float64"})),
        ((None, 3, None), "biuf", ("F002.value", None, {"item": "v",
         "expected": "any x 3 x any numbers",
         "found": "4 x 3 float64"})),
        (("T", 3), "iu", ("F002.value", None, {"item": "v", "expected": "T x 3 integers",
         "found": "4 x 3 float64"})),
        (None, "SU", ("F002.value", None, {"item": "v", "expected": "an array of strings",
         "found": "4 x 3 float64"})),
        ((4, 3), "b", ("F002.value", None, {"item": "v", "expected": "4 x 3 values of kind b",
         "found": "4 x 3 float64"})),
    ],
)  # fmt: skip
def test_shape_and_dtype_are_checked(shape, kinds, message):
    for archive in (opened(npz(v=ROWS)), opened(pickle.dumps({"v": ROWS}))):
        if message is None:
            assert_array_equal(archive.array("v", shape, kinds).values(), ROWS)
        else:
            assert refused(archive.array, "v", shape, kinds) == message


@pytest.mark.parametrize(
    ("value", "found"),
    [
        ("lbs", "'lbs'"),
        (b"lbs", "3 bytes"),
        (None, "None"),
        ({"a": 1}, "a dict of 1 value"),
        ([[1, 2], [3]], "a list of length 2"),
        (["a", 1], "a list of length 2"),
        ([ROWS, ROWS[:1]], "a list of length 2"),
        ([[1, None]], "a list of length 1"),
        ([1 << 70], "a list of length 1"),
        (np.array(["a", "b"]), "2 strings"),
        (np.array([{}], object), "an unsupported value (object array)"),
    ],
)
def test_values_other_than_arrays_are_refused(value, found):
    archive = opened(pickle.dumps({"v": value}))
    for ask, expected in (
        (archive.array, "an array of numbers"),
        (archive.sparse, "any x any numbers"),
    ):
        values = {"item": "v", "expected": expected, "found": found}
        assert refused(ask, "v") == ("F002.value", None, values)


@pytest.mark.parametrize(
    ("value", "dtype"),
    [
        ([[1, 2], [3, 4]], "int64"),
        (((0.5, 1),), "float64"),
        ([True, False], "bool"),
        (3, "int64"),
        (2.5, "float64"),
        ([], "float64"),
    ],
)
def test_lists_of_numbers_are_read_as_arrays(value, dtype):
    found = opened(pickle.dumps({"v": value})).array("v")
    assert found.dtype == dtype
    assert_array_equal(found.values(), value)
    assert not found.values().flags.writeable


def test_missing_keys_are_refused():
    archive = opened(npz(v=ROWS))
    assert archive.has("v") and not archive.has("w")
    for ask in (archive.get, archive.array, archive.sparse, archive.text):
        assert refused(ask, "w") == ("F002.no-key", None, {"item": "w"})
    assert refused(archive.get, "a\nb") == ("F002.no-key", None, {"item": "a\\nb"})


def test_matrix_may_be_dense():
    dense = np.array([[0, 2.5, 0], [1, 0, np.nan]])
    found = opened(npz(v=dense)).sparse("v", ("J", 3))
    assert (found.shape, found.layout) == ((2, 3), "csr")
    rows, columns, values = found.entries()
    assert (rows.tolist(), columns.tolist()) == ([0, 1, 1], [1, 0, 2])
    assert_array_equal(values, [2.5, 1, np.nan])
    line = refused(opened(npz(v=dense)).sparse, "v", (3, 3))
    assert line == (
        "F002.value",
        None,
        {"item": "v", "expected": "3 x 3 numbers", "found": "2 x 3 float64"},
    )


def test_sparse_matrix_is_read_from_rows_and_columns():
    parts = np.array([5, 6]), np.array([1, 0]), np.array([0, 1, 2])
    for layout, pairs in (("csr", [[0, 1], [1, 0]]), ("csc", [[1, 0], [0, 1]])):
        rows, columns, values = Sparse((2, 2), *parts, layout).entries()
        assert [rows.tolist(), columns.tolist()] == pairs
        assert values.tolist() == [5, 6]


@pytest.mark.parametrize(
    "value",
    ["female", b"female", np.array("female"), np.array([b"female"]), np.array("female", ">U9")],
)
def test_strings_of_any_encoding_are_read(value):
    assert opened(pickle.dumps({"v": value})).text("v") == "female"
    assert opened(npz(v=np.array(value))).text("v") == "female"


@pytest.mark.parametrize(
    ("value", "found"),
    [
        (1, ("F002.text", None, {"item": "v", "found": "1"})),
        (["a", "b"], ("F002.text", None, {"item": "v", "found": "a list of length 2"})),
        (np.array(["a", "b"]), ("F002.text", None, {"item": "v", "found": "2 strings"})),
        (ROWS, ("F002.text", None, {"item": "v", "found": "4 x 3 float64"})),
    ],
)  # fmt: skip
def test_values_other_than_strings_are_refused(value, found):
    archive = opened(pickle.dumps({"v": value}))
    assert refused(archive.text, "v") == found


def test_values_are_cached():
    archive = opened(npz(v=ROWS, o=np.array({}, object)))
    first = archive.get("v")
    assert isinstance(first, Deferred)
    assert archive.get("v") is first
    assert archive.get("o") == Opaque("object array")


def test_half_floats_are_converted_to_single_precision(tmp_path):
    """65504 is the largest half float, so comparing it with a larger number would overflow."""
    np.savez(tmp_path / "a.npz", half=np.array([0.5, 65504], "f2"))
    half = open_archive(Source.open(tmp_path / "a.npz")).array("half").values()
    assert (half.dtype, half.tolist()) == (np.float64, [0.5, 65504.0])
    assert not are_indices(half, 100_000) and are_indices(half[1:], 100_000)


PAGE = 1 << 16
SIZE = 3 * PAGE + 5


@pytest.fixture
def data() -> bytes:
    return np.random.default_rng(0).bytes(SIZE)


def window(data: bytes, folder: Path) -> FileWindow:
    path = folder / "a.pkl"
    path.write_bytes(data)
    return FileWindow(StoredFile(Source.open(path)))


def test_windows_have_the_bytes_of_the_file(data, tmp_path):
    found = window(data, tmp_path)
    assert len(found) == SIZE
    for place in (0, 7, PAGE - 1, PAGE, 2 * PAGE + 3, 5, SIZE - 1):
        assert found[place] == data[place]
    for start, stop in ((0, 9), (PAGE - 3, PAGE + 3), (1, 3 * PAGE), (SIZE - 2, SIZE + 9), (9, 9)):
        assert found[start:stop] == data[start:stop]


@pytest.mark.parametrize("place", [3, (1 << 20) - 1, (1 << 20) + 9])
def test_bytes_are_found_across_page_borders(place, tmp_path):
    text = bytearray((1 << 20) + 99)
    text[place : place + 2] = b"ab"
    found = window(bytes(text), tmp_path)
    assert found.find(b"ab", 0, len(found)) == place
    assert found.find(b"ab", place + 1, len(found)) == -1
    assert found.find(b"ab", 0, place + 1) == -1


def test_pickles_are_read_through_a_window(tmp_path):
    rows = np.arange(6.0).reshape(2, 3)
    found = window(joblib_file({"v": rows, "t": "text", "n": [1.5, 7]}), tmp_path)
    source = Source.open(tmp_path / "a.pkl")
    machine = Machine(source, found)
    archive = named_archive(source, "pickle", len(found), machine.run())
    assert_array_equal(archive.array("v").values(), rows)
    assert (archive.get("t"), archive.get("n")) == ("text", [1.5, 7])


def test_unused_arrays_of_large_files_are_not_read(tmp_path):
    path = tmp_path / "a.pkl"
    path.write_bytes(joblib_file({"verts": np.zeros(34 << 20, np.uint8), "v": np.arange(3)}))

    def look() -> None:
        assert open_archive(Source.open(path)).array("v").values().tolist() == [0, 1, 2]

    assert cost(look) < 4 << 20


def test_files_that_change_while_open_are_refused(tmp_path):
    path = tmp_path / "a.pkl"
    path.write_bytes(joblib_file({"v": np.zeros(34 << 20, np.uint8)}))
    later = open_archive(Source.open(path)).get("v")
    path.write_bytes(b"short")
    assert isinstance(later, Deferred)
    with pytest.raises(FormatError) as caught:
        later.values()
    assert caught.value.diagnostic is not None
    assert caught.value.diagnostic.key == "F002.changed"
