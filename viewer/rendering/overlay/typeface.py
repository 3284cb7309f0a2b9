"""Text in pictures and panels: built-in fonts, system fonts for other scripts, rasterised text.

Panels show Arabic and Hebrew letter by letter from left to right, because ImGui has no text shaping
or bidirectional layout; pictures have both if Pillow has the Raqm library.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from viewer.rigs.arrays import Bytes, Ints

if TYPE_CHECKING:
    from PIL import ImageDraw, ImageFont

    _Font = ImageFont.ImageFont | ImageFont.FreeTypeFont

# Of each group, the first installed font is used.
_GROUPS = (
    (
        "NotoSansCJK-Regular.ttc",
        "NotoSansCJKjp-Regular.otf",
        "NotoSansCJKsc-Regular.otf",
        "SourceHanSans-Regular.ttc",
        "DroidSansFallbackFull.ttf",
        "DroidSansFallback.ttf",
        "wqy-microhei.ttc",
        "wqy-zenhei.ttc",
        "Hiragino Sans GB.ttc",
        "msyh.ttc",
        "YuGothR.ttc",
    ),
    ("NanumGothic.ttf", "AppleSDGothicNeo.ttc", "malgun.ttf"),
    (
        "NotoSansArabic-Regular.ttf",
        "NotoNaskhArabic-Regular.ttf",
        "GeezaPro.ttc",
        "segoeui.ttf",
    ),
    ("NotoSansHebrew-Regular.ttf",),
    ("NotoSansDevanagari-Regular.ttf", "Lohit-Devanagari.ttf", "Nirmala.ttf"),
    ("NotoSansThai-Regular.ttf", "Loma.ttf", "LeelawUI.ttf"),
    ("DejaVuSans.ttf", "Arial Unicode.ttf", "FreeSans.ttf"),
)
_NOWHERE = "\uffff"  # not a character, so every font draws its glyph for missing characters
_RIM_WIDTH = 2  # width of the outline, pixels
_WIDEST = 2048  # maximum width of a string, pixels; longer strings are truncated
_MOST_STRINGS = 4000  # maximum number of cached strings
_RIM_OPACITY = 205  # opacity of the outline, 0 to 255


class Typeface:
    """Text of one size for pictures, with each letter in the first font that contains it."""

    # Letters that no font contains are written as escape sequences.

    def __init__(self, letters: int) -> None:
        from PIL import ImageFont

        self.letters = letters
        self._fonts: list[_Font] = [ImageFont.load_default(letters)]
        self._missing = [_glyph(self._fonts[0], _NOWHERE)]
        self._found: dict[str, int] = {}
        self._others = _opened(letters)

    def length(self, text: str) -> float:
        """Return the width of a text, pixels."""
        return sum(font.getlength(part) for font, part in self._runs(text))

    def draw(
        self,
        draw: ImageDraw.ImageDraw,
        place: tuple[float, float],
        text: str,
        fill: object,
        rim: int = 0,
    ) -> None:
        """Draw a text, with an outline of a given width in pixels."""
        # The place is the left end of the text at the height of the ascender, pixels.
        (x, top), base = place, self._fonts[0]
        for font, part in self._runs(text):
            # All fonts share the baseline of the first.
            y = top if font is base else top + _ascent(base) - _ascent(font)
            draw.text((x, y), part, fill, font, stroke_width=rim)  # type: ignore[arg-type]
            x += font.getlength(part)

    def _runs(self, text: str) -> list[tuple[_Font, str]]:
        """Return the parts of a text with their fonts."""
        runs: list[tuple[int, str]] = []
        for letter in text:
            number = self._font_of(letter)
            shown = letter if number >= 0 else letter.encode("unicode_escape").decode()
            number = max(number, 0)
            if runs and runs[-1][0] == number:
                runs[-1] = number, runs[-1][1] + shown
            else:
                runs.append((number, shown))
        return [(self._fonts[number], part) for number, part in runs]

    def _font_of(self, letter: str) -> int:
        """Return the index of the first font with a letter, or -1; fonts are opened as needed."""
        if letter.isascii() or letter.isspace():
            return 0
        if letter not in self._found:
            self._found[letter] = next(self._fonts_with(letter), -1)
        return self._found[letter]

    def _fonts_with(self, letter: str) -> Iterator[int]:
        number = 0
        while number < len(self._fonts) or self._open_next():
            if _glyph(self._fonts[number], letter) != self._missing[number]:
                yield number
            number += 1

    def _open_next(self) -> bool:
        font = next(self._others, None)
        if font is None:
            return False
        self._fonts.append(font)
        self._missing.append(_glyph(font, _NOWHERE))
        return True


def _opened(letters: int) -> Iterator[_Font]:
    """Yield further fonts in a size; files that cannot be read are skipped."""
    from PIL import ImageFont

    own = interface_font()
    for path in (*([] if own is None else [own]), *system_fonts()):
        try:
            yield ImageFont.truetype(str(path), letters)
        except OSError:
            continue


def _glyph(font: _Font, letter: str) -> tuple[object, bytes]:
    """Return a key of a letter's picture, which is the same for all letters that a font lacks."""
    mask = font.getmask(letter)
    return mask.size, bytes(mask)


def _ascent(font: _Font) -> float:
    metrics = getattr(font, "getmetrics", None)
    return float(metrics()[0]) if metrics is not None else 0.0


def interface_font() -> Path | None:
    """Return the font of the panels, which contains Latin, Greek and Cyrillic letters."""
    # Pictures are also drawn without importing ImGui.
    spec = find_spec("imgui_bundle")
    for folder in (spec.submodule_search_locations or ()) if spec is not None else ():
        path = Path(folder, "assets", "fonts", "DroidSans.ttf")
        if path.is_file():
            return path
    return None


def system_fonts() -> tuple[Path, ...]:
    """Return the installed fonts for scripts that the built-in fonts lack, most common first."""
    return _installed(tuple(_folders()))


def _folders() -> Iterator[Path]:
    """Yield the folders in which systems and users install fonts."""
    if sys.platform == "win32":
        yield Path(os.environ.get("WINDIR", "C:/Windows"), "Fonts")
        return
    data = os.environ.get("XDG_DATA_HOME") or "~/.local/share"
    shared = os.environ.get("XDG_DATA_DIRS") or "/usr/local/share:/usr/share"
    for folder in (data, *shared.split(":")):
        yield Path(os.path.expanduser(folder), "fonts")  # noqa: PTH111  without a home, no error
    if sys.platform == "darwin":
        yield from map(Path, ("/Library/Fonts", "/System/Library/Fonts"))


@cache
def _installed(folders: tuple[Path, ...]) -> tuple[Path, ...]:
    wanted = {name for group in _GROUPS for name in group}
    found: dict[str, Path] = {}
    for top in folders:
        for folder, _, names in os.walk(top, followlinks=False):
            for name in wanted.intersection(names):
                path = Path(folder, name)
                if os.access(path, os.R_OK):
                    found.setdefault(name, path)
    firsts = (next((found[name] for name in group if name in found), None) for group in _GROUPS)
    return tuple(path for path in firsts if path is not None)


class Lettering:
    """Rasteriser of text in one font size, the height ``letters`` in pixels."""

    def __init__(self, letters: int) -> None:
        self.letters = letters
        self._font = Typeface(letters)
        self._widths: dict[str, int] = {}
        self._pixels: dict[str, Bytes] = {}

    def sizes(self, texts: Sequence[str]) -> Ints:
        """Return the width and height of texts with their outlines: (N, 2), pixels."""
        if len(self._widths) > _MOST_STRINGS:
            self._widths.clear()
        for text in texts:
            if text not in self._widths:
                self._widths[text] = int(np.ceil(self._font.length(text))) + 2 * _RIM_WIDTH
        widths = [min(self._widths[text], _WIDEST) for text in texts]
        heights = [self._height] * len(texts)
        return np.array([widths, heights], dtype=np.int32).reshape(2, -1).T

    @property
    def _height(self) -> int:
        return round(1.25 * self.letters) + 2 * _RIM_WIDTH

    def pixels(self, text: str) -> Bytes:
        """Return white text with a dark outline: (H, W, 2) uint8, premultiplied grey and alpha."""
        from PIL import Image, ImageDraw

        if text not in self._pixels:
            if len(self._pixels) > _MOST_STRINGS:
                self._pixels.clear()
            width, height = self.sizes([text])[0].tolist()
            rim, inside = Image.new("L", (width, height)), Image.new("L", (width, height))
            place = _RIM_WIDTH, _RIM_WIDTH
            self._font.draw(ImageDraw.Draw(rim), place, text, _RIM_OPACITY, _RIM_WIDTH)
            self._font.draw(ImageDraw.Draw(inside), place, text, 255)
            white = np.array(inside)
            self._pixels[text] = np.dstack([white, np.maximum(white, np.array(rim))])
        return self._pixels[text]


def shelves(sizes: Ints, width: int, tallest: int) -> Ints:
    """Return corners, (M, 2), of the rectangles, (N, 2), that fit into rows of an image."""
    # Rectangles, at most as wide as the image, have equal heights; all in pixels.
    corners: list[tuple[int, int]] = []
    x = y = 0
    for across, down in sizes.tolist():
        if x + across > width:
            x, y = 0, y + down
        if y + down > tallest:
            break
        corners.append((x, y))
        x += across
    return np.array(corners, dtype=np.int32).reshape(-1, 2)
