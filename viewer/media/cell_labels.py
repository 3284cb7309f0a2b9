"""Labels in the cells of contact sheets; Pillow is imported on first use."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Bytes

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
