"""Pickles assembled opcode by opcode, including forms that current writers do not use."""

import struct
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from faults import Fault, fault_of
from numpy.typing import NDArray

from viewer.errors import FormatError
from viewer.formats._archive.opening import open_archive
from viewer.formats._archive.values import Archive
from viewer.formats._source import Source
from viewer.rigs.arrays import Deferred

PATH = Path("model.pkl")


def opened(data: bytes) -> Archive:
    """Return the archive opened from bytes, without a file."""
    return open_archive(Source(PATH, data))


def refusal(data: bytes) -> Fault:
    """Return the refusal of bytes, which must include the file name."""
    with pytest.raises(FormatError) as caught:
        archive = opened(data)
        for key in archive.keys:
            value = archive.get(key)
            if isinstance(value, Deferred):
                value.values()
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("model.pkl: ")
    return fault_of(caught.value.diagnostic)


def text(words: str) -> bytes:
    """Return a string of Python 2, which is text or bytes."""
    data = words.encode("latin-1")
    return b"U" + bytes([len(data)]) + data


def payload(data: bytes) -> bytes:
    """Return a long string of Python 2."""
    return b"T" + struct.pack("<i", len(data)) + data


def unicode(words: str) -> bytes:
    data = words.encode("utf-8", "surrogatepass")
    return b"X" + struct.pack("<I", len(data)) + data


def whole(number: int) -> bytes:
    if 0 <= number < 256:
        return b"K" + bytes([number])
    if -(1 << 31) <= number < 1 << 31:
        return b"J" + struct.pack("<i", number)
    data = number.to_bytes(number.bit_length() // 8 + 1, "little", signed=True)
    return b"\x8a" + bytes([len(data)]) + data


def named(module: str, name: str) -> bytes:
    return f"c{module}\n{name}\n".encode()


def several(*items: bytes) -> bytes:
    """Return a tuple."""
    return b"(" + b"".join(items) + b"t"


def mapping(**items: bytes) -> bytes:
    return b"}(" + b"".join(text(key) + value for key, value in items.items()) + b"u"


def finished(body: bytes) -> bytes:
    return b"\x80\x02" + body + b"."


def saved(**items: bytes) -> bytes:
    """Return a complete pickle of named values."""
    return finished(mapping(**items))


def shape(*sides: int) -> bytes:
    return several(*map(whole, sides))


def element_type(code: str = "f8", order: str = "<", size: int = -1) -> bytes:
    """Return a ``numpy.dtype`` with its state."""
    made = named("numpy", "dtype") + several(text(code), whole(0), whole(1)) + b"R"
    state = (whole(3), text(order), b"N", b"N", b"N", whole(size), whole(-1), whole(0))
    return made + several(*state) + b"b"


def empty_array(module: str = "numpy.core.multiarray") -> bytes:
    arguments = several(named("numpy", "ndarray"), shape(0), text("b"))
    return named(module, "_reconstruct") + arguments + b"R"


def array_of(
    sides: tuple[int, ...], data: bytes, code: str = "f8", order: str = "<", fortran: int = 0
) -> bytes:
    """Return an array as Python 2 writes it; shape and bytes may disagree."""
    size = {"S": 1, "U": 4}.get(code[0], 0) * int(code[1:] or 0) or -1
    state = (whole(1), shape(*sides), element_type(code, order, size), whole(fortran))
    return empty_array() + several(*state, payload(data)) + b"b"


def array(values: NDArray[Any]) -> bytes:
    """Return an array with its type, byte order and memory order."""
    is_fortran = values.flags.f_contiguous and not values.flags.c_contiguous
    order = values.dtype.byteorder.replace("=", "<")
    return array_of(
        values.shape,
        values.tobytes("F" if is_fortran else "C"),
        values.dtype.str[1:],
        order,
        int(is_fortran),
    )


def created(module: str, name: str, state: bytes) -> bytes:
    """Return an object of a class with a state, as from protocol 2 on."""
    return named(module, name) + b")\x81" + state + b"b"


def matrix(
    *,
    sides: tuple[int, int] = (2, 3),
    data: Any = (1.0, 2.0, 3.0),
    indices: Any = (0, 1, 0),
    indptr: Any = (0, 1, 1, 3),
    module: str = "scipy.sparse.csc",
    name: str = "csc_matrix",
    shape_key: str = "_shape",
) -> bytes:
    """Return a sparse matrix; by default [[1, 0, 3], [0, 0, 2]]."""
    state = {
        "data": array(np.array(data, np.float64)),
        "indices": array(np.array(indices, np.int32)),
        "indptr": array(np.array(indptr, np.int32)),
        "maxprint": whole(50),
        shape_key: shape(*sides),
    }
    return created(module, name, mapping(**state))


def fake_class(monkeypatch: pytest.MonkeyPatch, module: str, name: str) -> type:
    """Create a class with a name that Python's pickler considers importable."""
    made = type(name, (), {"__module__": module})
    parts = module.split(".")
    for count in range(1, len(parts) + 1):
        path = ".".join(parts[:count])
        # The real modules, if imported by another test, would warn or refuse.
        monkeypatch.setitem(sys.modules, path, ModuleType(path))
    monkeypatch.setattr(sys.modules[module], name, made, raising=False)
    return made


def unframed(data: bytes) -> bytes:
    """Return a small pickle of protocol 4 or 5 without its frame, so that its length may change."""
    assert data[2:3] == b"\x95"
    return data[:2] + data[11:]
