"""Contact sheets with captions, cells for missing pictures, and the thumbnails in them.

Pillow is imported on first use.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import FormatError, ViewerError
from viewer.media.image import decode_picture, is_picture
from viewer.media.picture_sinks import sheet_layout
from viewer.media.video_kinds import VIDEOS
from viewer.media.video_reading import VideoFrames
from viewer.rigs.arrays import Bytes

if TYPE_CHECKING:
    from PIL import ImageDraw, ImageFont

    Font = ImageFont.ImageFont | ImageFont.FreeTypeFont

_WIDTH = 240  # width of a cell, pixels
_HEIGHTS = 120, 320  # minimum and maximum height of a cell's picture
_CAPTION = 24  # height of a caption, pixels
_GAP = 16  # margin between cells and around the sheet, pixels
_LETTERS = 13  # height of letters, pixels
_LINE = 18  # height of a line in a cell without a picture, pixels
_PAPER, _INK = (255, 255, 255, 255), (40, 44, 52, 255)
_EMPTY, _EDGE = (243, 244, 246, 255), (222, 225, 230, 255)
_FAILED, _FAILED_EDGE, _FAILED_INK = (253, 236, 234, 255), (214, 69, 58, 255), (150, 28, 20, 255)
_ELLIPSIS = "…"


@dataclass(frozen=True, slots=True, eq=False)
class CaptionedCell:
    """A cell of a sheet."""

    caption: str
    """Name, below the picture; shortened in the middle if it is too long."""
    pixels: Bytes | None = None
    """(H, W, 4) uint8 or None. Picture; None for a cell with text."""
    text: str = ""
    """Text in a cell without a picture; its first line is a title."""
    is_failed: bool = False
    """Whether the cell is marked in red."""


def captioned_sheet(cells: Sequence[CaptionedCell]) -> Bytes:
    """Return an opaque grid of at least one cell, about 4:3: (H, W, 4) uint8, first row on top."""
    # Pictures are centred; they must be at most 240 pixels wide.
    from PIL import Image, ImageDraw, ImageFont

    tallest = max((cell.pixels.shape[0] for cell in cells if cell.pixels is not None), default=0)
    height = min(max(tallest, _HEIGHTS[0]), _HEIGHTS[1])
    across, down = _WIDTH + _GAP, height + _CAPTION + _GAP
    columns, rows = sheet_layout((4, 3), len(cells), across / down)
    sheet = Image.new("RGBA", (columns * across + _GAP, rows * down + _GAP), _PAPER)
    draw = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(_LETTERS)
    for index, cell in enumerate(cells):
        row, column = divmod(index, columns)
        left, top = _GAP + column * across, _GAP + row * down
        box = (left, top, left + _WIDTH - 1, top + height - 1)
        if cell.pixels is None:
            _draw_text(draw, cell, box, font)
        else:
            draw.rectangle(box, _EMPTY)
            picture = Image.fromarray(cell.pixels[:height, :_WIDTH])
            offset = (_WIDTH - picture.width) // 2, (height - picture.height) // 2
            sheet.alpha_composite(picture, (left + offset[0], top + offset[1]))
        color = _FAILED_INK if cell.is_failed else _INK
        text = elided(cell.caption, _WIDTH, font.getlength)
        draw.text((left, top + height + _CAPTION / 2), text, color, font, anchor="lm")
    return np.array(sheet)


def _draw_text(
    draw: ImageDraw.ImageDraw, cell: CaptionedCell, box: tuple[int, int, int, int], font: Font
) -> None:
    """Draw a cell without a picture."""
    fill, edge = (_FAILED, _FAILED_EDGE) if cell.is_failed else (_EMPTY, _EDGE)
    draw.rectangle(box, fill, edge, 1)
    left, top, right, bottom = box
    n_lines = (bottom - top - _GAP) // _LINE
    title, _, rest = cell.text.partition("\n")
    lines = [title, *wrapped(rest, right - left - _GAP, n_lines - 1, font.getlength)]
    for number, line in enumerate(lines):
        color = _FAILED_INK if cell.is_failed and number == 0 else _INK
        where = left + _GAP / 2, top + _GAP / 2 + number * _LINE
        draw.text(where, line, color, font)


def elided(text: str, width: float, length_of: Callable[[str], float]) -> str:
    """Return text that fits, with its middle elided if it is too long.

    >>> elided("walks/subject_07.npz", 12, len)
    'walks/…7.npz'
    """
    if length_of(text) <= width:
        return text
    for count in range(len(text) - 1, 0, -1):
        tail = count // 2
        short = f"{text[: count - tail]}{_ELLIPSIS}{text[len(text) - tail :]}"
        if length_of(short) <= width:
            return short
    return _ELLIPSIS


def wrapped(text: str, width: float, n_lines: int, length_of: Callable[[str], float]) -> list[str]:
    """Return text as lines; long words are broken, and text that does not fit is omitted.

    >>> wrapped("expected 3 numbers, found 2", 10, 2, len)
    ['expected 3', 'numbers,…']
    """
    lines: list[str] = []
    left = text.split()
    while left:
        if len(lines) == n_lines:
            if lines:
                lines[-1] = elided_end(lines[-1], width, length_of)
            break
        line = left.pop(0)
        if length_of(line) > width:
            count = max(
                n for n in range(1, len(line) + 1) if n == 1 or length_of(line[:n]) <= width
            )
            left.insert(0, line[count:])
            line = line[:count]
        else:
            while left and length_of(f"{line} {left[0]}") <= width:
                line = f"{line} {left.pop(0)}"
        lines.append(line)
    return lines


def elided_end(text: str, width: float, length_of: Callable[[str], float]) -> str:
    """Return text with an ellipsis at its end, shortened until it fits.

    >>> elided_end("numbers", 7, len)
    'number…'
    """
    while text and length_of(text + _ELLIPSIS) > width:
        text = text[:-1]
    return text + _ELLIPSIS


# Thumbnails of images and videos, as pixels or as URIs for pages.

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
