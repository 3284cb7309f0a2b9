"""``.npz`` and ``.npy`` files as bytes for tests, and functions that read them."""

import io
import struct
import tracemalloc
import zipfile
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from faults import Fault, fault_of

from viewer.errors import FormatError
from viewer.formats._archive.opening import open_archive
from viewer.formats._archive.values import Archive
from viewer.formats._source import Source
from viewer.rigs.arrays import Deferred

ROWS = np.arange(12.0).reshape(4, 3) / 8


def npz(*, packed: bool = False, **arrays: Any) -> bytes:
    stream = io.BytesIO()
    (np.savez_compressed if packed else np.savez)(stream, **arrays)
    return stream.getvalue()


def zipped(members: dict[str, bytes], method: int = zipfile.ZIP_STORED) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return stream.getvalue()


def npy(header: str | bytes, data: bytes = b"", version: bytes = b"\1\0") -> bytes:
    text = header.encode("latin-1") if isinstance(header, str) else header
    width = "<H" if version == b"\1\0" else "<I"
    return b"\x93NUMPY" + version + struct.pack(width, len(text)) + text + data


def header(descr: str = "'<f8'", order: str = "False", shape: str = "(1,)") -> str:
    return f"{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}, }}   \n"


def opened(data: bytes, max_size: int = 2 << 30) -> Archive:
    return open_archive(Source("x.npz", data, max_size))


def look(data: bytes, max_size: int = 2 << 30) -> None:
    """Open an archive and read everything in it."""
    archive = opened(data, max_size)
    for key in archive.keys:
        value = archive.get(key)
        if isinstance(value, Deferred):
            assert value.values().shape == value.shape


def refusal(data: bytes, max_size: int = 2 << 30) -> Fault:
    with pytest.raises(FormatError) as caught:
        look(data, max_size)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("x.npz: ")
    return fault_of(caught.value.diagnostic)


def cost(action: Callable[[], Any]) -> int:
    tracemalloc.start()
    try:
        action()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
