"""A glTF document: its JSON, buffers and accessors, and a limit on decoded data."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from viewer.errors import FormatError
from viewer.formats._source import Source
from viewer.formats.gltf.accessors import Accessors
from viewer.formats.gltf.buffers import Buffers
from viewer.formats.gltf.container import Container, open_container
from viewer.formats.gltf.elements import Element, Table

Content = TypeVar("Content")
_FREE_BYTES = 256 << 20  # number of decoded bytes that every file may have
_MOST_GROWTH = 64  # maximum decoded bytes per byte of the file; 20 is usual for compressed data


class Document:
    """An opened glTF file.

    Parameters
    ----------
    source : Source
        The file, which records diagnostics.
    container : Container
        Its JSON and binary chunk.

    Attributes
    ----------
    source : Source
        The file.
    root : Element
        The root object.
    buffers : Buffers
        Bytes of buffers, buffer views and images.
    accessors : Accessors
        Arrays.
    """

    def __init__(self, source: Source, container: Container) -> None:
        self.source = source
        self.root = Element(source, container.root)
        self._tables: dict[str, Table] = {}
        self._decoded = 0
        self.buffers = Buffers(self.root, container.binary, self.spend)
        self.accessors = Accessors(self.root.table("accessors"), self.buffers, self.spend)

    def table(self, name: str) -> Table:
        """Return a list of the root, such as ``"nodes"``; an empty one if it is missing."""
        if name not in self._tables:
            self._tables[name] = self.root.table(name)
        return self._tables[name]

    def spend(self, n_bytes: int, pointer: str) -> None:
        """Count bytes that are about to be decoded; negative numbers are bytes that were released.

        Raises
        ------
        FormatError
            If the decoded data are much larger than the file, which may declare huge arrays.
        """
        size = self._decoded + n_bytes
        most = _FREE_BYTES + _MOST_GROWTH * self.buffers.n_bytes_read
        if size > most:
            raise self.source.fault("F002.gltf-decoded", pointer, most=most, size=size)
        self._decoded = size

    def kept(self, read: Callable[[], Content], neutral: Content) -> Content:
        """Return the result of a function, or a neutral value if its error is only recorded.

        Raises
        ------
        FormatError
            The function's error, unless the source continues after errors.
        """
        try:
            return read()
        except FormatError as problem:
            if not self.source.diagnostics.keeps_errors:
                raise
            self.source.diagnostics.add(problem.diagnostic)
            return neutral


def open_document(source: Source) -> Document:
    """Open a ``.gltf``, ``.glb`` or ``.vrm`` file; its buffers are read on first use.

    Raises
    ------
    FormatError
        If its container or its JSON is invalid, or it has another version.
    """
    container = open_container(source)
    # In glTF 1.0, the tables are objects instead of lists, so the version is checked first.
    _check_version(Element(source, container.root))
    return Document(source, container)


def _check_version(root: Element) -> None:
    """Refuse documents that have another major version or require a later minor version."""
    asset = root.part("asset")
    if asset is None:
        root.warn("G001.no-asset")
        return
    stated = asset.values.get("version")
    # Some files of glTF 0.8 and 1.0 state the version as a number.
    if isinstance(stated, int | float) and not isinstance(stated, bool) and stated < 2:
        raise asset.fault("F002.gltf-version", "version", found=stated)
    version = asset.text("version", "2.0")
    if version.partition(".")[0] != "2":
        raise asset.fault("F002.gltf-version", "version", found=version)
    if asset.text("minVersion", "2.0") != "2.0":
        raise asset.fault("F002.gltf-version", "minVersion", found=asset.text("minVersion"))
