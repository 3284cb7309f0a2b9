"""Buffers, buffer views and images of a glTF document, as bytes that are read on first use."""

from __future__ import annotations

import binascii
import re
from collections.abc import Callable
from pathlib import Path
from urllib.parse import unquote, unquote_to_bytes

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import FormatError
from viewer.formats._references import is_file, referenced_path, refused_text
from viewer.formats._source import read_bytes
from viewer.formats.gltf.elements import Element
from viewer.formats.gltf.meshopt import decoded_view, meshopt_of
from viewer.phrases import counted, quoted
from viewer.rigs.arrays import Bytes


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A part of a buffer."""

    data: Bytes
    """Bytes of the view, read-only: (N,) uint8."""
    stride: int
    """Bytes from one element to the next; 0 if elements are tightly packed."""
    offset: int
    """Position of the first byte in the buffer; data at multiples of 4 are aligned."""


@dataclass(frozen=True, slots=True, eq=False)
class EncodedImage:
    """An image as it is stored: PNG, JPEG or WebP."""

    name: str
    """Path relative to the document's folder; for embedded images the name of the image, which may
    be empty."""
    data: bytes
    """The encoded image."""
    is_embedded: bool
    """Whether it is part of the document rather than a separate file."""


def _located(buffer: Element, length: int) -> bytes:
    """Return the data of a buffer's URI; errors in an external file also name the buffer."""
    try:
        return _uri_bytes(buffer, length)
    except FormatError as problem:
        if problem.path == buffer.source.path:
            raise
        found = problem.diagnostic
        raise buffer.fault("F001.gltf-file: {problem}", "uri", problem=found) from None


class Buffers:
    """Bytes of a document; ``spend`` counts the bytes that are about to be decoded."""

    def __init__(
        self, root: Element, binary: memoryview | None, spend: Callable[[int, str], None]
    ) -> None:
        self._buffers, self._views = root.table("buffers"), root.table("bufferViews")
        self._images = root.table("images")
        self._source, self._binary, self._spend = root.source, binary, spend
        self._data: dict[int, Bytes] = {}
        self._decoded: dict[int, View] = {}
        self.n_bytes_read = len(root.source.data)
        """Size of the document and of its external files read so far."""

    @property
    def n_views(self) -> int:
        """Number of buffer views."""
        return len(self._views)

    @property
    def n_images(self) -> int:
        """Number of images."""
        return len(self._images)

    def data(self, index: int) -> Bytes:
        """Return the bytes of a buffer (N,), read-only; N may differ from ``byteLength``."""
        if index not in self._data:
            self._data[index] = self._read(index)
        return self._data[index]

    def view(self, index: int) -> View:
        """Return a buffer view, decompressed if it is compressed."""
        view = self._views[index]
        compressed = meshopt_of(view)
        if compressed is None:
            return self._part(view)
        if index not in self._decoded:
            data = decoded_view(compressed, self._part(compressed).data, self._spend)
            self._decoded[index] = View(data, view.whole("byteStride", 0), 0)
        return self._decoded[index]

    def image(self, index: int) -> EncodedImage:
        """Return an image, still encoded."""
        image = self._images[index]
        name = image.text("name")
        place = image.index("bufferView", self.n_views, "bufferViews")
        if place >= 0:
            return EncodedImage(name, self.view(place).data.tobytes(), True)
        if not image.has("uri"):
            raise image.fault("F002.gltf-image: expected a uri or a bufferView, found neither")
        uri = image.text("uri")
        if _is_data_uri(uri):
            return EncodedImage(name, _uri_bytes(image), True)
        path = _uri_path(image)
        file = path.relative_to(image.source.path.parent).as_posix()
        return EncodedImage(file, _uri_bytes(image), False)

    def _part(self, view: Element) -> View:
        """Return the bytes that a view, or the compressed form of one, refers to."""
        number = view.required_index("buffer", len(self._buffers), "buffers")
        offset, length = view.whole("byteOffset", 0), view.whole("byteLength")
        data = self.data(number)
        if offset + length > len(data):
            raise view.fault(
                "F002.gltf-view: expected bytes {first} to {end} of buffer {buffer}, found the end "
                "of its data after {size} bytes",
                first=offset,
                end=offset + length,
                buffer=number,
                size=len(data),
            )
        stride = view.whole("byteStride", 0)
        return View(data[offset : offset + length], stride, offset)

    def _read(self, index: int) -> Bytes:
        buffer = self._buffers[index]
        length = buffer.whole("byteLength")
        if buffer.has("uri"):
            data: bytes | memoryview = _located(buffer, length)
            if not _is_data_uri(buffer.text("uri")):
                self.n_bytes_read += len(data)
        elif index == 0 and self._binary is not None:
            data = self._binary
        else:
            raise buffer.fault("F002.gltf-no-data: expected a uri or a binary chunk, found neither")
        if len(data) < length:
            buffer.warn(
                "G001.buffer: expected {expected} as declared by byteLength, found {found}",
                expected=counted(length, "byte"),
                found=len(data),
            )
        return np.frombuffer(data, dtype=np.uint8)


_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:")  # at least two letters, because C: is a drive
_SHOWN = 60  # maximum number of characters of a URI in messages


def _is_data_uri(uri: str) -> bool:
    """Return whether a URI contains its data."""
    return uri[:5].lower() == "data:"


def _uri_bytes(element: Element, most: int | None = None) -> bytes:
    """Return what a buffer's or image's ``uri`` refers to; ``most``: bytes of a data URI."""
    uri = element.text("uri")
    if _is_data_uri(uri):
        return _data_uri_bytes(element, most)
    path = _uri_path(element)
    element.source.also_read.append(path)
    return read_bytes(path, element.source.max_size)


def _uri_path(element: Element) -> Path:
    """Return the file to which the ``uri`` of a buffer or image refers; it need not exist."""
    uri = element.text("uri")
    if _SCHEME.match(uri):
        raise element.fault(
            "F002.gltf-scheme: expected a data URI or a relative file name, found {found}",
            "uri",
            found=quoted(uri[:_SHOWN]),
        )
    folder = element.source.path.parent
    name = unquote(uri)
    path = referenced_path(folder, name)
    if path is None:
        reason = refused_text(name)
        raise element.fault(
            "F002.gltf-outside: {found} {reason}", "uri", found=quoted(name[:_SHOWN]), reason=reason
        )
    # Many exporters do not encode names, so a name may contain a literal %.
    literal = referenced_path(folder, uri) if "%" in uri else None
    return literal if literal is not None and is_file(literal) else path


def _data_uri_bytes(element: Element, most: int | None = None) -> bytes:
    """Return the data of a data URI (RFC 2397), with or without base64."""
    uri = element.text("uri")
    comma = uri.find(",")
    if comma < 0:
        raise element.fault(
            "F002.gltf-data-uri: expected a comma before the data, found {found}",
            "uri",
            found=quoted(uri[:_SHOWN]),
        )
    if not uri[:comma].rstrip().lower().endswith(";base64"):
        data = unquote_to_bytes(uri[comma + 1 :])
        return data if most is None else data[:most]
    end = len(uri) if most is None else comma + 1 + (most + 2) // 3 * 4
    try:
        return binascii.a2b_base64(uri[comma + 1 : end], strict_mode=True)
    except ValueError:
        return _decoded(element, uri[comma + 1 :])


def _decoded(element: Element, text: str) -> bytes:
    """Decode base64 with white space, without padding, or with the URL-safe alphabet."""
    plain = unquote(text).translate(str.maketrans("-_", "+/", " \t\r\n="))
    try:
        return binascii.a2b_base64(plain + "=" * (-len(plain) % 4), strict_mode=True)
    except ValueError:
        raise element.fault(
            "F002.gltf-base64: expected base64 data, found other characters or an incomplete end",
            "uri",
        ) from None
