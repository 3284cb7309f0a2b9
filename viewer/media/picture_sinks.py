"""Sinks that write frames as images: one file per frame, or one contact sheet of all."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from viewer.errors import ViewerError
from viewer.media.image import save_image
from viewer.rigs.arrays import Bytes

_MOST_WORKERS = 4  # maximum number of images compressed at the same time
_SMALLEST_CELL = 16  # minimum side of a cell, pixels
_CELL_ASPECT = 4.0 / 3.0
_GUTTER = 0.006  # gutter between cells, relative to the image's shorter side
_WHITE = (255, 255, 255, 255)


class PictureSink:
    """Writes an image for every frame, each atomically; they are kept if the run is aborted."""

    n_samples = 0
    notes = ()

    def __init__(self, paths: Sequence[Path]) -> None:
        self.paths, self._written = paths, list[int]()
        self.workers = min(max((os.cpu_count() or 2) - 1, 1), _MOST_WORKERS)

    @property
    def n_bytes(self) -> int:
        """Total size of the files written so far."""
        return sum(path.stat().st_size for path in self.paths if path.is_file())

    @property
    def n_kept(self) -> int:
        """Number of images written so far."""
        return len(self._written)

    def look(self, pixels: Bytes) -> None:
        """Do nothing: images are independent of each other."""

    def write(self, frame: int, pixels: Bytes) -> None:
        """Write one image; see ``viewer.rendering.recorder.Sink``."""
        save_image(self.paths[frame], pixels)
        self._written.append(frame)

    def close(self) -> None:
        """Do nothing: every image is complete."""

    def abort(self) -> None:
        """Do nothing: no image is ever incomplete."""


class SheetSink:
    """Writes one image of all frames, row by row, with gutters and a number in each cell."""

    # Gutters and unused cells are white, or transparent if the frames are transparent.

    n_samples = n_kept = 0
    notes = ()

    def __init__(
        self,
        path: Path,
        size: tuple[int, int],
        numbers: Sequence[int],
        aspect: float = _CELL_ASPECT,
    ) -> None:
        self.path, self.numbers, self.workers, self.n_bytes = path, numbers, 1, 0
        self.columns, self.rows = columns, rows = sheet_layout(size, len(numbers), aspect)
        self.gutter = gap = max(round(_GUTTER * min(size)), 1)
        self.cell = (size[0] + gap) // columns - gap, (size[1] + gap) // rows - gap
        self.size = columns * (self.cell[0] + gap) - gap, rows * (self.cell[1] + gap) - gap
        if min(self.cell) < _SMALLEST_CELL:
            raise ViewerError(
                f"contact sheet: {len(numbers)} frames in {size[0]} x {size[1]} pixels are "
                f"{self.cell[0]} x {self.cell[1]} each, which is too small"
            )
        self._sheet: Bytes | None = None

    def look(self, pixels: Bytes) -> None:
        """Do nothing: cells are independent of each other."""

    def write(self, frame: int, pixels: Bytes) -> None:
        """Put a frame into its cell; see ``viewer.rendering.recorder.Sink``."""
        if self._sheet is None:
            self._sheet = np.empty((self.size[1], self.size[0], 4), dtype=np.uint8)
            self._sheet[:] = _WHITE if pixels[0, 0, 3] == 255 else 0
        row, column = divmod(frame, self.columns)
        width, height = self.cell
        top, left = row * (height + self.gutter), column * (width + self.gutter)
        cell = self._sheet[top : top + height, left : left + width]
        cell[:] = pixels
        write_label(cell, str(self.numbers[frame]))

    def close(self) -> None:
        """Write the image."""
        assert self._sheet is not None  # there is at least one frame
        self.n_bytes = save_image(self.path, self._sheet)

    def abort(self) -> None:
        """Discard the frames; nothing is written before ``close``."""
        self._sheet = None


def sheet_layout(
    size: tuple[int, int], count: int, wanted: float = _CELL_ASPECT
) -> tuple[int, int]:
    """Return the best number of columns and rows for a number of frames.

    Layouts with cells of an aspect ratio near ``wanted`` and few empty cells are preferred.

    >>> sheet_layout((1280, 720), 12), sheet_layout((1280, 720), 12, 0.5)
    ((4, 3), (6, 2))
    """

    def badness(columns: int) -> float:
        rows = math.ceil(count / columns)
        aspect = (size[0] / columns) / (size[1] / rows)
        return abs(math.log(aspect / wanted)) + (columns * rows - count) / count

    columns = min(range(1, count + 1), key=badness)
    return columns, math.ceil(count / columns)


_SMALLEST = 9  # minimum legible height of letters, pixels
_LETTERS = 1 / 10  # height of letters, relative to the cell's shorter side
_INK, _PAPER = 255.0, 16.0  # grey levels of the letters and of the tag behind them
_PAPER_OPACITY = 0.62


def write_label(pixels: Bytes, text: str) -> None:
    """Write text, if it fits, on a dark tag in the lower left corner of (H, W, 4) uint8 pixels."""
    from PIL import Image, ImageDraw, ImageFont

    height, width = pixels.shape[:2]
    letters = max(round(_LETTERS * min(height, width)), _SMALLEST)
    font = ImageFont.load_default(letters)
    margin = max(letters // 3, 2)
    across, down = int(np.ceil(font.getlength(text))) + 2 * margin, letters + 2 * margin
    if across > width or down > height:
        return
    tag = Image.new("L", (across, down))
    ImageDraw.Draw(tag).text((margin, down / 2), text, 255, font, anchor="lm")
    ink = np.array(tag)[..., None] / 255.0
    corner = pixels[height - down :, :across]
    # Premultiplied, so that the tag is also correct over a transparent image.
    under = corner.astype(np.float64)
    under[..., :3] *= under[..., 3:] / 255.0
    for color, opacity in ((_PAPER, _PAPER_OPACITY), (_INK, ink)):
        under = (1.0 - opacity) * under + opacity * np.array([color, color, color, 255.0])
    alpha = under[..., 3:]
    corner[..., :3] = np.rint(under[..., :3] * 255.0 / alpha)
    corner[..., 3:] = np.rint(alpha)
