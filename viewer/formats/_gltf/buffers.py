"""Buffers, buffer views and images of a glTF document, as bytes that are read on first use."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import FormatError
from viewer.formats._gltf.elements import Element
from viewer.formats._gltf.meshopt import decoded_view, meshopt_of
from viewer.formats._gltf.uris import is_data_uri, uri_bytes, uri_path
from viewer.rig.arrays import Bytes

__all__ = ["Buffers", "EncodedImage", "View"]


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A part of a buffer.

    Attributes
    ----------
    data : (N,) uint8
        Bytes of the view, read-only.
    stride : int
        Bytes from one element to the next; 0 if elements are tightly packed.
    offset : int
        Position of the first byte in the buffer; data at multiples of 4 are aligned.
    """

    data: Bytes
    stride: int
    offset: int


@dataclass(frozen=True, slots=True, eq=False)
class EncodedImage:
    """An image as it is stored: PNG, JPEG or WebP.

    Attributes
    ----------
    name : str
        Path relative to the document's folder; for embedded images the name of the image, which
        may be empty.
    data : bytes
        The encoded image.
    is_embedded : bool
        Whether it is part of the document rather than a separate file.
    """

    name: str
    data: bytes
    is_embedded: bool


def _located(buffer: Element, length: int) -> bytes:
    """Return the data of a buffer's URI; errors in an external file also name the buffer."""
    try:
        return uri_bytes(buffer, length)
    except FormatError as problem:
        if problem.path == buffer.source.path:
            raise
        found = problem.diagnostic
        raise buffer.fault("F001.gltf-file", "uri", problem=found) from None


class Buffers:
    """Bytes of a document.

    Parameters
    ----------
    root : Element
        Root object of the document.
    binary : memoryview or None
        Binary chunk of a GLB.
    spend : callable
        Counts bytes that are about to be decoded; see ``Document.spend``.
    """

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
        """Return the bytes of a buffer: (N,) uint8, read-only; N may differ from ``byteLength``.

        Raises
        ------
        FormatError
            If the buffer has no data, or the data cannot be read.
        """
        if index not in self._data:
            self._data[index] = self._read(index)
        return self._data[index]

    def view(self, index: int) -> View:
        """Return a buffer view, decompressed if it is compressed.

        Raises
        ------
        FormatError
            If the view is invalid or exceeds its data, or the data cannot be read.
        """
        view = self._views[index]
        compressed = meshopt_of(view)
        if compressed is None:
            return self._part(view)
        if index not in self._decoded:
            data = decoded_view(compressed, self._part(compressed).data, self._spend)
            self._decoded[index] = View(data, view.whole("byteStride", 0), 0)
        return self._decoded[index]

    def image(self, index: int) -> EncodedImage:
        """Return an image, still encoded.

        Raises
        ------
        FormatError
            If the image's data is missing, unreadable, or outside the folder.
        """
        image = self._images[index]
        name = image.text("name")
        place = image.index("bufferView", self.n_views, "bufferViews")
        if place >= 0:
            return EncodedImage(name, self.view(place).data.tobytes(), True)
        if not image.has("uri"):
            raise image.fault("F002.gltf-image")
        uri = image.text("uri")
        if is_data_uri(uri):
            return EncodedImage(name, uri_bytes(image), True)
        path = uri_path(image)
        file = path.relative_to(image.source.path.parent).as_posix()
        return EncodedImage(file, uri_bytes(image), False)

    def _part(self, view: Element) -> View:
        """Return the bytes that a view, or the compressed form of one, refers to."""
        number = view.required_index("buffer", len(self._buffers), "buffers")
        offset, length = view.whole("byteOffset", 0), view.whole("byteLength")
        data = self.data(number)
        if offset + length > len(data):
            raise view.fault(
                "F002.gltf-view", first=offset, end=offset + length, buffer=number, size=len(data)
            )
        stride = view.whole("byteStride", 0)
        return View(data[offset : offset + length], stride, offset)

    def _read(self, index: int) -> Bytes:
        buffer = self._buffers[index]
        length = buffer.whole("byteLength")
        if buffer.has("uri"):
            data: bytes | memoryview = _located(buffer, length)
            if not is_data_uri(buffer.text("uri")):
                self.n_bytes_read += len(data)
        elif index == 0 and self._binary is not None:
            data = self._binary
        else:
            raise buffer.fault("F002.gltf-no-data")
        if len(data) < length:
            buffer.warn("G001.buffer", expected=length, found=len(data))
        return np.frombuffer(data, dtype=np.uint8)
