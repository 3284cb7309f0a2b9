r"""Opened glTF documents: container, JSON, buffers and accessors, and a limit on decoded data.

::

    .gltf  JSON text
    .glb   "glTF" version:uint32 = 2 length:uint32 chunk…
    chunk  length:uint32 type:uint32 bytes, padded to 4 bytes
    types  "JSON" first, then "BIN\0" if there is a binary buffer; others are skipped

Lengths that contradict the size of the file are corrected with a warning if no data are lost.
"""

from __future__ import annotations

import gc
import json
import math
import re
import struct
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from viewer.diagnostics import wording
from viewer.errors import FormatError
from viewer.formats._archive.values import describe
from viewer.formats._source import Source
from viewer.formats._text.json_places import MOST_DIGITS
from viewer.formats.gltf.accessors import Accessors
from viewer.formats.gltf.buffers import Buffers
from viewer.formats.gltf.elements import Element, Table
from viewer.phrases import agree, counted, printable, quoted
from viewer.rigs.file_record import Json

_MAGIC = b"glTF"  # first bytes of a GLB
_HEADER = struct.Struct("<4sII")
_CHUNK = struct.Struct("<I4s")
_JSON, _BINARY = b"JSON", b"BIN\0"

_PADDING = b" \t\r\n\0"  # some writers pad the JSON chunk with zeros instead of spaces
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")
_HUGE = re.compile(r"\d[eE]\+?\d{3}|\d{309}")  # parts of numbers that may exceed float64
_THOROUGH = 1 << 20  # size in bytes up to which a text is always searched for repeated keys
_MOST_BYTES = 512 << 20  # maximum size of the text; parsing takes three times as much memory
_FREE_BYTES = 256 << 20  # number of decoded bytes that every file may have
_MOST_GROWTH = 64  # maximum decoded bytes per byte of the file; 20 is usual for compressed data
_Content = TypeVar("_Content")


class Document:
    """An opened glTF file: its JSON, bytes and arrays; ``binary`` is the binary chunk."""

    def __init__(self, source: Source, root: Json, binary: memoryview | None) -> None:
        self.source = source
        self.root = Element(source, root)
        self._tables: dict[str, Table] = {}
        self._decoded = 0
        self.buffers = Buffers(self.root, binary, self.spend)
        self.accessors = Accessors(self.root.table("accessors"), self.buffers, self.spend)

    def table(self, name: str) -> Table:
        """Return a list of the root, such as ``"nodes"``; an empty one if it is missing."""
        if name not in self._tables:
            self._tables[name] = self.root.table(name)
        return self._tables[name]

    def spend(self, n_bytes: int, pointer: str) -> None:
        """Count bytes to be decoded, or released if negative; refuse far more than the file has."""
        size = self._decoded + n_bytes
        most = _FREE_BYTES + _MOST_GROWTH * self.buffers.n_bytes_read
        if size > most:
            raise self.source.fault(
                "F002.gltf-decoded: expected at most {most} bytes of decoded data for a file of "
                "this size, found {size}",
                pointer,
                most=most,
                size=size,
            )
        self._decoded = size

    def kept(self, read: Callable[[], _Content], neutral: _Content) -> _Content:
        """Return the result of a function, or a neutral value if its error is only recorded."""
        try:
            return read()
        except FormatError as problem:
            if not self.source.diagnostics.keeps_errors:
                raise
            self.source.diagnostics.add(problem.diagnostic)
            return neutral


def open_document(source: Source) -> Document:
    """Open a ``.gltf``, ``.glb`` or ``.vrm`` file; its buffers are read on first use."""
    root, binary = _contents(source)
    # In glTF 1.0, the tables are objects instead of lists, so the version is checked first.
    _check_version(Element(source, root))
    return Document(source, root, binary)


def _check_version(root: Element) -> None:
    """Refuse documents that have another major version or require a later minor version."""
    asset = root.part("asset")
    if asset is None:
        root.warn("G001.no-asset: expected an asset with a version, found none: read as glTF 2.0")
        return
    stated = asset.values.get("version")
    # Some files of glTF 0.8 and 1.0 state the version as a number.
    if isinstance(stated, int | float) and not isinstance(stated, bool) and stated < 2:
        raise asset.fault(wording.GLTF_VERSION, "version", found=stated)
    version = asset.text("version", "2.0")
    if version.partition(".")[0] != "2":
        raise asset.fault(wording.GLTF_VERSION, "version", found=version)
    if asset.text("minVersion", "2.0") != "2.0":
        raise asset.fault(wording.GLTF_VERSION, "minVersion", found=asset.text("minVersion"))


def _contents(source: Source) -> tuple[Json, memoryview | None]:
    """Return the JSON and the binary chunk of a file; None if it has none."""
    data = source.data
    if not data.startswith(_MAGIC):
        return parsed_json(source, data, has_lines=True), None
    chunks: dict[bytes, memoryview] = {}
    for kind, content in _chunks(source):
        if kind in (_JSON, _BINARY) and kind in chunks:
            source.warn("G001.chunk-again: ignored another {kind} chunk", kind=_title(kind))
        chunks.setdefault(kind, content)
    if _JSON not in chunks:
        raise source.fault("F002.glb-json: expected a JSON chunk, found none")
    kinds = [*chunks]
    for place, kind in (("first", _JSON), ("second", _BINARY)):
        found = kinds[0 if place == "first" else min(1, len(kinds) - 1)]
        if kind in chunks and found != kind:
            titles = _title(kind), _title(found)
            source.warn(
                "G001.chunk-order: expected the {first} chunk as the {place} one, found {found}",
                first=titles[0],
                place=place,
                found=titles[1],
            )
            break
    text = bytes(chunks[_JSON])
    if text.endswith(b"\0"):
        source.warn("G001.padding: JSON chunk padded with zeros instead of spaces")
    return parsed_json(source, text, has_lines=False), chunks.get(_BINARY)


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
                raise source.fault(
                    "F002.glb-chunk: {kind} chunk: expected {expected}, found {found}",
                    kind="JSON",
                    expected=counted(length, "byte"),
                    found=found,
                )
            source.warn(
                "G001.chunk-length: {kind} chunk: expected {expected}, found {found}",
                kind=_title(kind),
                expected=counted(length, "byte"),
                found=end - place,
            )
        # A file whose length is too small may still contain the whole chunk.
        stop = min(place + length, len(data))
        yield kind, data[place:stop]
        place = _next(data, place + length)
    if place < end and bytes(data[place:end]).strip(b"\0 "):
        source.warn(
            "G001.trailing: ignored {n} after the last chunk", n=counted(end - place, "byte")
        )


def _end(source: Source) -> int:
    """Return the end of the last chunk, according to the header or the size of the file."""
    size = len(source.data)
    if size < _HEADER.size:
        raise source.fault(
            "F002.glb-header: expected a header of 12 bytes, found {found}",
            found=counted(size, "byte"),
        )
    _, version, length = _HEADER.unpack_from(source.data)
    if version != 2:
        raise source.fault(wording.GLTF_VERSION, found=version)
    if length != size:
        source.warn(
            "G001.length: expected {expected} as declared by the header, found {found}",
            expected=counted(length, "byte"),
            found=size,
        )
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


def parsed_json(source: Source, data: bytes, has_lines: bool) -> Json:
    """Return the parsed root object."""
    if len(data) > _MOST_BYTES:
        raise source.fault(
            "F001.gltf-text: expected at most {most:,.0f} bytes of JSON, found {size:,.0f}: "
            "store the data in a .glb or .bin file",
            most=_MOST_BYTES,
            size=len(data),
        )
    text = _decoded_text(source, data.rstrip(_PADDING).removeprefix(_BYTE_ORDER_MARK))
    constants: list[str] = []
    repeated: list[str] = []
    overflows: list[str] = []

    def constant(word: str) -> float:
        constants.append(word)
        return float(word)

    def number(word: str) -> float:
        value = float(word)
        if math.isinf(value):
            overflows.append(word)
        return value

    def unique(pairs: list[tuple[str, Any]]) -> Json:
        values = dict(pairs)
        if len(values) != len(pairs):
            counts = Counter(key for key, _ in pairs)
            repeated.extend(key for key, count in counts.items() if count > 1)
        return values

    # The search for repeated keys takes half as long as parsing.
    looks = len(text) < _THOROUGH or source.diagnostics.keeps_errors
    hook = unique if looks else None
    # Python calls a function for each number only if this is needed, because it is slow.
    of_numbers = number if _HUGE.search(text) else None
    decoder = json.JSONDecoder(
        object_pairs_hook=hook, parse_constant=constant, parse_float=of_numbers
    )
    try:
        with _collection_suspended():
            root = decoder.decode(text)
    except json.JSONDecodeError as problem:
        place = len(text[: problem.pos].encode(errors="replace")) if has_lines else None
        reason = printable(problem.msg, 100)
        raise source.fault(
            "F002.gltf-json: expected JSON, found a syntax error: {reason} (character {at})",
            place,
            reason=reason,
            at=problem.pos,
        ) from None
    except RecursionError:
        raise source.fault(wording.JSON_NESTING) from None
    except ValueError:  # the error is raised only for numbers with too many digits
        raise source.fault(
            "F002.gltf-digits: expected numbers of at most {most} digits, found a longer number",
            most=MOST_DIGITS,
        ) from None
    if type(root) is not dict:
        raise source.fault(wording.GLTF_TYPE, wanted="an object", found=describe(root))
    if constants:
        source.warn(
            "G001.constants: {n} invalid in JSON (first: {found})",
            n=counted(len(constants), "number"),
            found=constants[0],
        )
    if overflows:
        source.warn(
            "G001.overflow: {n} too large for double precision (first: {found})",
            n=counted(len(overflows), "number"),
            found=overflows[0],
        )
    if repeated:
        source.warn(
            "G001.repeated: {n} (first: {found}): only the last value is used",
            n=counted(len(repeated), "repeated key"),
            found=quoted(repeated[0]),
            names=repeated,
        )
    if "null" in text and (n_nulls := _remove_nulls(root)):
        source.warn(
            "G001.nulls: {n} that {are} null: ignored",
            n=counted(n_nulls, "member"),
            are=agree(n_nulls, "is", "are"),
        )
    return root


def _decoded_text(source: Source, data: bytes) -> str:
    if not data:
        raise source.fault("F002.gltf-no-json: expected a JSON object, found no text")
    if data.startswith(_UTF_16):
        raise source.fault("F002.gltf-utf-16: expected JSON in UTF-8, found UTF-16 text")
    try:
        return data.decode()
    except UnicodeDecodeError as problem:
        # Only names can be in another encoding, and they are only displayed; keys are ASCII.
        source.warn("G001.text: invalid UTF-8 at byte {at} of the JSON: replaced", at=problem.start)
        return data.decode(errors="replace")


@contextmanager
def _collection_suspended() -> Iterator[None]:
    """Suspend garbage collection: a quarter of the time, and parsed JSON has no cycles to find."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def _remove_nulls(root: Json) -> int:
    """Remove null members outside of application data, which some exporters write; count them."""
    count = 0
    left: list[Any] = [root]
    while left:
        value = left.pop()
        if type(value) is list:
            left.extend(item for item in value if type(item) in (dict, list))
            continue
        for name in [name for name, member in value.items() if member is None]:
            del value[name]
            count += 1
        members = (member for name, member in value.items() if name != "extras")
        left.extend(member for member in members if type(member) in (dict, list))
    return count
