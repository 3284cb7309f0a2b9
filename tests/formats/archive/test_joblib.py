"""Uncompressed and compressed joblib files, in which arrays follow their descriptions."""

import bz2
import gzip
import lzma
import random
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from faults import fault_of
from formats.archive.joblib_bytes import joblib_file, wrapper
from formats.npz_bytes import cost
from formats.pickle.pickle_costs import self_contained
from formats.pickle_bytes import (
    created,
    element_type,
    finished,
    mapping,
    named,
    refusal,
    saved,
    several,
    text,
    unicode,
    whole,
)
from formats.torch.torch_bytes import torch_legacy
from numpy.testing import assert_array_equal

from viewer.errors import FormatError
from viewer.formats._archive.opening import open_archive
from viewer.formats._archive.values import Archive, Opaque
from viewer.formats._source import Source
from viewer.rigs.arrays import Deferred

ROWS = np.arange(12.0).reshape(4, 3) / 8
DATA = Path(__file__).resolve().parents[2] / "data"
PACK: dict[str, Callable[[bytes], bytes]] = {
    "plain": bytes,
    "zlib": lambda data: zlib.compress(data, 3),
    "zlib 9": lambda data: zlib.compress(data, 9),
    "gzip": lambda data: gzip.compress(data, mtime=0),
    "bz2": bz2.compress,
    "xz": lzma.compress,
    "lzma": lambda data: lzma.compress(data, lzma.FORMAT_ALONE),
}


def opened(data: bytes) -> Archive:
    return open_archive(Source("x.pkl", data))


def values(archive: Archive | None, key: str) -> Any:
    assert archive is not None
    found = archive.get(key)
    assert isinstance(found, Deferred), found
    return found.values()


@pytest.mark.parametrize("pack", PACK.values(), ids=PACK.keys())
def test_compressed_and_plain_files_are_read(pack):
    assert_array_equal(values(opened(pack(joblib_file({"v": ROWS}))), "v"), ROWS)


@pytest.mark.parametrize(
    "given",
    [
        ROWS.astype("f4"),
        np.asfortranarray(ROWS),
        ROWS.astype(">f8"),
        np.zeros((0, 3)),
        np.array(2.5),
        np.array(["ab", "c"]),
        np.array([True, False]),
    ],
    ids=lambda given: f"{given.dtype.str}-{given.shape}",
)
def test_arrays_after_their_descriptions_are_read(given):
    archive = opened(joblib_file({"v": given, "after": 7}))
    assert_array_equal(values(archive, "v"), given)
    assert archive.get("after") == 7


def test_arrays_without_padding_are_read():
    assert_array_equal(values(opened(joblib_file({"v": ROWS}, aligned=False)), "v"), ROWS)


def test_people_are_keyed_by_their_numbers():
    archive = opened(joblib_file({3: {"v": ROWS}, -1: {"v": ROWS[:1]}}))
    assert archive.keys == ("3", "-1")
    assert_array_equal(values(archive.inside("-1"), "v"), ROWS[:1])


def test_dicts_in_lists_are_keyed_by_their_indices():
    archive = opened(joblib_file([{"v": ROWS}, {"v": ROWS[:2]}]))
    assert_array_equal(values(archive.inside("1"), "v"), ROWS[:2])


def test_dicts_with_a_default_are_read():
    made = named("collections", "defaultdict") + several(named("builtins", "dict")) + b"R"
    archive = opened(finished(made + unicode("v") + whole(1) + b"s"))
    assert archive.get("v") == 1


def test_errors_state_the_path_of_the_value():
    person = opened(joblib_file({3: {"cam": {"v": ROWS}}})).inside("3")
    assert person is not None
    inner = person.inside("cam")
    assert inner is not None
    fault = inner.fault("F002.no-key: {item}: key not found", item="w")
    assert str(fault) == "x.pkl: 3.cam.w: key not found"


def test_compressed_files_of_other_writers_are_read():
    data = zlib.compress(torch_legacy({"v": ROWS}))
    assert_array_equal(values(opened(data), "v"), ROWS)


@pytest.mark.parametrize("method", ["plain", "zlib", "gzip", "bz2", "xz", "lzma"])
def test_files_written_by_joblib_are_read(method):
    """``make_torch_files.py`` describes their contents."""
    person = open_archive(Source.open(DATA / f"joblib_{method}.pkl")).inside("3")
    rows = np.arange(6.0).reshape(2, 3)
    for key in ("rows", "columns", "tensor"):
        assert_array_equal(values(person, key), rows)
    assert person is not None
    assert person.get("number") == 0.5
    assert isinstance(person.get("objects"), Opaque)


PLAIN_ROWS = np.arange(12.0).reshape(4, 3)
F8 = element_type()
BOUND = 8 << 20  # limit of allocated memory in bytes


def problem_of(data: bytes) -> str:
    _, _, values = refusal(data)
    return str(values["problem"].sentence)


@pytest.mark.parametrize(
    ("described", "key"),
    [
        (wrapper((1 << 40,), F8), "expected {expected} more bytes, found {found} (truncated?)"),
        (wrapper((4, 4), F8), "expected {expected} more bytes, found {found} (truncated?)"),
        (wrapper((0, 1 << 61), F8),
         "expected an array of numbers or strings, found {shape} of {dtype}"),
        (wrapper((3,), F8, order="K"),
         "expected a standard array description, found an unusual {name}"),
        (wrapper((3,), whole(8)), "expected a standard array description, found an unusual {name}"),
        (wrapper((3,), F8, kind=named("numpy", "dtype")),
         "expected a standard array description, found an unusual {name}"),
        (wrapper((3,), F8, kind=whole(1)),
         "expected a standard array description, found an unusual {name}"),
        (wrapper((-3,), F8), "expected a standard array description, found an unusual {name}"),
        (wrapper((3,), element_type("c16")),
         "expected an array of numbers or strings, found {shape} of {dtype}"),
        (wrapper((3,), element_type("V8")),
         "expected an array of numbers or strings, found {shape} of {dtype}"),
        (created("joblib.numpy_pickle", "NumpyArrayWrapper", mapping(a=whole(1))),
         "expected a standard array description, found an unusual {name}"),
    ],
    ids=str,
)  # fmt: skip
def test_descriptions_that_contradict_the_file_are_refused(described, key):
    data = saved(v=described + b"\x00" + bytes(24))
    assert problem_of(data) == key
    assert cost(lambda: refusal(data)) < BOUND


def test_padding_beyond_the_end_is_refused():
    assert (
        problem_of(saved(v=wrapper((0,), F8) + b"\xff"))
        == "expected {expected} more bytes, found {found} (truncated?)"
    )


@pytest.mark.parametrize("module", ["joblib.numpy_pickle", "joblib.numpy_pickle_compat"])
@pytest.mark.parametrize("name", ["NDArrayWrapper", "ZNDArrayWrapper"])
def test_arrays_in_other_files_are_refused(module, name):
    assert (
        problem_of(saved(v=named(module, name)))
        == "expected arrays in the file, found {name}, which stores them in separate files: "
        "load and save it again with joblib 0.10 or later"
    )


def test_objects_that_run_code_are_refused():
    inner = finished(named("os", "system") + several(text("true")) + b"R")
    assert (
        problem_of(saved(v=wrapper((1,), element_type("O8", "|")) + inner))
        == 'expected arrays and plain data, found the global "{name}", which is not allowed; '
        "nothing was executed"
    )
    other = finished(whole(1))
    assert (
        problem_of(saved(v=wrapper((1,), element_type("O8", "|")) + other))
        == "expected an array of objects, found a different value"
    )


def test_endlessly_nested_objects_are_refused():
    described = wrapper((1,), element_type("O8", "|"))
    data = finished(described)
    for _ in range(9):
        data = b"\x80\x02" + described + data
    assert problem_of(data) == "expected at most {most} nested pickles, found more"


def bomb(size: int) -> bytes:
    return saved(v=wrapper((size,), element_type("u1", "|")) + b"\x00" + bytes(size))


PACKED = {
    "zlib": zlib.compress(bomb(1 << 21), 9),
    "gzip": gzip.compress(bomb(1 << 21), 9, mtime=0),
    "bz2": bz2.compress(bomb(1 << 21)),
    "xz": lzma.compress(bomb(1 << 21)),
    "lzma": lzma.compress(bomb(1 << 21), lzma.FORMAT_ALONE),
}


@pytest.mark.parametrize("data", PACKED.values(), ids=PACKED.keys())
def test_decompressed_data_above_the_size_limit_are_refused(data):
    def look() -> None:
        with pytest.raises(FormatError) as caught:
            open_archive(Source("x.pkl", data, max_size=1 << 20))
        assert fault_of(caught.value.diagnostic)[0] == "F002.packed-size"

    assert cost(look) < 3 * BOUND  # the xz decoder needs 8 MiB


@pytest.mark.slow
def test_decompression_bombs_are_refused():
    data = zlib.compress(bomb(70 << 20), 1)
    assert refusal(data)[0] == "F002.packed-size"


@pytest.mark.parametrize("method", ["zlib", "gzip", "bz2", "xz", "lzma"])
def test_compressed_data_of_other_formats_is_not_unpacked(method):
    plain = b"balljoint a { }" * 1000
    data = {
        "zlib": zlib.compress(plain),
        "gzip": gzip.compress(plain, mtime=0),
        "bz2": bz2.compress(plain),
        "xz": lzma.compress(plain),
        "lzma": lzma.compress(plain, lzma.FORMAT_ALONE),
    }[method]
    assert refusal(data)[0] in ("F002.packed-kind", "F002.archive")


@pytest.mark.parametrize("head", [b"\x04\x22\x4d\x18", b"ZF0x0001"])
def test_unsupported_methods_are_refused(head):
    assert refusal(head + bytes(90))[0] == "F002.packed-method"


@pytest.mark.parametrize("pack", [zlib.compress, bz2.compress, lzma.compress])
def test_truncated_data_is_refused(pack):
    data = pack(joblib_file({"v": np.random.default_rng(0).random(999)}))
    for length in (len(data) // 2, len(data) - 1):
        assert refusal(data[:length])[0] == "F002.packed"


@pytest.mark.slow
def test_damaged_files_are_read_or_refused():
    data = joblib_file({"v": PLAIN_ROWS[:1], 3: {"w": np.array(["a"]), "t": unicode("x")}})
    dice = random.Random(len(data))
    for whole_file in (data, zlib.compress(data)):
        for place in range(0, len(whole_file), 2):
            self_contained(whole_file[:place])
            change = bytes([whole_file[place] ^ dice.choice((0x01, 0x20, 0x80, 0xFF))])
            self_contained(whole_file[:place] + change + whole_file[place + 1 :])
