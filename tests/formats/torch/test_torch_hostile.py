"""Hostile torch files: false sizes, foreign names and damage, which are refused in one line."""

import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formats.npz_bytes import cost
from formats.pickle.pickle_costs import self_contained
from formats.pickle_bytes import finished, mapping, named, refusal, several, unicode, whole
from formats.torch.torch_bytes import (
    MAGIC,
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

ROWS = np.arange(12, dtype=np.float32).reshape(4, 3)
KEPT = storage("FloatStorage", "0", 12)
BOUND = 8 << 20  # limit of allocated memory in bytes


def view(offset: int, size: tuple[int, ...], stride: tuple[int, ...]) -> bytes:
    return zip_file(mapping(v=tensor(KEPT, offset, size, stride)), {"0": ROWS.tobytes()})


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
def test_views_beyond_their_storage_are_refused(offset: int, size: Any, stride: Any) -> None:
    assert (
        problem_of(view(offset, size, stride))
        == "expected a tensor within {found} of its storage, found {shape} with strides "
        "{strides} from element {offset}"
    )


@pytest.mark.parametrize(
    ("offset", "size", "stride"),
    [(-1, (1,), (1,)), (0, (2,), (-1,)), (0, (-2,), (1,)), (0, (1, 1), (1,)), (0, (1,) * 33, ())],
)
def test_impossible_views_are_refused(offset: int, size: Any, stride: Any) -> None:
    assert (
        problem_of(view(offset, size, stride))
        == "expected the usual arguments of {name}, found ({found})"
    )


def test_views_that_expand_without_bounds_are_refused() -> None:
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
def test_storages_that_contradict_the_archive_are_refused(stored: bytes, key: str) -> None:
    body = mapping(v=tensor(stored, 0, (11,), (1,)))
    data = zip_file(body, {"0": ROWS.tobytes()})
    assert problem_of(data) == key
    assert cost(lambda: refusal(data)) < BOUND


@pytest.mark.parametrize("name", ["archive/constants.pkl", "archive/other/data.pkl"])
def test_compiled_modules_are_refused(name: str) -> None:
    data = zip_file(mapping(v=KEPT), {"0": ROWS.tobytes()}, **{name.removeprefix("archive/"): b""})
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
def test_other_names_are_refused_everywhere(module: str, name: str, tmp_path: Path) -> None:
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
        ({"0": (11, ROWS.tobytes())}, "expected {expected} in the storage {item}, found {found}"),
        ({"0": (-1, ROWS.tobytes())}, "expected {expected} in the storage {item}, found {found}"),
        (
            {"0": (12, ROWS.tobytes()[:-1])},
            "expected {expected} more bytes, found {found} (truncated?)",
        ),
        ({"1": (12, ROWS.tobytes())}, "expected a storage with the key {item}, found none"),
        ({}, "expected a storage for each tensor, found none"),
    ],
)
def test_legacy_storages_that_contradict_the_pickle_are_refused(stored: Any, key: str) -> None:
    data = legacy_file(mapping(v=tensor(KEPT, 0, (12,), (1,))), stored)
    assert problem_of(data) == key


def test_duplicate_legacy_storages_are_refused() -> None:
    data = legacy_file(mapping(v=KEPT), {"0": (12, ROWS.tobytes())})
    keys = finished(value(["0"], nested_tensor))
    assert keys in data
    assert (
        problem_of(data.replace(keys, finished(value(["0", "0"], nested_tensor))))
        == "expected a storage with the key {item}, found none"
    )


def test_legacy_storages_larger_than_the_file_are_refused() -> None:
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
            torch_zip({"v": ROWS}),
            "expected arrays and plain data, found {found}, which is not allowed; nothing was "
            "executed",
        ),
    ],
    ids=["empty", "magic", "protocol", "dict", "zip"],
)
def test_bytes_that_are_not_a_storage_are_refused(stream: bytes, key: str) -> None:
    assert problem_of(finished(mapping(v=bytes_of(stream)))) == key


def test_nested_streams_are_refused() -> None:
    stream = legacy_file(KEPT, {"0": (12, ROWS.tobytes())})
    for _ in range(3):
        stream = legacy_file(bytes_of(stream), {})
        assert (
            problem_of(finished(mapping(v=bytes_of(stream))))
            == "expected the usual arguments of {name}, found ({found})"
        )


@pytest.mark.slow
def test_repeated_loading_of_the_same_bytes_is_refused() -> None:
    stream = legacy_file(KEPT, {"0": (12, ROWS.tobytes())})
    once = named("torch.storage", "_load_from_bytes") + b"(h\1tR0"
    body = b"}" + value(stream, nested_tensor) + b"q\1" + b"0" + once * 50_000
    assert problem_of(finished(body)) == "expected at most {most} opcodes in a pickle, found more"


@pytest.mark.slow
@pytest.mark.parametrize(
    "data",
    [
        torch_zip({"v": ROWS[:1], "n": {"t": "a"}}),
        torch_legacy({"v": ROWS[:1]}),
        object_npy({"v": ROWS[:1]}),
    ],
    ids=["zip", "legacy", "npy"],
)
def test_damaged_files_are_read_or_refused(data: bytes) -> None:
    dice = random.Random(len(data))
    for place in range(0, len(data), 3):
        self_contained(data[:place])
        change = dice.choice((0x01, 0x20, 0x80, 0xFF))
        self_contained(data[:place] + bytes([data[place] ^ change]) + data[place + 1 :])
