"""Tensors of torch in zip archives, legacy streams, and other pickles."""

import random
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from faults import warnings_of
from formats.npz_bytes import cost
from formats.pickle.pickle_costs import self_contained
from formats.pickle_bytes import finished, mapping, named, refusal, several, shape, unicode, whole
from formats.torch.torch_bytes import (
    MAGIC,
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
from viewer.rigs.arrays import Deferred

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
def test_element_types_are_read(code, write):
    given = np.array([[0, 1, 2], [3, 1, 0]]).astype(code)
    found = values(opened(write({"v": given})))
    assert_array_equal(found, given)
    assert found.dtype == np.dtype(code)


def test_bfloat16_is_the_upper_half_of_a_float():
    data = np.array([1.5, -2.0, 3.25], np.float32).view(np.uint32) >> 16
    body = mapping(v=tensor(storage("BFloat16Storage", "0", 3), 0, (3,), (1,)))
    found = values(opened(zip_file(body, {"0": data.astype("<u2").tobytes()})))
    assert found.dtype == np.float32
    assert found.tolist() == [1.5, -2.0, 3.25]


def test_half_floats_become_doubles_in_requested_arrays():
    archive = opened(torch_zip({"v": np.array([65504.0], np.float16)}))
    assert archive.array("v", (1,)).values().dtype == np.float64


@pytest.mark.parametrize("order", ["little", "big"])
def test_byte_orders_are_read(order):
    assert_array_equal(values(opened(torch_zip({"v": ROWS}, order))), ROWS)


def test_bool_bytes_of_tensors_other_than_0_and_1_are_true():
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
def test_strided_views_are_read(offset, size, stride, wanted):
    body = mapping(v=tensor(storage("FloatStorage", "0", 12), offset, size, stride))
    assert_array_equal(values(opened(zip_file(body, {"0": ROWS.tobytes()}))), wanted)


def test_shared_storages_are_read_once(monkeypatch):
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


def test_unused_storages_are_never_read():
    data = bytearray(torch_zip({"v": ROWS, "big": np.arange(99.0), "n": {"w": ROWS}}))
    at = data.index(np.arange(99.0).tobytes())
    data[at : at + 8] = b"\xff" * 8  # this invalidates its checksum
    archive = opened(bytes(data))
    assert_array_equal(values(archive), ROWS)
    assert_array_equal(values(archive.inside("n"), "w"), ROWS)


def test_nested_dicts_lists_and_plain_data_are_read():
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


def test_parameters_sizes_devices_and_types_are_read():
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


def test_types_that_only_newer_versions_store_are_read():
    hooks = named("collections", "OrderedDict") + b")R"
    stored = storage("UntypedStorage", "0", 4)
    kind = named("torch", "uint16")
    arguments = stored, whole(0), shape(2), shape(1), b"\x89", hooks, kind
    body = mapping(v=named("torch._utils", "_rebuild_tensor_v3") + several(*arguments) + b"R")
    found = values(opened(zip_file(body, {"0": b"\1\0\xff\xff"})))
    assert (found.dtype, found.tolist()) == (np.uint16, [1, 65535])


def test_tensors_in_a_plain_pickle_are_read():
    data = finished(mapping(v=nested_tensor(ROWS), w=nested_tensor(np.arange(3))))
    assert_array_equal(values(opened(data)), ROWS)
    assert values(opened(data), "w").tolist() == [0, 1, 2]


def test_tensors_in_an_array_of_objects_are_read():
    archive = opened(object_npy({"pred_trans": ROWS, "frame": np.arange(4), "name": "a"}))
    assert (archive.kind, archive.keys) == ("npy", ("pred_trans", "frame", "name"))
    assert_array_equal(values(archive, "pred_trans"), ROWS)


def test_big_endian_legacy_streams_are_read():
    kept = storage("FloatStorage", "0", 12)
    body = mapping(v=tensor(kept, 0, (4, 3), (3, 1)))
    data = legacy_file(body, {"0": (12, ROWS.astype(">f4").tobytes())}, is_little=False)
    assert_array_equal(values(opened(data)), ROWS)


def test_files_may_end_with_any_byte():
    given = np.array([0x1A], np.uint8)
    source = Source("x.pt", torch_legacy({"v": given}))
    assert values(open_archive(source)).tolist() == [0x1A]
    assert warnings_of(source.diagnostics) == []


def test_repacked_files_may_be_deflated():
    tensors = Tensors()
    body = value({"v": ROWS}, tensors.array)
    data = zip_file(body, tensors.stored, method=zipfile.ZIP_DEFLATED)
    assert_array_equal(values(opened(data)), ROWS)


@pytest.mark.parametrize("name", ["torch_zip.pt", "torch_legacy.pt", "torch_nested.npy"])
def test_files_written_by_torch_are_read(name):
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


PLAIN_ROWS = np.arange(12, dtype=np.float32).reshape(4, 3)
KEPT = storage("FloatStorage", "0", 12)
BOUND = 8 << 20  # limit of allocated memory in bytes


def view(offset: int, size: tuple[int, ...], stride: tuple[int, ...]) -> bytes:
    return zip_file(mapping(v=tensor(KEPT, offset, size, stride)), {"0": PLAIN_ROWS.tobytes()})


def problem_of(data: bytes) -> str:
    """Return the key of the phrase that describes the error."""
    _, _, values = refusal(data)
    return str(values["problem"].sentence)


@pytest.mark.parametrize(
    ("offset", "size", "stride"),
    [
        (0, (13,), (1,)),
        (1, (4, 3), (3, 1)),
        (0, (2,), (12,)),
        (0, (2, 2), (1 << 40, 1 << 40)),
        (13, (0,), (1,)),
        (0, (0, 1 << 61), (1, 1)),
        (0, (1 << 61, 1 << 61), (0, 0)),
    ],
)
def test_views_beyond_their_storage_are_refused(offset, size, stride):
    assert (
        problem_of(view(offset, size, stride))
        == "expected a tensor within {found} of its storage, found {shape} with strides "
        "{strides} from element {offset}"
    )


@pytest.mark.parametrize(
    ("offset", "size", "stride"),
    [(-1, (1,), (1,)), (0, (2,), (-1,)), (0, (-2,), (1,)), (0, (1, 1), (1,)), (0, (1,) * 33, ())],
)
def test_impossible_views_are_refused(offset, size, stride):
    assert (
        problem_of(view(offset, size, stride))
        == "expected the usual arguments of {name}, found ({found})"
    )


def test_views_that_expand_without_bounds_are_refused():
    data = view(0, (1 << 28, 2), (0, 0))
    assert (
        problem_of(data)
        == "expected a tensor of at most {most} times the size of its storage, found {shape} "
        "elements"
    )
    assert cost(lambda: refusal(data)) < BOUND


@pytest.mark.parametrize(
    ("stored", "key"),
    [
        (
            storage("FloatStorage", "0", 1 << 50),
            "expected a storage {item} of {expected} bytes, found {found}",
        ),
        (
            storage("FloatStorage", "0", 11),
            "expected a storage {item} of {expected} bytes, found {found}",
        ),
        (
            storage("DoubleStorage", "0", 12),
            "expected a storage {item} of {expected} bytes, found {found}",
        ),
        (storage("FloatStorage", "1", 12), "expected a storage with the key {item}, found none"),
        (storage("FloatStorage", "../0", 12), "expected a storage with the key {item}, found none"),
        (
            storage("FloatStorage", "0" * 201, 12),
            "expected the persistent id of a storage, found a different one",
        ),
        (
            storage("FloatStorage", "0", -1),
            "expected the persistent id of a storage, found a different one",
        ),
        (
            several(unicode("storage")) + b"Q",
            "expected the persistent id of a storage, found a different one",
        ),
        (
            unicode("storage") + b"Q",
            "expected the persistent id of a storage, found a different one",
        ),
        (b"NQ", "expected the persistent id of a storage, found a different one"),
        (
            KEPT.replace(b"storage", b"elsewhe"),
            "expected the persistent id of a storage, found a different one",
        ),
        (
            KEPT + b"0" + storage("IntStorage", "0", 12),
            "expected one storage {item}, found two of different types or sizes",
        ),
        (
            b"P0\n",
            "expected arrays and plain data, found {found}, which is not allowed; nothing was "
            "executed",
        ),
    ],
    ids=lambda given: given if isinstance(given, str) else "",
)
def test_storages_that_contradict_the_archive_are_refused(stored, key):
    body = mapping(v=tensor(stored, 0, (11,), (1,)))
    data = zip_file(body, {"0": PLAIN_ROWS.tobytes()})
    assert problem_of(data) == key
    assert cost(lambda: refusal(data)) < BOUND


@pytest.mark.parametrize("name", ["archive/constants.pkl", "archive/other/data.pkl"])
def test_compiled_modules_are_refused(name):
    data = zip_file(
        mapping(v=KEPT), {"0": PLAIN_ROWS.tobytes()}, **{name.removeprefix("archive/"): b""}
    )
    assert refusal(data)[0] == "F002.torch-kind"


@pytest.mark.parametrize(
    ("module", "name"),
    [
        ("torch", "load"),
        ("torch.hub", "load"),
        ("torch.storage", "TypedStorage"),
        ("torch._utils", "_rebuild_sparse_tensor"),
        ("torch._utils", "_rebuild_qtensor"),
        ("torch.jit._pickle", "restore_type_tag"),
        ("torch._tensor", "_rebuild_from_type_v2"),
        ("torch.serialization", "_load"),
        ("os", "system"),
        ("joblib", "load"),
        ("joblib.numpy_pickle", "load"),
        ("builtins", "eval"),
    ],
)
def test_other_names_are_refused_everywhere(module, name, tmp_path):
    marker = tmp_path / "marker"
    call = named(module, name) + several(unicode(f"touch {marker}")) + b"R"
    nested = named("torch.storage", "_load_from_bytes")
    inside = legacy_file(call, {})
    files = [
        zip_file(mapping(v=call), {}),
        legacy_file(mapping(v=call), {}),
        finished(mapping(v=nested + several(value(inside, nested_tensor)) + b"R")),
        object_npy({"v": 1}).replace(b"K\x01" * 1 + b"u", call + b"u"),
    ]
    assert {problem_of(data) for data in files} == {
        'expected arrays and plain data, found the global "{name}", which is not allowed; '
        "nothing was executed"
    }
    assert not marker.exists()


@pytest.mark.parametrize(
    ("stored", "key"),
    [
        (
            {"0": (11, PLAIN_ROWS.tobytes())},
            "expected {expected} in the storage {item}, found {found}",
        ),
        (
            {"0": (-1, PLAIN_ROWS.tobytes())},
            "expected {expected} in the storage {item}, found {found}",
        ),
        (
            {"0": (12, PLAIN_ROWS.tobytes()[:-1])},
            "expected {expected} more bytes, found {found} (truncated?)",
        ),
        ({"1": (12, PLAIN_ROWS.tobytes())}, "expected a storage with the key {item}, found none"),
        ({}, "expected a storage for each tensor, found none"),
    ],
)
def test_legacy_storages_that_contradict_the_pickle_are_refused(stored, key):
    data = legacy_file(mapping(v=tensor(KEPT, 0, (12,), (1,))), stored)
    assert problem_of(data) == key


def test_duplicate_legacy_storages_are_refused():
    data = legacy_file(mapping(v=KEPT), {"0": (12, PLAIN_ROWS.tobytes())})
    keys = finished(value(["0"], nested_tensor))
    assert keys in data
    assert (
        problem_of(data.replace(keys, finished(value(["0", "0"], nested_tensor))))
        == "expected a storage with the key {item}, found none"
    )


def test_legacy_storages_larger_than_the_file_are_refused():
    kept = storage("FloatStorage", "0", 1 << 50)
    data = legacy_file(mapping(v=kept), {"0": (1 << 50, b"")})
    assert problem_of(data) == "expected {expected} more bytes, found {found} (truncated?)"
    assert cost(lambda: refusal(data)) < BOUND


def bytes_of(stream: bytes) -> bytes:
    load = named("torch.storage", "_load_from_bytes")
    return load + several(value(stream, nested_tensor)) + b"R"


@pytest.mark.parametrize(
    ("stream", "key"),
    [
        (b"", "expected {expected} more bytes, found {found} (truncated?)"),
        (finished(whole(1)), "expected a torch file, found a pickle of a different kind"),
        (
            b"\x80\x02" + MAGIC + b"." + finished(whole(7)),
            "expected torch protocol {expected}, found a different one",
        ),
        (legacy_file(mapping(v=whole(1)), {}), "expected a storage saved by torch, found {found}"),
        (
            torch_zip({"v": PLAIN_ROWS}),
            "expected arrays and plain data, found {found}, which is not allowed; nothing was "
            "executed",
        ),
    ],
    ids=["empty", "magic", "protocol", "dict", "zip"],
)
def test_bytes_that_are_not_a_storage_are_refused(stream, key):
    assert problem_of(finished(mapping(v=bytes_of(stream)))) == key


def test_nested_streams_are_refused():
    stream = legacy_file(KEPT, {"0": (12, PLAIN_ROWS.tobytes())})
    for _ in range(3):
        stream = legacy_file(bytes_of(stream), {})
        assert (
            problem_of(finished(mapping(v=bytes_of(stream))))
            == "expected the usual arguments of {name}, found ({found})"
        )


@pytest.mark.slow
def test_repeated_loading_of_the_same_bytes_is_refused(monkeypatch):
    monkeypatch.setattr("viewer.formats._pickle.machine._MAX_STEPS", 10_000)
    stream = legacy_file(KEPT, {"0": (12, PLAIN_ROWS.tobytes())})
    once = named("torch.storage", "_load_from_bytes") + b"(h\1tR0"
    body = b"}" + value(stream, nested_tensor) + b"q\1" + b"0" + once * 5_000
    assert problem_of(finished(body)) == "expected at most {most} opcodes in a pickle, found more"


@pytest.mark.slow
@pytest.mark.parametrize(
    "data",
    [
        torch_zip({"v": PLAIN_ROWS[:1], "n": {"t": "a"}}),
        torch_legacy({"v": PLAIN_ROWS[:1]}),
        object_npy({"v": PLAIN_ROWS[:1]}),
    ],
    ids=["zip", "legacy", "npy"],
)
def test_damaged_files_are_read_or_refused(data):
    dice = random.Random(len(data))
    for place in range(0, len(data), 3):
        self_contained(data[:place])
        change = dice.choice((0x01, 0x20, 0x80, 0xFF))
        self_contained(data[:place] + bytes([data[place] ^ change]) + data[place + 1 :])
