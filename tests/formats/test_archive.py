"""The one door to pickles, ``.npz`` and ``.npy``: what it opens, and what a reader may ask it."""

from __future__ import annotations

import io
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from viewer.errors import FormatError
from viewer.formats._archive import Archive, Opaque, Sparse
from viewer.formats._archive_opening import is_archive, open_archive
from viewer.formats._container import are_indices
from viewer.formats._source import Source
from viewer.rig.arrays import Deferred

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


def refused(action: Any, *arguments: Any) -> str:
    with pytest.raises(FormatError) as caught:
        action(*arguments)
    line = str(caught.value)
    assert "\n" not in line
    return line


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
def test_content_decides_not_the_name(data: bytes, kind: str, keys: tuple[str, ...]) -> None:
    assert is_archive(data[:64])
    for name in ("x.pkl", "x.npz", "x.txt"):
        archive = opened(data, name)
        assert (archive.kind, archive.keys, archive.path) == (kind, keys, Path(name))


@pytest.mark.parametrize("protocol", range(6))
@pytest.mark.parametrize("value", [{}, {"a": 1}, [1], ROWS, {1: 2}, []])
def test_pickles_are_recognised_by_their_head(value: Any, protocol: int) -> None:
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
def test_other_files_are_no_archives(head: bytes) -> None:
    assert not is_archive(head)


@pytest.mark.parametrize(
    ("data", "found"),
    [
        (b"", "an empty file"),
        (b" \n", "only white space"),
        (
            b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 39\n",
            "a Git LFS pointer, not the file itself (`git lfs pull` fetches it)",
        ),
        (b"<!DOCTYPE html><html>Sign in</html>", "HTML or XML (a failed download?)"),
        (b"\x1f\x8b\x08\0\0\0", "gzip data"),
        (b"%PDF-1.7", "a PDF document"),
        (bytes(1000), "zeros"),
    ],
)
def test_what_a_file_is_instead(data: bytes, found: str) -> None:
    line = refused(opened, data, "SMPL_MALE.pkl")
    assert line == f"SMPL_MALE.pkl: expected a pickle, .npz or .npy file, found {found}"


@pytest.mark.parametrize("protocol", [0, 1, 2])
def test_transfer_in_text_mode_is_named(protocol: int) -> None:
    data = pickle.dumps({"v": np.arange(13.0)}, protocol).replace(b"\n", b"\r\n")
    assert refused(opened, data, "x.pkl") == (
        "x.pkl: expected a pickle, found Windows line ends: damaged in transfer, "
        "download it again in binary mode"
    )


def test_text_that_is_no_pickle() -> None:
    line = refused(opened, b"positions 4 {\n", "x.pkl")
    assert line == "x.pkl: expected a pickle, .npz or .npy file, found something else"


def test_single_array(tmp_path: Path) -> None:
    path = tmp_path / "x.npy"
    np.save(path, ROWS)
    for source in (Source.open(path), Source("x.npy", path.read_bytes())):
        found = open_archive(source).array("arr_0", ("V", 3)).values()
        assert_array_equal(found, ROWS)
        assert not found.flags.writeable


def test_single_array_may_end_like_a_text(tmp_path: Path) -> None:
    """A byte 26 ends a text file, but not an array."""
    path = tmp_path / "x.npy"
    np.save(path, np.array([1, 26], np.uint8))
    source = Source.open(path)
    assert source.data.endswith(b"\1")
    assert open_archive(source).array("arr_0").values().tolist() == [1, 26]


def test_large_files_are_not_read_to_open_them(tmp_path: Path) -> None:
    path = tmp_path / "x.npz"
    np.savez(path, v=ROWS)
    source = Source.open(path)
    open_archive(source).array("v").values()
    assert source._data is None


def test_file_that_is_gone(tmp_path: Path) -> None:
    path = tmp_path / "x.npz"
    np.savez(path, v=ROWS)
    source = Source.open(path)
    path.unlink()
    assert refused(open_archive, source) == f"{path}: cannot be read: No such file or directory"


@pytest.mark.parametrize(
    ("shape", "kinds", "message"),
    [
        (None, "biuf", None),
        ((4, 3), "biuf", None),
        ((None, 3), "f", None),
        (("V", "C"), "biuf", None),
        ((4,), "biuf", "expected 4 numbers, found 4 x 3 float64"),
        ((), "biuf", "expected a single number, found 4 x 3 float64"),
        (("V", 4), "biuf", "expected V x 4 numbers, found 4 x 3 float64"),
        (("J", "J"), "biuf", "expected J x J numbers, found 4 x 3 float64"),
        ((None, 3, None), "biuf", "expected any x 3 x any numbers, found 4 x 3 float64"),
        (("T", 3), "iu", "expected T x 3 whole numbers, found 4 x 3 float64"),
        (None, "SU", "expected an array of texts, found 4 x 3 float64"),
        ((4, 3), "b", "expected 4 x 3 values of kind b, found 4 x 3 float64"),
    ],
)
def test_shape_and_kind_are_checked(shape: Any, kinds: str, message: str | None) -> None:
    for archive in (opened(npz(v=ROWS)), opened(pickle.dumps({"v": ROWS}))):
        if message is None:
            assert_array_equal(archive.array("v", shape, kinds).values(), ROWS)
        else:
            assert refused(archive.array, "v", shape, kinds) == f"x.npz: v: {message}"


@pytest.mark.parametrize(
    ("value", "found"),
    [
        ("lbs", "'lbs'"),
        (b"lbs", "3 bytes"),
        (None, "nothing"),
        ({"a": 1}, "1 named value"),
        ([[1, 2], [3]], "a list of 2"),
        (["a", 1], "a list of 2"),
        ([ROWS, ROWS], "a list of 2"),
        ([1 << 70], "a list of 1"),
        (np.array(["a", "b"]), "2 texts"),
        (np.array([{}], object), "an unread value (object array)"),
    ],
)
def test_what_is_no_array(value: Any, found: str) -> None:
    archive = opened(pickle.dumps({"v": value}))
    assert refused(archive.array, "v") == f"x.npz: v: expected an array of numbers, found {found}"
    assert refused(archive.sparse, "v") == f"x.npz: v: expected any x any numbers, found {found}"


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
def test_numbers_in_lists_are_arrays(value: Any, dtype: str) -> None:
    found = opened(pickle.dumps({"v": value})).array("v")
    assert found.dtype == dtype
    assert_array_equal(found.values(), value)
    assert not found.values().flags.writeable


def test_missing_keys() -> None:
    archive = opened(npz(v=ROWS))
    assert archive.has("v") and not archive.has("w")
    for ask in (archive.get, archive.array, archive.sparse, archive.text):
        assert refused(ask, "w") == "x.npz: w: expected a value, found no such key"
    assert refused(archive.get, "a\nb") == r"x.npz: a\nb: expected a value, found no such key"


def test_matrix_may_be_dense() -> None:
    dense = np.array([[0, 2.5, 0], [1, 0, np.nan]])
    found = opened(npz(v=dense)).sparse("v", ("J", 3))
    assert (found.shape, found.layout) == ((2, 3), "csr")
    rows, columns, values = found.entries()
    assert (rows.tolist(), columns.tolist()) == ([0, 1, 1], [1, 0, 2])
    assert_array_equal(values, [2.5, 1, np.nan])
    line = refused(opened(npz(v=dense)).sparse, "v", (3, 3))
    assert line == "x.npz: v: expected 3 x 3 numbers, found 2 x 3 float64"


def test_entries_of_rows_and_columns() -> None:
    parts = np.array([5, 6]), np.array([1, 0]), np.array([0, 1, 2])
    for layout, pairs in (("csr", [[0, 1], [1, 0]]), ("csc", [[1, 0], [0, 1]])):
        rows, columns, values = Sparse((2, 2), *parts, layout).entries()
        assert [rows.tolist(), columns.tolist()] == pairs
        assert values.tolist() == [5, 6]


@pytest.mark.parametrize(
    "value",
    ["female", b"female", np.array("female"), np.array([b"female"]), np.array("female", ">U9")],
)
def test_texts_however_they_are_written(value: Any) -> None:
    assert opened(pickle.dumps({"v": value})).text("v") == "female"
    assert opened(npz(v=np.array(value))).text("v") == "female"


@pytest.mark.parametrize(
    ("value", "found"),
    [(1, "1"), (["a"], "a list of 1"), (np.array(["a", "b"]), "2 texts"), (ROWS, "4 x 3 float64")],
)
def test_what_is_no_text(value: Any, found: str) -> None:
    archive = opened(pickle.dumps({"v": value}))
    assert refused(archive.text, "v") == f"x.npz: v: expected a text, found {found}"


def test_values_are_kept() -> None:
    archive = opened(npz(v=ROWS, o=np.array({}, object)))
    first = archive.get("v")
    assert isinstance(first, Deferred)
    assert archive.get("v") is first
    assert archive.get("o") == Opaque("object array")


def test_halves_are_widened(tmp_path: Path) -> None:
    """65504 is the largest half: comparing one with a larger number would overflow."""
    np.savez(tmp_path / "a.npz", half=np.array([0.5, 65504], "f2"))
    half = open_archive(Source.open(tmp_path / "a.npz")).array("half").values()
    assert (half.dtype, half.tolist()) == (np.float64, [0.5, 65504.0])
    assert not are_indices(half, 100_000) and are_indices(half[1:], 100_000)
