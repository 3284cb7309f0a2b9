"""Torch and joblib files as bytes, written without these packages, optionally with errors."""

import io
import struct
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from formats.pickle_bytes import named, several, shape, unicode, whole
from numpy.typing import NDArray

STORAGES = {
    "f4": "FloatStorage",
    "f8": "DoubleStorage",
    "f2": "HalfStorage",
    "i8": "LongStorage",
    "i4": "IntStorage",
    "i2": "ShortStorage",
    "i1": "CharStorage",
    "u1": "ByteStorage",
    "b1": "BoolStorage",
}
MAGIC = b"\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19"


def value(given: Any, array: Callable[[NDArray[Any]], bytes]) -> bytes:
    """Return the opcodes of nested dicts, lists, tuples, strings, numbers and arrays."""
    match given:
        case dict():
            pairs = b"".join(value(key, array) + value(of, array) for key, of in given.items())
            return b"}(" + pairs + b"u"
        case list():
            return b"](" + b"".join(value(item, array) for item in given) + b"e"
        case tuple():
            return several(*(value(item, array) for item in given))
        case str():
            return unicode(given)
        case bytes():
            return b"B" + struct.pack("<I", len(given)) + given
        case None:
            return b"N"
        case bool():
            return b"\x88" if given else b"\x89"
        case int():
            return whole(given)
        case float():
            return b"G" + struct.pack(">d", given)
        case np.generic():
            return value(given.item(), array)
    return array(given)


def storage(kind: str, key: str, count: int) -> bytes:
    """Return the persistent id of a storage."""
    parts = unicode("storage"), named("torch", kind), unicode(key), unicode("cpu"), whole(count)
    return several(*parts) + b"Q"


def tensor(stored: bytes, offset: int, size: tuple[int, ...], stride: tuple[int, ...]) -> bytes:
    """Return a call of ``_rebuild_tensor_v2`` for a storage."""
    hooks = named("collections", "OrderedDict") + b")R"
    arguments = stored, whole(offset), shape(*size), shape(*stride), b"\x89", hooks
    return named("torch._utils", "_rebuild_tensor_v2") + several(*arguments) + b"R"


@dataclass
class Tensors:
    """The storages of the tensors in a value, collected one for each array."""

    stored: dict[str, bytes] = field(default_factory=dict)
    order: str = "<"

    def array(self, values: NDArray[Any]) -> bytes:
        values, key = np.asarray(values), str(len(self.stored))
        code = values.dtype.str[1:]
        flat = np.ascontiguousarray(values)
        self.stored[key] = flat.astype(flat.dtype.newbyteorder(self.order)).tobytes()
        steps = tuple(step // values.itemsize for step in flat.strides)
        kept = storage(STORAGES[code], key, values.size)
        return tensor(kept, 0, values.shape, steps)


def zip_file(
    body: bytes, stored: dict[str, bytes], order: str = "little", method: int = 0, **more: bytes
) -> bytes:
    """Return a torch file of a pickle, given without protocol and end, and its storages."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        archive.writestr("archive/data.pkl", b"\x80\x02" + body + b".")
        archive.writestr("archive/byteorder", order)
        for key, data in stored.items():
            archive.writestr(f"archive/data/{key}", data)
        archive.writestr("archive/version", b"3\n")
        for name, data in more.items():
            archive.writestr(f"archive/{name}", data)
    return stream.getvalue()


def torch_zip(given: Any, order: str = "little") -> bytes:
    """Return a torch file of a value with its arrays as tensors."""
    tensors = Tensors(order="<" if order == "little" else ">")
    return zip_file(value(given, tensors.array), tensors.stored, order)


def legacy_file(body: bytes, stored: dict[str, tuple[int, bytes]], is_little: bool = True) -> bytes:
    """Return a legacy stream of a pickle and its storages, each after its number of elements."""
    system = {"protocol_version": 1001, "little_endian": is_little, "type_sizes": {"int": 4}}
    keys = value([*stored], lambda _: b"")
    pickles = MAGIC, whole(1001), value(system, lambda _: b""), body, keys
    data = b"".join(b"\x80\x02" + part + b"." for part in pickles)
    return data + b"".join(struct.pack("<q", count) + part for count, part in stored.values())


def torch_legacy(given: Any) -> bytes:
    """Return a legacy file of a value with its arrays as tensors."""
    tensors = Tensors()
    body = value(given, tensors.array)
    sizes = [array.size for array in _arrays(given)]
    pairs = zip(sizes, tensors.stored.items(), strict=True)
    return legacy_file(body, {key: (count, data) for count, (key, data) in pairs})


def _arrays(given: Any) -> list[NDArray[Any]]:
    if isinstance(given, dict):
        return [array for of in given.values() for array in _arrays(of)]
    if isinstance(given, list | tuple):
        return [array for of in given for array in _arrays(of)]
    return [given] if isinstance(given, np.ndarray) else []


def nested_tensor(values: NDArray[Any]) -> bytes:
    """Return a tensor in an ordinary pickle, with its storage as a separate legacy stream."""
    kept = storage(STORAGES[values.dtype.str[1:]], "7", values.size)
    stream = legacy_file(kept, {"7": (values.size, values.tobytes())})
    load = named("torch.storage", "_load_from_bytes") + several(value(stream, tensor_of)) + b"R"
    steps = tuple(step // values.itemsize for step in values.strides)
    return tensor(load, 0, values.shape, steps)


def tensor_of(values: NDArray[Any]) -> bytes:
    """As ``nested_tensor``, for ``value``."""
    return nested_tensor(np.ascontiguousarray(values))


def object_npy(given: Any, array: Callable[[NDArray[Any]], bytes] = tensor_of) -> bytes:
    """Return an ``.npy`` file of a single object, as ``numpy.save`` writes a dict."""
    header = b"{'descr': '|O', 'fortran_order': False, 'shape': (), }".ljust(117) + b"\n"
    dtype = named("numpy", "dtype") + several(unicode("O8"), b"\x89", b"\x88") + b"R"
    state = several(whole(3), unicode("|"), b"N", b"N", b"N", whole(-1), whole(-1), whole(63))
    made = named("numpy.core.multiarray", "_reconstruct")
    made += several(named("numpy", "ndarray"), shape(0), unicode("b")) + b"R"
    objects = several(whole(1), shape(), dtype + state + b"b", b"\x89", value([given], array))
    data = b"\x80\x03" + made + objects + b"b."
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(header)) + header + data
