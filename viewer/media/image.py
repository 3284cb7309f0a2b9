"""Image reading and writing; Pillow is imported only when it is needed."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from viewer.diagnostics import Diagnostic
from viewer.errors import FormatError, OutputError
from viewer.media.png import encode_png
from viewer.media.saving import save_bytes
from viewer.phrases import printable
from viewer.rig.arrays import Bytes

if TYPE_CHECKING:
    from PIL import Image

__all__ = ["decode_picture", "encode_png", "is_picture", "picture_dimensions", "save_image"]

_MAX_PIXELS = 16384 * 16384
_REFUSALS = (OSError, ValueError, SyntaxError, MemoryError, Warning)  # raised by Pillow
_FORMATS = ("PNG", "JPEG", "BMP", "TGA", "TIFF", "GIF", "WEBP", "PPM")


def is_picture(head: bytes) -> bool:
    """Return whether a file that begins with these bytes is an image in a supported format."""
    return head.startswith((b"\x89PNG", b"\xff\xd8\xff", b"BM", b"GIF8", b"II*\0", b"MM\0*")) or (
        head[:4] == b"RIFF" and head[8:12] == b"WEBP"
    )


def decode_picture(path: Path, data: bytes) -> Bytes:
    """Return the pixels of an image: (H, W, 4) uint8, first row at the top.

    Parameters
    ----------
    path : Path
        File name for errors.
    data : bytes
        The file.

    Raises
    ------
    FormatError
        If it is not a readable image.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with _open(data) as picture:
                if picture.width * picture.height > _MAX_PIXELS:
                    raise ValueError(f"{picture.width} x {picture.height} pixels are too many")
                pixels = np.array(picture.convert("RGBA"))
                pixels.flags.writeable = False  # materials may share the array
                return pixels
    except UnidentifiedImageError:
        raise FormatError(Diagnostic("F002.picture", path)) from None
    except (*_REFUSALS, Image.DecompressionBombError) as problem:
        values = {"reason": str(problem)}
        raise FormatError(Diagnostic("F001.picture", path, values=values)) from None


def picture_dimensions(path: Path) -> tuple[int, int] | None:
    """Return the width and height of an image, without decoding it; None if it is unreadable."""
    from PIL import Image

    try:
        with Image.open(path, formats=_FORMATS) as picture:
            return picture.size
    except (*_REFUSALS, Image.DecompressionBombError):
        return None


def _open(data: bytes) -> Image.Image:
    """Open an image; for a PNG, Pillow's other plugins are not loaded, which takes 15 ms."""
    from PIL import Image, PngImagePlugin

    if data.startswith(b"\x89PNG"):
        return PngImagePlugin.PngImageFile(io.BytesIO(data))
    return Image.open(io.BytesIO(data), formats=_FORMATS)


def save_image(path: Path, pixels: Bytes) -> int:
    """Write an image in the format of its suffix, PNG if there is no suffix.

    Parameters
    ----------
    path : Path
        Replaced in one step.
    pixels : (H, W, 4) uint8
        First row at the top.

    Returns
    -------
    int
        Number of bytes.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    data = _encoded(path, pixels)
    save_bytes(path, data)
    return len(data)


def _encoded(path: Path, pixels: Bytes) -> bytes:
    suffix = path.suffix.lower()
    if suffix in ("", ".png"):
        return encode_png(pixels)
    from PIL import Image

    kind = Image.registered_extensions().get(suffix, "PNG")
    if kind == "PNG":
        return encode_png(pixels)
    stream = io.BytesIO()
    picture = Image.fromarray(pixels)
    if kind in ("JPEG", "PPM") or (pixels[..., 3] == 255).all():
        picture = picture.convert("RGB")
    try:
        picture.save(stream, kind)
    except (KeyError, ValueError, OSError):  # raised by Pillow
        name = printable(path, 300)
        raise OutputError(f"{name}: images cannot be written in this format") from None
    return stream.getvalue()
