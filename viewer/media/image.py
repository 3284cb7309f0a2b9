"""Image reading and writing; Pillow is imported only when it is needed."""

from __future__ import annotations

import contextlib
import io
import os
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from viewer.diagnostics import wording
from viewer.errors import FormatError, OutputError
from viewer.media.png import encode_png
from viewer.phrases import printable
from viewer.rigs.arrays import Bytes

if TYPE_CHECKING:
    from PIL import Image

PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".gif", ".ppm", ".tga", ".tif", ".tiff", ".webp")
"""Suffixes of writable image formats."""

_MAX_PIXELS = 16384 * 16384  # limit for one image, and for all images that are decoded together
# Small files may hold huge images of one colour: images that are decoded together may have this
# number of pixels, 256 MB, and more only if their files are large. Photographs have about one pixel
# per byte, drawings up to ten.
_FREE_PIXELS = 8192 * 8192
_PIXELS_PER_BYTE = 16
_MOST_THREADS = 8
_FEW_BYTES = 1 << 18  # size of images that are decoded in about the time that threads take to start
_REFUSALS = (OSError, ValueError, SyntaxError, MemoryError, Warning)  # raised by Pillow
_FORMATS = ("PNG", "JPEG", "BMP", "TGA", "TIFF", "GIF", "WEBP", "PPM")


def is_picture(head: bytes) -> bool:
    """Return whether a file that begins with these bytes is an image in a supported format."""
    return head.startswith((b"\x89PNG", b"\xff\xd8\xff", b"BM", b"GIF8", b"II*\0", b"MM\0*")) or (
        head[:4] == b"RIFF" and head[8:12] == b"WEBP"
    )


def decode_picture(path: Path, data: bytes) -> Bytes:
    """Return the pixels of an image: (H, W, 4) uint8, first row at the top."""
    from viewer.media.array_cache import slot_of

    slot = slot_of("pixels-1", data, 0, len(data))
    kept = None if slot is None else slot.load("|u1", 3)
    if kept is not None:
        kept.flags.writeable = False  # the array may be shared
        return kept
    found = decode_pictures([(path, data)])[0]
    if isinstance(found, FormatError):
        raise found
    if slot is not None:
        slot.store(found)
    return found


def decode_pictures(files: Sequence[tuple[Path, bytes]]) -> list[Bytes | FormatError]:
    """Return the pixels of several images, decoded in parallel; see ``decoding_pictures``."""
    with decoding_pictures(files) as finish:
        return finish()


@contextlib.contextmanager
def decoding_pictures(
    files: Sequence[tuple[Path, bytes]],
) -> Iterator[Callable[[], list[Bytes | FormatError]]]:
    """Decode images, given as names and bytes, in other threads while the ``with`` block runs.

    Yields a function that waits and returns the pixels of each image, (H, W, 4) uint8, first row at
    the top, read-only; or the error of an image that is not readable, or exceeds the number of
    pixels allowed for all images together.
    """
    from PIL import Image

    # The filters of warnings are common to all threads, so they are set once.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.simplefilter("error", Image.DecompressionBombWarning)
        opened = _all_opened(files)
        n_cores = os.cpu_count() or 1
        if n_cores < 2 or sum(len(data) for _, data in files) < _FEW_BYTES:
            pixels = [_decoded(one) for one in opened]
            yield lambda: pixels
            return
        # Importing it takes 10 ms.
        from concurrent.futures import ThreadPoolExecutor

        pool = ThreadPoolExecutor(min(len(opened), n_cores, _MOST_THREADS))
        try:
            futures = [pool.submit(_decoded, one) for one in opened]
            yield lambda: [future.result() for future in futures]
        finally:
            pool.shutdown(cancel_futures=True)


def _all_opened(
    files: Sequence[tuple[Path, bytes]],
) -> list[tuple[Path, Image.Image] | FormatError]:
    """Return images whose pixels are not decoded yet, or their errors."""
    n_left = min(_MAX_PIXELS, _FREE_PIXELS + _PIXELS_PER_BYTE * sum(len(data) for _, data in files))
    opened: list[tuple[Path, Image.Image] | FormatError] = []
    for path, data in files:
        try:
            picture = _opened(path, data, n_left)
        except FormatError as problem:
            opened.append(problem)
            continue
        n_left -= picture.width * picture.height
        opened.append((path, picture))
    return opened


def _opened(path: Path, data: bytes, n_left: int) -> Image.Image:
    """Return an image whose pixels are not decoded yet; raises as ``decode_picture`` does."""
    from PIL import Image, UnidentifiedImageError

    try:
        picture = _open(data)
    except UnidentifiedImageError:
        raise FormatError.fault("F002.picture: unsupported or damaged image", path) from None
    except (*_REFUSALS, Image.DecompressionBombError) as problem:
        raise _unreadable(path, str(problem)) from None
    if picture.width * picture.height > n_left:
        picture.close()
        size = f"{picture.width} x {picture.height} pixels"
        raise _unreadable(path, f"{size} are too many for {len(data)} bytes")
    return picture


def _decoded(opened: tuple[Path, Image.Image] | FormatError) -> Bytes | FormatError:
    """Return the pixels of an opened image, or its error."""
    from PIL import Image

    if isinstance(opened, FormatError):
        return opened
    path, picture = opened
    try:
        with picture:
            if picture.mode.startswith("I;16"):
                # Pillow clips these to 255 instead of scaling them.
                grey = np.asarray(picture).astype(np.float32) / np.float32(257.0)
                picture = Image.fromarray(np.rint(grey).astype(np.uint8))
            # Without a copy that is no longer used, half as much memory is needed.
            converted = picture if picture.mode == "RGBA" else picture.convert("RGBA")
            if converted is not picture:
                picture.close()
            converted.load()
            pixels = np.frombuffer(converted.tobytes(), np.uint8)
            pixels = pixels.reshape(converted.height, converted.width, 4)
    except (*_REFUSALS, Image.DecompressionBombError) as problem:
        return _unreadable(path, str(problem))
    pixels.flags.writeable = False  # materials may share the array
    return pixels


def _unreadable(path: Path, reason: str) -> FormatError:
    return FormatError.fault(wording.PICTURE, path, reason=reason)


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


def media_type(data: bytes) -> str:
    """Return the media type of the bytes of a PNG or JPEG file."""
    return "image/png" if data.startswith(b"\x89PNG") else "image/jpeg"


def save_image(path: Path, pixels: Bytes) -> int:
    """Write (H, W, 4) uint8 pixels in the suffix's format, by default PNG; return the size."""
    from viewer.media.saving import save_bytes

    data = encoded_image(path, pixels)
    save_bytes(path, data)
    return len(data)


def encoded_image(path: Path, pixels: Bytes) -> bytes:
    """Return the file of (H, W, 4) uint8 pixels in the suffix's format; see ``save_image``."""
    suffix = path.suffix.lower()
    if suffix in ("", ".png"):
        return encode_png(pixels)
    from PIL import Image

    kind = Image.registered_extensions().get(suffix, "PNG")
    if kind == "PNG":
        return encode_png(pixels)
    stream = io.BytesIO()
    is_rgb = kind in ("JPEG", "PPM") or int(pixels[..., 3].min()) == 255
    mode, raw = ("RGB", "RGBX") if is_rgb else ("RGBA", "RGBA")
    # Rendered images have their last row first in memory: Pillow reads them from there.
    order = -1 if pixels.strides[0] < 0 else 1
    rows = np.ascontiguousarray(pixels[::order])
    picture = Image.frombytes(mode, (rows.shape[1], rows.shape[0]), rows, "raw", raw, 0, order)
    try:
        picture.save(stream, kind)
    except (KeyError, ValueError, OSError):  # raised by Pillow
        name = printable(path, 300)
        raise OutputError(f"{name}: images cannot be written in this format") from None
    return stream.getvalue()
