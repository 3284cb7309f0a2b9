"""Uncompressed and compressed joblib files, in which arrays follow their descriptions."""

import bz2
import gzip
import lzma
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formats.archive.joblib_bytes import joblib_file
from formats.pickle_bytes import finished, named, several, unicode, whole
from formats.torch.torch_bytes import torch_legacy
from numpy.testing import assert_array_equal

from viewer.formats._archive.opening import open_archive
from viewer.formats._archive.values import Archive, Opaque
from viewer.formats._source import Source
from viewer.rig.arrays import Deferred

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
def test_compressed_and_plain_files_are_read(pack: Callable[[bytes], bytes]) -> None:
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
def test_arrays_after_their_descriptions_are_read(given: Any) -> None:
    archive = opened(joblib_file({"v": given, "after": 7}))
    assert_array_equal(values(archive, "v"), given)
    assert archive.get("after") == 7


def test_arrays_without_padding_are_read() -> None:
    assert_array_equal(values(opened(joblib_file({"v": ROWS}, aligned=False)), "v"), ROWS)


def test_people_are_keyed_by_their_numbers() -> None:
    archive = opened(joblib_file({3: {"v": ROWS}, -1: {"v": ROWS[:1]}}))
    assert archive.keys == ("3", "-1")
    assert_array_equal(values(archive.inside("-1"), "v"), ROWS[:1])


def test_dicts_in_lists_are_keyed_by_their_indices() -> None:
    archive = opened(joblib_file([{"v": ROWS}, {"v": ROWS[:2]}]))
    assert_array_equal(values(archive.inside("1"), "v"), ROWS[:2])


def test_dicts_with_a_default_are_read() -> None:
    made = named("collections", "defaultdict") + several(named("builtins", "dict")) + b"R"
    archive = opened(finished(made + unicode("v") + whole(1) + b"s"))
    assert archive.get("v") == 1


def test_errors_state_the_path_of_the_value() -> None:
    person = opened(joblib_file({3: {"cam": {"v": ROWS}}})).inside("3")
    assert person is not None
    inner = person.inside("cam")
    assert inner is not None
    fault = inner.fault("F002.no-key: {item}: key not found", item="w")
    assert str(fault) == "x.pkl: 3.cam.w: key not found"


def test_compressed_files_of_other_writers_are_read() -> None:
    data = zlib.compress(torch_legacy({"v": ROWS}))
    assert_array_equal(values(opened(data), "v"), ROWS)


@pytest.mark.parametrize("method", ["plain", "zlib", "gzip", "bz2", "xz", "lzma"])
def test_files_written_by_joblib_are_read(method: str) -> None:
    """``make_torch_files.py`` describes their contents."""
    person = open_archive(Source.open(DATA / f"joblib_{method}.pkl")).inside("3")
    rows = np.arange(6.0).reshape(2, 3)
    for key in ("rows", "columns", "tensor"):
        assert_array_equal(values(person, key), rows)
    assert person is not None
    assert person.get("number") == 0.5
    assert isinstance(person.get("objects"), Opaque)
