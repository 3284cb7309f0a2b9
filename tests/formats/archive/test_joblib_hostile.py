"""Hostile joblib files: false sizes, bombs and damage, refused in one line with little memory."""

import bz2
import gzip
import lzma
import random
import zlib
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

from viewer.errors import FormatError
from viewer.formats._archive.opening import open_archive
from viewer.formats._source import Source

ROWS = np.arange(12.0).reshape(4, 3)
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
def test_descriptions_that_contradict_the_file_are_refused(described: bytes, key: str) -> None:
    data = saved(v=described + b"\x00" + bytes(24))
    assert problem_of(data) == key
    assert cost(lambda: refusal(data)) < BOUND


def test_padding_beyond_the_end_is_refused() -> None:
    assert (
        problem_of(saved(v=wrapper((0,), F8) + b"\xff"))
        == "expected {expected} more bytes, found {found} (truncated?)"
    )


@pytest.mark.parametrize("module", ["joblib.numpy_pickle", "joblib.numpy_pickle_compat"])
@pytest.mark.parametrize("name", ["NDArrayWrapper", "ZNDArrayWrapper"])
def test_arrays_in_other_files_are_refused(module: str, name: str) -> None:
    assert (
        problem_of(saved(v=named(module, name)))
        == "expected arrays in the file, found {name}, which stores them in separate files: "
        "load and save it again with joblib 0.10 or later"
    )


def test_objects_that_run_code_are_refused() -> None:
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


def test_endlessly_nested_objects_are_refused() -> None:
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
def test_decompressed_data_above_the_size_limit_are_refused(data: bytes) -> None:
    def look() -> None:
        with pytest.raises(FormatError) as caught:
            open_archive(Source("x.pkl", data, max_size=1 << 20))
        assert fault_of(caught.value.diagnostic)[0] == "F002.packed-size"

    assert cost(look) < 3 * BOUND  # the xz decoder needs 8 MiB


@pytest.mark.slow
def test_decompression_bombs_are_refused() -> None:
    data = zlib.compress(bomb(70 << 20), 9)
    assert refusal(data)[0] == "F002.packed-size"


@pytest.mark.parametrize("method", ["zlib", "gzip", "bz2", "xz", "lzma"])
def test_compressed_data_of_other_formats_is_not_unpacked(method: str) -> None:
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
def test_unsupported_methods_are_refused(head: bytes) -> None:
    assert refusal(head + bytes(90))[0] == "F002.packed-method"


@pytest.mark.parametrize("pack", [zlib.compress, bz2.compress, lzma.compress])
def test_truncated_data_is_refused(pack: Any) -> None:
    data = pack(joblib_file({"v": np.random.default_rng(0).random(999)}))
    for length in (len(data) // 2, len(data) - 1):
        assert refusal(data[:length])[0] == "F002.packed"


@pytest.mark.slow
def test_damaged_files_are_read_or_refused() -> None:
    data = joblib_file({"v": ROWS[:1], 3: {"w": np.array(["a"]), "t": unicode("x")}})
    dice = random.Random(len(data))
    for whole_file in (data, zlib.compress(data)):
        for place in range(0, len(whole_file), 2):
            self_contained(whole_file[:place])
            change = bytes([whole_file[place] ^ dice.choice((0x01, 0x20, 0x80, 0xFF))])
            self_contained(whole_file[:place] + change + whole_file[place + 1 :])
