"""Small glTF files that are built array by array."""

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from viewer.errors import FormatError
from viewer.formats import Source
from viewer.formats._scene_graph.content import NodeFile
from viewer.formats.gltf import read_nodes

CODES = {"b": 5120, "B": 5121, "h": 5122, "H": 5123, "I": 5125, "f": 5126}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
TRIANGLE = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


class File:
    """A document under construction; ``root`` is its JSON."""

    def __init__(self, **root: Any) -> None:
        self.binary = b""
        self.root: dict[str, Any] = {"asset": {"version": "2.0"}, **root}

    def view(self, data: bytes, **members: Any) -> int:
        """Append bytes, aligned to 4, and return the index of their buffer view."""
        self.binary += bytes(-len(self.binary) % 4)
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data), **members}
        self.binary += data
        return self.add("bufferViews", view)

    def accessor(self, values: Any, kind: str = "f", **members: Any) -> int:
        """Append an array, tightly packed, and return the index of its accessor."""
        array = np.asarray(values, dtype=f"<{np.dtype(kind).str[1:]}")
        rows = array if array.ndim == 2 else array[:, None]
        accessor = {
            "bufferView": self.view(array.tobytes()),
            "componentType": CODES[kind],
            "count": len(rows),
            "type": TYPES[rows.shape[1]],
            **members,
        }
        return self.add("accessors", accessor)

    def times(self, values: list[float]) -> int:
        """Append the times of keys, with their range."""
        return self.accessor(values, min=[min(values)], max=[max(values)])

    def add(self, name: str, item: Any) -> int:
        """Append an object to a list of the root and return its index."""
        self.root.setdefault(name, []).append(item)
        return len(self.root[name]) - 1

    def mesh(self, positions: Any = TRIANGLE, **attributes: Any) -> int:
        """Append a mesh of one primitive, whose attributes are accessors."""
        names = {"POSITION": self.accessor(positions), **attributes}
        return self.add("meshes", {"primitives": [{"attributes": names}]})

    @property
    def primitive(self) -> dict[str, Any]:
        """The first primitive of the first mesh."""
        return self.root["meshes"][0]["primitives"][0]

    def json(self, uri: str | None = None) -> bytes:
        """Return the document as text, with an embedded buffer unless a URI is given."""
        text = base64.b64encode(self.binary).decode()
        buffer = {"byteLength": len(self.binary), "uri": uri or f"data:;base64,{text}"}
        buffers = {"buffers": [buffer]} if self.binary else {}
        return json.dumps({**buffers, **self.root}).encode()

    def glb(self) -> bytes:
        """Return the document as a binary file."""
        buffers = {"buffers": [{"byteLength": len(self.binary)}]} if self.binary else {}
        text = json.dumps({**buffers, **self.root}).encode()
        chunks = [(b"JSON", text + b" " * (-len(text) % 4))]
        if self.binary:
            chunks.append((b"BIN\0", self.binary + bytes(-len(self.binary) % 4)))
        return glb(chunks)


def glb(chunks: list[tuple[bytes, bytes]]) -> bytes:
    """Return a binary file that consists of the given chunks."""
    body = b"".join(struct.pack("<I4s", len(data), kind) + data for kind, data in chunks)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def read(data: bytes | File, path: str | Path = "a.gltf") -> NodeFile:
    """Return the contents of a file."""
    return read_nodes(source_of(data, path))


def source_of(data: bytes | File, path: str | Path = "a.gltf") -> Source:
    return Source(path, data.json() if isinstance(data, File) else data)


def skinned(**attributes: Any) -> File:
    """Return a triangle skinned to two joints."""
    file = File()
    joints = file.accessor([[0, 1, 0, 0]] * 3, "B")
    weights = file.accessor([[0.25, 0.75, 0, 0]] * 3)
    file.mesh(JOINTS_0=joints, WEIGHTS_0=weights, **attributes)
    positions = file.primitive["attributes"]["POSITION"]
    file.root["accessors"][positions] |= {"min": [0, 0, 0], "max": [1, 1, 0]}
    file.root["nodes"] = [{"mesh": 0, "skin": 0}, {"children": [2]}, {}]
    file.root["skins"] = [{"joints": [1, 2]}]
    return file


def animated(
    path: str = "translation", values: Any = ((0, 0, 0), (1, 0, 0)), **sampler: Any
) -> File:
    """Return a node with an animation that has keys at 0 and 1 seconds."""
    file = File(nodes=[{}])
    samplers = [{"input": file.times([0.0, 1.0]), "output": file.accessor(values), **sampler}]
    channels = [{"sampler": 0, "target": {"node": 0, "path": path}}]
    file.root["animations"] = [{"channels": channels, "samplers": samplers}]
    return file


def refused(file: File | bytes) -> tuple[str, str]:
    """Return the key and the JSON pointer of the error for which a file is refused."""
    with pytest.raises(FormatError) as caught:
        read(file)
    return caught.value.diagnostic.key, caught.value.diagnostic.pointer


def warned(file: File | bytes) -> list[tuple[str, str]]:
    """Return the keys and JSON pointers of the warnings about a file."""
    source = source_of(file)
    read_nodes(source)
    return [(found.key, found.pointer) for found in source.diagnostics]
