"""Image loading: textures referenced by other files, and image files themselves."""

from __future__ import annotations

from viewer.diagnostics import wording
from viewer.errors import FormatError
from viewer.formats._file_bytes import read_bytes
from viewer.formats._references import referenced_path, refused_text
from viewer.formats._source import Source
from viewer.media.image import decode_picture
from viewer.rig.arrays import Bytes


def load_image(source: Source, name: str, offset: int | str | None) -> Bytes | None:
    """Return a texture's pixels as ``read_picture``, or None with a warning about its path."""
    path = referenced_path(source.path.parent, name)
    if path is None:
        source.warn(
            "F005.texture-refused: texture {name} {reason}",
            offset,
            name=name,
            reason=refused_text(name),
        )
        return None
    source.also_read.append(path)
    try:
        return decode_picture(path, read_bytes(path))
    except FormatError as problem:
        source.warn(wording.TEXTURE, offset, problem=problem.diagnostic)
        return None


def read_picture(source: Source) -> Bytes:
    """Return the pixels of an image file: (H, W, 4) uint8, sRGB with alpha, top row first."""
    return decode_picture(source.path, source.data)
