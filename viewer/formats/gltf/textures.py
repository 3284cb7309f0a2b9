"""Textures of glTF materials: their images, samplers, coordinates and transforms.

Images are PNG, JPEG or WebP, embedded or in files below the folder of the document. Only those that
textures use are read; they are decoded in parallel, each only once. Invalid references and members
are ignored with a warning, because the shape can still be shown.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import wording
from viewer.errors import FormatError
from viewer.formats._source import Source
from viewer.formats.gltf.buffers import EncodedImage
from viewer.formats.gltf.document import Document
from viewer.formats.gltf.elements import Element
from viewer.media.image import decoding_pictures
from viewer.phrases import one_of, quoted
from viewer.rigs.arrays import Bytes, Floats
from viewer.rigs.file_record import Json
from viewer.rigs.material import MINIFICATIONS, Texture

_WRAPS = {33071: "clamp", 10497: "repeat", 33648: "mirror"}
_NEAREST, _LINEAR = 9728, 9729
_MINIFIED = dict(zip((9728, 9729, 9984, 9985, 9986, 9987), MINIFICATIONS, strict=True))
_READABLE = "EXT_texture_webp"
_UNREADABLE = ("KHR_texture_basisu", "MSFT_texture_dds", "EXT_texture_avif")

_KEPT = (b"\x89PNG", b"\xff\xd8\xff")  # first bytes of the formats that every file may contain
_UNSUPPORTED = {b"\xabKTX": "KTX2", b"DDS ": "DDS"}
_LARGEST = 1e6  # maximum offset and scale; with larger ones, single precision cannot resolve texels

_Content = TypeVar("_Content")


@dataclass(frozen=True, slots=True, eq=False)
class Slot:
    """Reference of a material to a texture."""

    image: int
    """Index of the image, -1 if there is none that can be read."""
    placing: Json
    """Texture coordinate set, transform, wrap modes and filters, as in ``Texture``."""

    def texture(self, images: dict[int, DecodedImage]) -> Texture:
        """Return the texture with its pixels."""
        image = images.get(self.image, DecodedImage(""))
        pixels, encoded = image.pixels, image.encoded
        return Texture(image.name, pixels, encoded=encoded, **self.placing)


def read_slot(document: Document, parent: Element, name: str) -> Slot | None:
    """Return the texture that a material's member, such as ``normalTexture``, names, or None."""
    source = document.source
    info = lenient(source, lambda: parent.part(name), None)
    if info is None:
        return None
    textures = document.table("textures")
    index = lenient(source, lambda: info.index("index", len(textures), "textures"), -1)
    texture = lenient(source, lambda: textures[index], None) if index >= 0 else None
    if texture is None:
        return None
    placing = _placed(info) | _sampled(document, texture)
    return Slot(_image(document, texture), placing)


def _image(document: Document, texture: Element) -> int:
    """Return the index of a texture's image; -1 with a warning if none is readable."""
    source, count = document.source, document.buffers.n_images
    found = -1
    for element in (_extension(texture, _READABLE), texture):
        if element is not None and found < 0:
            read = partial(element.index, "source", count, "images")
            found = lenient(source, read, -1)
    if found < 0:
        named = [name for name in _UNREADABLE if _extension(texture, name) is not None]
        if named:
            texture.warn(wording.GLTF_FORMAT, found=named[0])
        else:
            texture.warn("F005.gltf-texture: no image; drawn untextured")
    return found


def _sampled(document: Document, texture: Element) -> Json:
    """Return the wrap modes and filters of a texture; by default it repeats, filtered linearly."""
    source, table = document.source, document.table("samplers")
    index = lenient(source, lambda: texture.index("sampler", len(table), "samplers"), -1)
    sampler = lenient(source, lambda: table[index], None) if index >= 0 else None
    if sampler is None:
        return {"wrap": ("repeat", "repeat")}
    wrap = tuple(_constant(sampler, name, _WRAPS, "repeat") for name in ("wrapS", "wrapT"))
    smoothness = {_NEAREST: "nearest", _LINEAR: "linear"}
    magnified = _constant(sampler, "magFilter", smoothness, "linear")
    minified = _constant(sampler, "minFilter", _MINIFIED, "")
    return {"wrap": wrap, "is_smooth": magnified == "linear", "minification": minified}


def _constant(sampler: Element, name: str, meanings: dict[int, str], default: str) -> str:
    """Return the meaning of an OpenGL constant; the default, with a warning, if it is unknown."""
    if not sampler.has(name):
        return default
    value = lenient(sampler.source, lambda: sampler.whole(name), -1)
    if value in meanings:
        return meanings[value]
    if value >= 0:
        used = default or "the default"
        sampler.warn(
            wording.GLTF_CHOICE,
            name,
            choices=one_of([*meanings]),
            found=quoted(str(value)),
            used=quoted(used),
        )
    return default


def _placed(info: Element) -> Json:
    """Return the set of texture coordinates, and the transform of KHR_texture_transform."""
    source = info.source
    uv_set = lenient(source, lambda: info.whole("texCoord", 0), 0)
    extension = _extension(info, "KHR_texture_transform")
    if extension is None:
        return {"uv_set": uv_set}
    uv_set = lenient(source, lambda: extension.whole("texCoord", uv_set), uv_set)
    offset, scale = (_pair(extension, *pair) for pair in (("offset", 0.0), ("scale", 1.0)))
    angle = bounded(extension, "rotation", 0.0, -_LARGEST, _LARGEST)
    return {"uv_set": uv_set, "transform": transform_matrix(offset, angle, scale)}


def _pair(extension: Element, name: str, default: float) -> Floats:
    """Return two numbers of a texture transform."""
    found = lenient(extension.source, lambda: extension.numbers(name, 2), None)
    return np.full(2, default) if found is None else np.clip(found, -_LARGEST, _LARGEST)


def transform_matrix(offset: Floats, angle: float, scale: Floats) -> Floats:
    """Return KHR_texture_transform (2, 3) with v = 0 at the bottom, of offset and scale (2,)."""
    # The extension's T(offset) R(-angle) S(scale) is for v = 0 at the first row of the image, so it
    # stands between two flips of v: (u, v) -> (u, 1 - v).
    cos, sin = math.cos(angle), math.sin(angle)
    (a, b), (c, d) = np.array([[cos, sin], [-sin, cos]]) * scale
    u, v = offset
    # Adding 0 replaces -0 by 0.
    return np.array([[a, -b, b + u], [-c, d, 1.0 - d - v]]) + 0.0


def _extension(element: Element, name: str) -> Element | None:
    return lenient(element.source, lambda: element.extension(name), None)


@dataclass(frozen=True, slots=True, eq=False)
class DecodedImage:
    """An image of a document."""

    name: str
    """Path relative to the document's folder; for embedded images the name of the image."""
    pixels: Bytes | None = None
    """(H, W, 4), first row at the top; None if the image cannot be read."""
    encoded: bytes | None = None
    """The file, if it is embedded and a PNG or a JPEG."""


@contextlib.contextmanager
def decoding_images(
    document: Document, indices: Iterable[int]
) -> Iterator[Callable[[], dict[int, DecodedImage]]]:
    """Decode images while the body of the ``with`` statement runs; unreadable ones are reported."""
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
        document.source.warn(wording.GLTF_IMAGE, f"/images/{index}", problem=problem)
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
        document.source.warn(wording.GLTF_IMAGE, f"/images/{index}", problem=said)
        return None
    unsupported = next(
        (name for magic, name in _UNSUPPORTED.items() if image.data.startswith(magic)), None
    )
    if unsupported is not None:
        document.source.warn(wording.GLTF_FORMAT, f"/images/{index}", found=unsupported)
        return None
    return image


def _named(document: Document, problem: FormatError) -> str:
    """Return an error with the name of its file, relative to the document's folder."""
    found = problem.diagnostic
    folder = document.source.path.parent
    path = found.path or Path()
    name = path.relative_to(folder) if path.is_relative_to(folder) else path
    return f"{name.as_posix()}: {found.message}"


def lenient(source: Source, read: Callable[[], _Content], default: _Content) -> _Content:
    """Return the result of a function; after an error, warn and return a default."""
    try:
        return read()
    except FormatError as problem:
        found = problem.diagnostic
        source.warn("F006.gltf-material: {problem}; ignored", found.pointer, problem=found.message)
        return default


def bounded(
    element: Element, name: str, default: float, low: float = 0.0, high: float = 1.0
) -> float:
    """Return a member that is a number; values outside the limits are clamped with a warning."""
    value = lenient(element.source, lambda: element.number(name, default), default)
    return _clamped(element, name, (value,), low, high)[0]


def bounded_rows(
    element: Element, name: str, default: tuple[float, ...], high: float = 1.0
) -> tuple[float, ...]:
    """Return a member that is a list of numbers; outliers are clamped with a warning."""
    count = len(default)
    found = lenient(element.source, lambda: element.numbers(name, count), None)
    values = default if found is None else tuple(found.tolist())
    return _clamped(element, name, values, 0.0, high)


def chosen(element: Element, name: str, choices: tuple[str, ...], default: str) -> str:
    """Return a member that is one of several strings; warn about others and use the default."""
    word = lenient(element.source, lambda: element.text(name, default), default)
    if word in choices:
        return word
    element.warn(
        wording.GLTF_CHOICE, name, choices=one_of(choices), found=quoted(word), used=quoted(default)
    )
    return default


def _clamped(
    element: Element, name: str, values: tuple[float, ...], low: float, high: float
) -> tuple[float, ...]:
    """Return values clamped to limits, with a warning if any was outside."""
    within = tuple(np.clip(values, low, high).tolist())
    if within != values:
        odd = next(place for place, value in enumerate(values) if value != within[place])
        limits = f"at least {low:g}" if high == np.inf else f"{low:g} to {high:g}"
        found, used = f"{values[odd]:g}", f"{within[odd]:g}"
        element.warn(
            "F006.gltf-range: expected {limits}, found {found}; {used} used",
            name,
            limits=limits,
            found=found,
            used=used,
        )
    return within
