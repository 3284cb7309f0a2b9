"""Builder of a glTF 2.0 file: its JSON, and the arrays and images in its buffer.

Specification: Khronos Group, ``registry.khronos.org/glTF/specs/2.0``.
"""

from __future__ import annotations

import json
import math
import struct
from typing import Any, Literal, TypeAlias
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from viewer.errors import RigError
from viewer.media.image import media_type
from viewer.rigs.file_record import GENERATOR, Json

VERTICES, INDICES = 34962, 34963  # targets of buffer views
_TYPES = {
    np.dtype("u1"): 5121,
    np.dtype("<i2"): 5122,
    np.dtype("<u2"): 5123,
    np.dtype("<u4"): 5125,
    np.dtype("<f4"): 5126,
}
Kind: TypeAlias = Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT4"]
"""Type of the elements of an accessor."""
_SIZES: dict[Kind, int] = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_PADDING = 4  # alignment of arrays, bytes: size of the largest component
_LONGEST = 2**32 - 1  # a .glb stores its length in 32 bits
_HEADER = 28  # bytes of a .glb in addition to JSON and arrays


class Document:
    """Contents of a file; all objects are referred to by index."""

    def __init__(self, name: str) -> None:
        self.root: Json = {"asset": {"version": "2.0", "generator": GENERATOR}}
        self.extras: list[tuple[str, object]] = []
        """Name and application data of each figure whose file has some."""
        self.n_omitted = 0
        """Infinite and NaN values of the original files that ``glb`` or ``pair`` omitted."""
        self._name = name
        self._parts: list[bytes] = []
        self._size = 0
        self._pictures: dict[bytes, int] = {}
        self._arrays: dict[tuple[object, ...], list[int]] = {}

    def add(self, kind: str, item: Json) -> int:
        """Append an item to ``nodes``, ``meshes`` … and return its index."""
        items: list[Json] = self.root.setdefault(kind, [])
        items.append(item)
        return len(items) - 1

    def declare(self, *extensions: str, member: str = "extensionsUsed") -> None:
        """Add extensions to those that the file uses, or to ``extensionsRequired``."""
        known: list[str] = self.root.setdefault(member, [])
        known += [name for name in extensions if name not in known]

    def array(
        self, values: NDArray[np.number], kind: Kind, target: int = 0, bounds: bool = False
    ) -> int:
        """Add values (N, ...), N > 0, of which floats become float32; return the accessor."""
        return self.arrays(values[None], kind, target, bounds)[0]

    def arrays(
        self, values: NDArray[np.number], kind: Kind, target: int = 0, bounds: bool = False
    ) -> list[int]:
        """Add arrays (A, N, ...) as ``array`` does, equal ones once; return their accessors."""
        stored = self._stored(values)
        rows = stored.reshape(len(stored), -1, _SIZES[kind])
        data = stored.tobytes()
        known = data, kind, stored.dtype, rows.shape, target, bounds
        if known in self._arrays:
            return list(self._arrays[known])
        view = self._view(data, target)
        accessors = []
        for number, part in enumerate(rows):
            accessor = {
                "bufferView": view,
                "byteOffset": number * part.nbytes,
                "componentType": _TYPES[stored.dtype],
                "count": len(part),
                "type": kind,
            }
            if bounds:
                accessor["min"] = part.min(axis=0).tolist()
                accessor["max"] = part.max(axis=0).tolist()
            accessors.append(self.add("accessors", accessor))
        self._arrays[known] = accessors
        return list(accessors)

    def integers(self, values: NDArray[np.integer], kind: Kind, bounds: bool = False) -> int:
        """Add normalised integers (N, C), padded to rows of 4 bytes; return the accessor."""
        stored = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
        size = stored.itemsize * stored.shape[1]
        stride = size + -size % _PADDING
        rows = np.zeros((len(stored), stride // stored.itemsize), stored.dtype)
        rows[:, : stored.shape[1]] = stored
        data = rows.tobytes()
        known = data, kind, stored.dtype, stride, bounds
        if known in self._arrays:
            return self._arrays[known][0]
        view = self._view(data, VERTICES)
        self.root["bufferViews"][view]["byteStride"] = stride
        accessor: Json = {
            "bufferView": view,
            "byteOffset": 0,
            "componentType": _TYPES[stored.dtype],
            "normalized": True,
            "count": len(stored),
            "type": kind,
        }
        if bounds:
            accessor["min"] = stored.min(axis=0).tolist()
            accessor["max"] = stored.max(axis=0).tolist()
        self._arrays[known] = [self.add("accessors", accessor)]
        return self._arrays[known][0]

    def picture(self, data: bytes, name: str) -> int:
        """Add an image, the bytes of a PNG or JPEG file, once; return its index in ``images``."""
        if data not in self._pictures:
            image = {
                "name": text_of(name),
                "mimeType": media_type(data),
                "bufferView": self._view(data, 0),
            }
            self._pictures[data] = self.add("images", image)
        return self._pictures[data]

    def glb(self) -> bytes:
        """Return everything as one binary file; raise RigError if that is too large."""
        content = self._json({"byteLength": self._size})
        content += b" " * (-len(content) % _PADDING)
        length = _HEADER + len(content) + self._size
        if length > _LONGEST:
            raise RigError(f"{self._name}: {length} bytes exceed the maximum size of a .glb")
        chunks = struct.pack("<I4s", len(content), b"JSON") + content
        if self._parts:
            chunks += struct.pack("<I4s", self._size, b"BIN\0") + b"".join(self._parts)
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

    def pair(self, buffer_name: str) -> tuple[bytes, bytes]:
        """Return the JSON file, and the contents of the buffer file with that name next to it."""
        uri = quote(buffer_name.encode("utf-8", "surrogateescape"), safe="")
        return self._json({"uri": uri, "byteLength": self._size}), b"".join(self._parts)

    def _json(self, buffer: Json) -> bytes:
        whole = {**self.root, "buffers": [buffer]} if self._parts else self.root
        try:
            return _text(whole)
        except ValueError:
            whole, self.n_omitted = _finite(whole)
            return _text(whole)

    def _view(self, data: bytes, target: int) -> int:
        view = {"buffer": 0, "byteOffset": self._size, "byteLength": len(data)}
        if target:
            view["target"] = target
        padded = data + b"\0" * (-len(data) % _PADDING)
        self._parts.append(padded)
        self._size += len(padded)
        return self.add("bufferViews", view)

    def _stored(self, values: NDArray[np.number]) -> NDArray[np.number]:
        if values.dtype.kind != "f":
            return np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
        with np.errstate(over="ignore"):
            single = np.ascontiguousarray(values, dtype="<f4")
        if not np.isfinite(single).all():
            worst = values[~np.isfinite(single)][0]
            raise RigError(
                f"{self._name}: expected numbers that fit glTF's single precision, found {worst:g}"
            )
        return single


def _text(value: object) -> bytes:
    """Return JSON, with ``?`` for half a surrogate; infinite and NaN numbers raise ValueError."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.encode("utf-8", "replace")


def _finite(value: object) -> tuple[Any, int]:
    """Return a value without infinite and NaN members, which are 0 in lists, and their number."""
    if isinstance(value, dict):
        found = {key: _finite(each) for key, each in value.items() if not _is_odd(each)}
        own = len(value) - len(found)
        parts = found.values()
        return {key: each for key, (each, _) in found.items()}, own + sum(n for _, n in parts)
    if isinstance(value, list | tuple):
        rows = [(0.0, 1) if _is_odd(each) else _finite(each) for each in value]
        return [each for each, _ in rows], sum(n for _, n in rows)
    return value, 0


def _is_odd(value: object) -> bool:
    return isinstance(value, float) and not math.isfinite(value)


def named(name: str) -> Json:
    """Return the members of an object with a name; none if it is empty."""
    return {"name": text_of(name)} if name else {}


def text_of(name: str) -> str:
    """Return a name as Unicode text: surrogates of undecodable file names become ``?``."""
    return name.encode("utf-8", "replace").decode()
