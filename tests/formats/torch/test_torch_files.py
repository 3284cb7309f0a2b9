"""Tensors of torch in zip archives, legacy streams, and other pickles."""

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from faults import warnings_of
from formats.pickle_bytes import finished, mapping, named, several, shape, unicode, whole
from formats.torch.torch_bytes import (
    STORAGES,
    Tensors,
    legacy_file,
    nested_tensor,
    object_npy,
    storage,
    tensor,
    torch_legacy,
    torch_zip,
    value,
    zip_file,
)
from numpy.testing import assert_array_equal

from viewer.formats._archive.opening import open_archive
from viewer.formats._archive.values import Archive
from viewer.formats._source import Source
from viewer.rig.arrays import Deferred

ROWS = np.arange(12, dtype=np.float32).reshape(4, 3) / 8
DATA = Path(__file__).resolve().parents[2] / "data"


def opened(data: bytes) -> Archive:
    return open_archive(Source("x.pt", data))


def values(archive: Archive | None, key: str = "v") -> Any:
    assert archive is not None
    found = archive.get(key)
    assert isinstance(found, Deferred), found
    loaded = found.values()
    assert (loaded.shape, loaded.dtype) == (found.shape, found.dtype)
    assert not loaded.flags.writeable
    assert loaded.flags.c_contiguous
    return loaded


@pytest.mark.parametrize("code", STORAGES)
@pytest.mark.parametrize("write", [torch_zip, torch_legacy], ids=["zip", "legacy"])
def test_element_types_are_read(code: str, write: Any) -> None:
    given = np.array([[0, 1, 2], [3, 1, 0]]).astype(code)
    found = values(opened(write({"v": given})))
    assert_array_equal(found, given)
    assert found.dtype == np.dtype(code)


def test_bfloat16_is_the_upper_half_of_a_float() -> None:
    data = np.array([1.5, -2.0, 3.25], np.float32).view(np.uint32) >> 16
    body = mapping(v=tensor(storage("BFloat16Storage", "0", 3), 0, (3,), (1,)))
    found = values(opened(zip_file(body, {"0": data.astype("<u2").tobytes()})))
    assert found.dtype == np.float32
    assert found.tolist() == [1.5, -2.0, 3.25]


def test_half_floats_become_doubles_in_requested_arrays() -> None:
    archive = opened(torch_zip({"v": np.array([65504.0], np.float16)}))
    assert archive.array("v", (1,)).values().dtype == np.float64


@pytest.mark.parametrize("order", ["little", "big"])
def test_byte_orders_are_read(order: str) -> None:
    assert_array_equal(values(opened(torch_zip({"v": ROWS}, order))), ROWS)


def test_bool_bytes_of_tensors_other_than_0_and_1_are_true() -> None:
    body = mapping(v=tensor(storage("BoolStorage", "0", 3), 0, (3,), (1,)))
    assert values(opened(zip_file(body, {"0": b"\0\1\7"}))).tolist() == [False, True, True]


@pytest.mark.parametrize(
    ("offset", "size", "stride", "wanted"),
    [
        (0, (3, 4), (1, 3), ROWS.T),
        (3, (2, 3), (3, 1), ROWS[1:3]),
        (1, (4,), (3,), ROWS[:, 1]),
        (2, (5, 2), (0, 1), np.tile(ROWS.ravel()[2:4], (5, 1))),
        (0, (), (), ROWS[0, 0]),
        (0, (0, 3), (3, 1), np.zeros((0, 3))),
        (12, (0,), (1,), np.zeros(0)),
    ],
    ids=["transposed", "rows", "column", "expanded", "number", "empty", "empty at the end"],
)
def test_strided_views_are_read(offset: int, size: Any, stride: Any, wanted: Any) -> None:
    body = mapping(v=tensor(storage("FloatStorage", "0", 12), offset, size, stride))
    assert_array_equal(values(opened(zip_file(body, {"0": ROWS.tobytes()}))), wanted)


def test_shared_storages_are_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    kept = storage("FloatStorage", "0", 12)
    body = mapping(v=tensor(kept, 0, (12,), (1,)), w=tensor(kept, 3, (9,), (1,)))
    archive, reads = opened(zip_file(body, {"0": ROWS.tobytes()})), []
    whole_zip = zipfile.ZipFile.open

    def counted(self: zipfile.ZipFile, member: Any, *more: Any) -> Any:
        reads.append(member.filename)
        return whole_zip(self, member, *more)

    monkeypatch.setattr(zipfile.ZipFile, "open", counted)
    assert_array_equal(values(archive, "v")[3:], values(archive, "w"))
    assert reads == ["archive/data/0"]


def test_unused_storages_are_never_read() -> None:
    data = bytearray(torch_zip({"v": ROWS, "big": np.arange(99.0), "n": {"w": ROWS}}))
    at = data.index(np.arange(99.0).tobytes())
    data[at : at + 8] = b"\xff" * 8  # this invalidates its checksum
    archive = opened(bytes(data))
    assert_array_equal(values(archive), ROWS)
    assert_array_equal(values(archive.inside("n"), "w"), ROWS)


def test_nested_dicts_lists_and_plain_data_are_read() -> None:
    given = {"a": {"b": {"c": ROWS}, "t": "text"}, "l": [{"v": ROWS}, {"v": ROWS[:1]}], "n": 2.5}
    archive = opened(torch_zip(given))
    assert (archive.kind, archive.keys, archive.get("n")) == ("torch", ("a", "l", "n"), 2.5)
    inner = archive.inside("a")
    assert inner is not None
    assert inner.keys == ("b", "t")
    assert_array_equal(values(inner.inside("b"), "c"), ROWS)
    items = archive.inside("l")
    assert items is not None
    assert items.keys == ("0", "1")
    assert_array_equal(values(items.inside("1")), ROWS[:1])
    assert archive.inside("n") is None


def test_parameters_sizes_devices_and_types_are_read() -> None:
    made = tensor(storage("FloatStorage", "0", 12), 0, (4, 3), (3, 1))
    hooks = named("collections", "OrderedDict") + b")R"
    body = mapping(
        v=named("torch._utils", "_rebuild_parameter") + several(made, b"\x88", hooks) + b"R",
        size=named("torch", "Size") + several(shape(1, 2)) + b"R",
        device=named("torch", "device") + several(unicode("cuda"), whole(0)) + b"R",
        dtype=named("torch", "float32"),
    )
    archive = opened(zip_file(body, {"0": ROWS.tobytes()}))
    assert_array_equal(values(archive), ROWS)
    assert (archive.get("size"), archive.get("device")) == ((1, 2), "cuda")


def test_types_that_only_newer_versions_store_are_read() -> None:
    hooks = named("collections", "OrderedDict") + b")R"
    stored = storage("UntypedStorage", "0", 4)
    kind = named("torch", "uint16")
    arguments = stored, whole(0), shape(2), shape(1), b"\x89", hooks, kind
    body = mapping(v=named("torch._utils", "_rebuild_tensor_v3") + several(*arguments) + b"R")
    found = values(opened(zip_file(body, {"0": b"\1\0\xff\xff"})))
    assert (found.dtype, found.tolist()) == (np.uint16, [1, 65535])


def test_tensors_in_a_plain_pickle_are_read() -> None:
    data = finished(mapping(v=nested_tensor(ROWS), w=nested_tensor(np.arange(3))))
    assert_array_equal(values(opened(data)), ROWS)
    assert values(opened(data), "w").tolist() == [0, 1, 2]


def test_tensors_in_an_array_of_objects_are_read() -> None:
    archive = opened(object_npy({"pred_trans": ROWS, "frame": np.arange(4), "name": "a"}))
    assert (archive.kind, archive.keys) == ("npy", ("pred_trans", "frame", "name"))
    assert_array_equal(values(archive, "pred_trans"), ROWS)


def test_big_endian_legacy_streams_are_read() -> None:
    kept = storage("FloatStorage", "0", 12)
    body = mapping(v=tensor(kept, 0, (4, 3), (3, 1)))
    data = legacy_file(body, {"0": (12, ROWS.astype(">f4").tobytes())}, is_little=False)
    assert_array_equal(values(opened(data)), ROWS)


def test_files_may_end_with_any_byte() -> None:
    given = np.array([0x1A], np.uint8)
    source = Source("x.pt", torch_legacy({"v": given}))
    assert values(open_archive(source)).tolist() == [0x1A]
    assert warnings_of(source.diagnostics) == []


def test_repacked_files_may_be_deflated() -> None:
    tensors = Tensors()
    body = value({"v": ROWS}, tensors.array)
    data = zip_file(body, tensors.stored, method=zipfile.ZIP_DEFLATED)
    assert_array_equal(values(opened(data)), ROWS)


@pytest.mark.parametrize("name", ["torch_zip.pt", "torch_legacy.pt", "torch_nested.npy"])
def test_files_written_by_torch_are_read(name: str) -> None:
    """``make_torch_files.py`` describes their contents."""
    archive = open_archive(Source.open(DATA / name))
    assert_array_equal(values(archive, "rows"), np.arange(6.0).reshape(2, 3))
    assert_array_equal(values(archive, "transposed"), np.arange(6.0).reshape(2, 3).T)
    assert_array_equal(values(archive, "expanded"), np.full((4, 2), 0.5))
    assert values(archive, "half").tolist() == values(archive, "brain").tolist() == [1.5, -2.0]
    assert values(archive, "flags").tolist() == [True, False]
    assert values(archive, "unsigned").tolist() == [1, 65535]
    inner = archive.inside("inner")
    assert inner is not None
    assert values(inner, "parameter").tolist() == [1.0, 1.0]
