"""Thumbnails of images and videos, as pixels or as URIs for pages.

Pillow is imported on first use.
"""

from __future__ import annotations

import base64
import io
from pathlib import Path

import numpy as np

from viewer.errors import FormatError, ViewerError
from viewer.media.image import decode_picture, is_picture
from viewer.media.video_kinds import VIDEOS
from viewer.media.video_reading import VideoFrames
from viewer.rigs.arrays import Bytes

_QUALITY = 82  # JPEG quality
_MOST_BYTES = 256 << 20  # maximum size of a file


def thumbnail(path: str | Path, size: tuple[int, int]) -> Bytes | None:
    """Return an image, or a video's middle frame, reduced to fit a box; None if unreadable."""
    # Pixels are (H, W, 4) uint8, first row at the top. Small images are not enlarged.
    pixels = _pixels(Path(path))
    if pixels is None:
        return None
    from PIL import Image

    picture = Image.fromarray(pixels)
    # Premultiplied, so that transparent pixels have no influence on the colours next to them.
    premultiplied = picture.convert("RGBa")
    premultiplied.thumbnail(size, Image.Resampling.LANCZOS, reducing_gap=3.0)
    return np.array(premultiplied.convert("RGBA"))


def _pixels(path: Path) -> Bytes | None:
    try:
        if path.suffix.lower() in VIDEOS:
            frames = VideoFrames(path)
            middle = frames.n_frames // 2 / frames.rate
            return frames.at(middle) if frames.n_frames else frames.at(0.0)
        if not path.is_file() or path.stat().st_size > _MOST_BYTES:
            return None
        data = path.read_bytes()
        return decode_picture(path, data) if is_picture(data[:16]) else None
    except (OSError, FormatError, ViewerError):
        return None


def data_uri(pixels: Bytes) -> str:
    """Return (H, W, 4) uint8 pixels as a data URI: JPEG, or PNG if transparent."""
    from PIL import Image

    stream = io.BytesIO()
    if (pixels[..., 3] == 255).all():
        kind = "jpeg"
        Image.fromarray(pixels).convert("RGB").save(stream, "JPEG", quality=_QUALITY)
    else:
        kind = "png"
        Image.fromarray(pixels).save(stream, "PNG")
    return f"data:image/{kind};base64,{base64.b64encode(stream.getvalue()).decode('ascii')}"
