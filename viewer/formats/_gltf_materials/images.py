"""Images of a glTF document: PNG, JPEG and WebP, embedded or in files below its folder.

Only images that textures use are read. They are decoded in parallel, each only once.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from viewer.data_classes import dataclass
from viewer.errors import FormatError
from viewer.formats._gltf.buffers import EncodedImage
from viewer.formats._gltf.document import Document
from viewer.media.image import decoding_pictures
from viewer.rig.arrays import Bytes

__all__ = ["DecodedImage", "decoding_images"]

_KEPT = (b"\x89PNG", b"\xff\xd8\xff")  # formats that every glTF file may contain
_UNSUPPORTED = {b"\xabKTX": "KTX2", b"DDS ": "DDS"}


@dataclass(frozen=True, slots=True, eq=False)
class DecodedImage:
    """An image of a document.

    Attributes
    ----------
    name : str
        Path relative to the document's folder; for embedded images the name of the image.
    pixels : (H, W, 4) uint8 or None
        First row at the top; None if the image cannot be read.
    encoded : bytes or None
        The file, if it is embedded and a PNG or a JPEG.
    """

    name: str
    pixels: Bytes | None = None
    encoded: bytes | None = None


@contextlib.contextmanager
def decoding_images(
    document: Document, indices: Iterable[int]
) -> Iterator[Callable[[], dict[int, DecodedImage]]]:
    """Decode images of a document while the body of the ``with`` statement runs.

    Parameters
    ----------
    document : Document
        The opened file.
    indices : iterable of int
        Valid indices of images; may repeat.

    Yields
    ------
    callable
        Waits, and returns the images by index; images that cannot be read cause a warning.
    """
    found = {index: _encoded(document, index) for index in sorted(set(indices))}
    images = {index: image for index, image in found.items() if image is not None}
    path = document.source.path
    files = [
        (path if image.is_embedded else path.parent / image.name, image.data)
        for image in images.values()
    ]

    def finish() -> dict[int, DecodedImage]:
        decoded = {
            index: _decoded(document, index, image, pixels)
            for (index, image), pixels in zip(images.items(), pixels_of(), strict=True)
        }
        return {index: decoded.get(index, DecodedImage(f"image{index}")) for index in found}

    with decoding_pictures(files) as pixels_of:
        yield finish


def _decoded(
    document: Document, index: int, image: EncodedImage, pixels: Bytes | FormatError
) -> DecodedImage:
    """Return an image with its pixels; without them, and with a warning, if it is unreadable."""
    name = image.name or f"image{index}"
    if isinstance(pixels, FormatError):
        problem = pixels.diagnostic.message if image.is_embedded else str(pixels)
        document.source.warn("F005.gltf-image", f"/images/{index}", problem=problem)
        return DecodedImage(name)
    keeps = image.is_embedded and image.data.startswith(_KEPT)
    return DecodedImage(name, pixels, image.data if keeps else None)


def _encoded(document: Document, index: int) -> EncodedImage | None:
    """Return an encoded image; None with a warning if it is missing or unsupported."""
    try:
        image = document.buffers.image(index)
    except FormatError as problem:
        # An error without a JSON pointer concerns the file of the image, which the message names.
        has_pointer = bool(problem.diagnostic.pointer)
        said = problem.diagnostic.message if has_pointer else _named(document, problem)
        document.source.warn("F005.gltf-image", f"/images/{index}", problem=said)
        return None
    unsupported = next(
        (name for magic, name in _UNSUPPORTED.items() if image.data.startswith(magic)), None
    )
    if unsupported is not None:
        document.source.warn("F005.gltf-format", f"/images/{index}", found=unsupported)
        return None
    return image


def _named(document: Document, problem: FormatError) -> str:
    """Return an error with the name of its file, relative to the document's folder."""
    found = problem.diagnostic
    folder = document.source.path.parent
    path = found.path or Path()
    name = path.relative_to(folder) if path.is_relative_to(folder) else path
    return f"{name.as_posix()}: {found.message}"
