"""Rendering of text to pixels: size, outline, and packing on shelves."""

import numpy as np

from viewer.rendering.overlay.typeface import Lettering, shelves


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
