"""Lazy and exact reading of ``.npz`` and ``.npy`` files, and refusal of inconsistent files."""

import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from faults import fault_of
from formats.npz_bytes import ROWS, cost, header, npy, npz, opened, refusal, zipped
from numpy.testing import assert_array_equal

from viewer.diagnostics import Phrase
from viewer.errors import FormatError
from viewer.formats._archive.opening import open_archive
from viewer.formats._archive.values import Opaque
from viewer.formats._source import Source
from viewer.rig.arrays import Deferred

GIVEN = {
    "rows": ROWS,
    "fortran": np.asfortranarray(ROWS),
    "big": np.arange(5).astype(">i4"),
    "cube": np.arange(24, dtype=np.float32).reshape(2, 3, 4),
    "bool": np.array([True, False]),
    "single": np.array(120.5),
    "text": np.array("female"),
    "bytes": np.array(b"female"),
    "names": np.array(["a", "bcd"]),
    "none": np.zeros((0, 3), np.uint32),
    "half": np.ones(3, np.float16),
}


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("in_file", [False, True])
def test_every_array_is_read(packed: bool, in_file: bool, tmp_path: Path) -> None:
    data = npz(packed=packed, **GIVEN)
    path = tmp_path / "x.npz"
    path.write_bytes(data)
    archive = open_archive(Source.open(path) if in_file else Source("x.npz", data))
    assert (archive.kind, archive.keys) == ("npz", tuple(GIVEN))
    for key, given in GIVEN.items():
        later = archive.get(key)
        assert isinstance(later, Deferred)
        assert not later.is_loaded
        found = later.values()
        assert_array_equal(found, given)
        assert (later.shape, later.dtype) == (given.shape, given.dtype.newbyteorder("="))
        assert (found.shape, found.dtype) == (later.shape, later.dtype)
        assert found.flags.c_contiguous
        assert not found.flags.writeable


def test_only_requested_arrays_are_read(tmp_path: Path) -> None:
    path = tmp_path / "x.npz"
    np.savez(path, large=np.zeros(4 << 20), small=ROWS)
    source = Source.open(path)
    assert cost(lambda: open_archive(source).array("small").values()) < 1 << 20


def test_compressed_arrays_are_not_decompressed_on_opening() -> None:
    data = npz(packed=True, large=np.zeros(6 << 20))
    assert cost(lambda: opened(data).get("large")) < 1 << 20


def test_reading_makes_no_second_copy(tmp_path: Path) -> None:
    path = tmp_path / "x.npz"
    np.savez(path, large=np.ones(2 << 20))
    archive = open_archive(Source.open(path))
    assert cost(lambda: archive.array("large").values()) < (16 << 20) + (5 << 20)


def test_changed_file_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "x.npz"
    np.savez(path, v=ROWS)
    archive = open_archive(Source.open(path))
    np.savez(path, v=ROWS + 1, w=ROWS)
    with pytest.raises(FormatError) as caught:
        archive.array("v").values()
    assert fault_of(caught.value.diagnostic) == ("F002.changed", None, {})
    path.unlink()
    with pytest.raises(FormatError) as caught:
        archive.array("v").values()
    assert fault_of(caught.value.diagnostic) == (
        "F001.unreadable",
        None,
        {"reason": "No such file or directory", "near": ""},
    )


def test_headers_from_other_writers_are_read() -> None:
    one = struct.pack("<d", 2.5)
    headers = [
        npy("{'descr':'<f8','fortran_order':False,'shape':(1,)}", one),
        npy("{'shape': (1L,), 'fortran_order': False, 'descr': '<f8'}\n", one),
        npy("{'descr': '<f8', 'fortran_order': True, 'shape': (1, 1L), }", one),
        npy(header(), one, b"\2\0"),
        npy(header(), one, b"\3\0"),
        npy(header() + " " * 60_000, one),
        npy(header("'f8'"), one),
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for data in headers:
            found = opened(zipped({"v.npy": data})).array("v").values()
            assert found.reshape(-1).tolist() == [2.5], data


@pytest.mark.parametrize(
    ("given", "what"),
    [
        (np.array({"L_Hip": 1}, dtype=object), "object array"),
        (np.array([None, "a"], dtype=object), "object array"),
        (np.zeros(2, "f4,i4"), "structured array"),
        (np.zeros(2, [("a", "f4", 3)]), "structured array"),
        (np.zeros(2, "V8"), "array of type |V8"),
        (np.zeros(2, complex), "array of type <c16"),
        (np.zeros(2, "M8[s]"), "array of type <M8[s]"),
    ],
    ids=["object", "objects", "record", "sub-array", "void", "complex", "date"],
)
def test_unsupported_dtypes_are_refused_without_evaluation(given: Any, what: Phrase) -> None:
    archive = opened(npz(v=given, good=ROWS))
    assert archive.get("v") == Opaque(what)
    assert_array_equal(archive.array("good").values(), ROWS)
    with pytest.raises(FormatError) as caught:
        archive.array("v")
    key, _, values = fault_of(caught.value.diagnostic)
    assert (key, values["found"]) == (
        "F002.value",
        Phrase("an unsupported value ({what})", what=what),
    )


def test_pickles_inside_are_never_opened(tmp_path: Path) -> None:
    marker = tmp_path / "marker"
    attack = b"cos\nsystem\n(S'touch " + str(marker).encode() + b"'\ntR."
    data = zipped({"v.npy": npy(header("'|O'", shape="()"), attack), "w.pkl": attack})
    archive = opened(data)
    assert archive.get("v") == Opaque("object array")
    assert archive.get("w.pkl") == Opaque("not an array")
    assert not marker.exists()


def test_names_with_parent_folders_are_treated_as_plain_names() -> None:
    data = zipped({"../../etc/x.npy": npy(header(), bytes(8)), "a\nb.npy": npy(header(), b"")})
    problem = "expected 1 float64, found 0 bytes"
    assert refusal(data) == ("F002.archive-value", None, {"item": r"a\nb", "problem": problem})


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("count", [1, 4, 100])
def test_blocks_of_rows_are_those_of_the_whole_array(packed: bool, count: int) -> None:
    given = GIVEN | {"many": np.arange(66.0).reshape(11, 3, 2)}
    archive = opened(npz(packed=packed, **given))
    for key, value in given.items():
        if value.ndim and value.dtype.kind in "biuf":
            array = archive.array(key)
            blocks = [block.copy() for block in array.blocks(count)]
            assert all(len(block) <= count for block in blocks)
            joined = np.concatenate(blocks) if blocks else np.zeros((0, *value.shape[1:]))
            assert_array_equal(joined, value)
            # Rows in C order and in the machine's byte order are not read as a whole.
            if key == "many":
                assert not array.is_loaded


def test_damage_is_detected_while_reading_blocks() -> None:
    values = np.arange(60_000.0).reshape(-1, 3)
    data = bytearray(npz(v=values))
    data[len(data) // 2] ^= 1
    array = opened(bytes(data)).array("v")
    with pytest.raises(FormatError):
        for _ in array.blocks(100):
            pass
