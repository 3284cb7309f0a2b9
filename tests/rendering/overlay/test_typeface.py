"""Fonts for text: letters of other scripts, and letters missing in all fonts."""

import shutil

import numpy as np
import pytest
from PIL import Image, ImageDraw, ImageFont

from viewer.rendering.overlay import typeface
from viewer.rendering.overlay.typeface import (
    Lettering,
    Typeface,
    interface_font,
    shelves,
    system_fonts,
)

CJK, EMPTY = "\u95a2\u7bc0", "\U000f1234"  # two ideographs, and a private-use code point


@pytest.fixture
def no_fonts(monkeypatch):
    """Simulate a system without fonts."""
    monkeypatch.setattr(typeface, "system_fonts", lambda: ())


def _drawn(text):
    image = Image.new("L", (300, 40))
    Typeface(20).draw(ImageDraw.Draw(image), (2, 2), text, 255)
    return np.array(image)


def test_ascii_is_drawn_in_the_built_in_font():
    image = Image.new("L", (300, 40))
    ImageDraw.Draw(image).text((2, 2), "left_knee 12", 255, ImageFont.load_default(20))
    assert (_drawn("left_knee 12") == np.array(image)).all()
    assert Typeface(20).length("ab") == ImageFont.load_default(20).getlength("ab")


def test_greek_and_cyrillic_are_drawn_in_the_font_of_the_panels(no_fonts):
    font = ImageFont.truetype(str(interface_font()), 20)
    for text in ("\u03b1\u03b2", "\u041f\u0440\u0438"):
        assert Typeface(20).length(text) == font.getlength(text)


def test_letters_without_a_font_are_escaped(no_fonts):
    plain = "a\\u95a2\\u7bc0\\U000f1234"
    assert Typeface(20).length("a" + CJK + EMPTY) == Typeface(20).length(plain)
    assert (_drawn("a" + CJK) == _drawn("a\\u95a2\\u7bc0")).all()


def test_installed_fonts_are_found_in_the_user_folder(tmp_path, monkeypatch):
    folder = tmp_path / "fonts" / "truetype"
    folder.mkdir(parents=True)
    for name in ("DroidSansFallbackFull.ttf", "wqy-microhei.ttc", "Loma.ttf", "Other.ttf"):
        shutil.copy(interface_font(), folder / name)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    monkeypatch.setenv("XDG_DATA_DIRS", str(tmp_path / "none"))
    monkeypatch.setattr("sys.platform", "linux")
    # The preferred font of each group is used.
    assert [path.name for path in system_fonts()] == ["DroidSansFallbackFull.ttf", "Loma.ttf"]


def test_unreadable_font_is_skipped(tmp_path, monkeypatch):
    (tmp_path / "broken.ttf").write_bytes(b"no font")
    paths = (tmp_path / "broken.ttf",)
    monkeypatch.setattr(typeface, "system_fonts", lambda: paths)
    assert Typeface(20).length(CJK) == Typeface(20).length("\\u95a2\\u7bc0")


def test_text_sizes_match_the_drawn_pixels():
    letters = Lettering(13)
    words = ["hip", "left_shoulder", "", "Ärmel"]
    for word, (width, height) in zip(words, letters.sizes(words).tolist(), strict=True):
        assert letters.pixels(word).shape == (height, width, 2)
    widths = letters.sizes(words)[:, 0]
    assert widths[2] == 4 and widths[0] < widths[1]  # empty text consists of outlines of two pixels


def test_letters_are_white_within_a_dark_rim():
    pixels = Lettering(20).pixels("H").astype(int)
    grey, opacity = pixels[..., 0], pixels[..., 1]
    assert (grey <= opacity).all() and grey.max() == 255 and opacity.max() == 255
    inside, rim = grey > 200, (grey == 0) & (opacity > 200)
    assert inside.any() and rim.any()
    # Every row with ink has an outline left and right of it.
    for row in np.flatnonzero(inside.any(axis=1)):
        columns = np.flatnonzero(inside[row])
        assert rim[row, : columns[0]].any() and rim[row, columns[-1] + 1 :].any()


def test_larger_font_size_draws_larger_text():
    small, large = (Lettering(size).sizes(["pelvis"])[0] for size in (10, 30))
    assert (large > 2 * small).all()


def test_shelves_continue_below_when_a_row_is_full():
    sizes = np.array([[40, 10], [50, 10], [20, 10], [100, 10], [1, 10]])
    assert shelves(sizes, 100, 60).tolist() == [[0, 0], [40, 0], [0, 10], [0, 20], [0, 30]]


def test_shelves_omit_texts_that_do_not_fit():
    sizes = np.array([[60, 10]] * 5)
    assert shelves(sizes, 100, 30).tolist() == [[0, 0], [0, 10], [0, 20]]
    assert shelves(sizes[:0], 100, 30).shape == (0, 2)
