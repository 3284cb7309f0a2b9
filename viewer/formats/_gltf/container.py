r"""Containers of glTF: JSON text, or GLB with its chunks.

::

    .glb   "glTF" version:uint32 = 2 length:uint32 chunk…
    chunk  length:uint32 type:uint32 bytes, padded to 4 bytes
    types  "JSON" first, then "BIN\0" if there is a binary buffer; others are skipped

Lengths that contradict the size of the file are corrected with a warning if no data are lost.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

from viewer.data_classes import dataclass
from viewer.formats._gltf.json_text import parsed
from viewer.formats._source import Source

__all__ = ["Container", "open_container"]

_MAGIC = b"glTF"  # first bytes of a GLB

_HEADER = struct.Struct("<4sII")
_CHUNK = struct.Struct("<I4s")
_JSON, _BINARY = b"JSON", b"BIN\0"


@dataclass(frozen=True, slots=True, eq=False)
class Container:
    """The two parts of a file.

    Attributes
    ----------
    root : dict
        Parsed JSON.
    binary : memoryview or None
        Contents of the binary chunk, with its padding; None if there is none.
    """

    root: dict[str, Any]
    binary: memoryview | None


def open_container(source: Source) -> Container:
    """Return the JSON and the binary chunk of a ``.gltf``, ``.glb`` or ``.vrm`` file.

    Raises
    ------
    FormatError
        If the file is neither JSON nor GLB, or its JSON is truncated or invalid.
    """
    data = source.data
    if not data.startswith(_MAGIC):
        return Container(parsed(source, data, has_lines=True), None)
    chunks: dict[bytes, memoryview] = {}
    for kind, content in _chunks(source):
        if kind in (_JSON, _BINARY) and kind in chunks:
            source.warn("G001.chunk-again", kind=_title(kind))
        chunks.setdefault(kind, content)
    if _JSON not in chunks:
        raise source.fault("F002.glb-json")
    kinds = [*chunks]
    for place, kind in (("first", _JSON), ("second", _BINARY)):
        found = kinds[0 if place == "first" else min(1, len(kinds) - 1)]
        if kind in chunks and found != kind:
            titles = _title(kind), _title(found)
            source.warn("G001.chunk-order", first=titles[0], place=place, found=titles[1])
            break
    text = bytes(chunks[_JSON])
    if text.endswith(b"\0"):
        source.warn("G001.padding")
    return Container(parsed(source, text, has_lines=False), chunks.get(_BINARY))


def _chunks(source: Source) -> Iterator[tuple[bytes, memoryview]]:
    """Yield the type and the content of each chunk."""
    data = memoryview(source.data)
    end = _end(source)
    place = _HEADER.size
    while place + _CHUNK.size <= end:
        length, kind = _CHUNK.unpack_from(data, place)
        place += _CHUNK.size
        if place + length > end:
            found = len(data) - place
            if kind == _JSON and length > found:
                raise source.fault("F002.glb-chunk", kind="JSON", expected=length, found=found)
            source.warn("G001.chunk-length", kind=_title(kind), expected=length, found=end - place)
        # A file whose length is too small may still contain the whole chunk.
        stop = min(place + length, len(data))
        yield kind, data[place:stop]
        place = _next(data, place + length)
    if place < end and bytes(data[place:end]).strip(b"\0 "):
        source.warn("G001.trailing", n=end - place)


def _end(source: Source) -> int:
    """Return the end of the last chunk, according to the header or the size of the file."""
    size = len(source.data)
    if size < _HEADER.size:
        raise source.fault("F002.glb-header", found=size)
    _, version, length = _HEADER.unpack_from(source.data)
    if version != 2:
        raise source.fault("F002.gltf-version", found=version)
    if length != size:
        source.warn("G001.length", expected=length, found=size)
    # A file that is too long has other data after its chunks; a truncated one ends early.
    return length if _HEADER.size + _CHUNK.size <= length < size else size


def _next(data: memoryview, place: int) -> int:
    """Return the start of the next chunk; some writers pad chunks without counting the padding."""
    padded = place + -place % 4
    if padded != place and bytes(data[padded + 4 : padded + 8]) in (_JSON, _BINARY):
        return padded
    return place


def _title(kind: bytes) -> str:
    return kind.rstrip(b"\0 ").decode("ascii", "backslashreplace")
