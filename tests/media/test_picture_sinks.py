"""Numbered pictures and contact sheets; digits without a font."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from viewer.errors import OutputError, ViewerError
from viewer.media.digits import digits, write_number
from viewer.media.picture_sinks import PictureSink, SheetSink, sheet_layout


def plain(color, size=(40, 30)):
    return np.full((size[1], size[0], 4), color, dtype=np.uint8)


def test_digits_are_distinct_and_look_like_digits():
    glyphs = [digits(number) for number in range(10)]
    assert all(glyph.shape == (7, 5) for glyph in glyphs)
    assert len({glyph.tobytes() for glyph in glyphs}) == 10
    shown = [["".join(" #"[int(dot)] for dot in row) for row in glyph] for glyph in glyphs]
    one, seven, eight = shown[1], shown[7], shown[8]
    assert one[0] == "  #  " and one[-1] == " ### "
    assert seven[0] == "#####" and seven[-1].count("#") == 1
    assert eight == eight[::-1]


def test_frame_number_is_drawn_digit_by_digit():
    number = digits(407)
    assert number.shape == (7, 17)
    for place, digit in enumerate((4, 0, 7)):
        assert (number[:, 6 * place : 6 * place + 5] == digits(digit)).all()
    assert not number[:, [5, 11]].any()


def test_frame_number_is_white_in_the_lower_left_corner():
    pixels = plain((100, 100, 100, 255), (60, 40))
    write_number(pixels, 1)
    # One pixel per dot and a margin of two: 9 x 11 pixels, 45 % of the gray shows through.
    assert pixels[-11, 0].tolist() == [45, 45, 45, 255]
    assert pixels[-12, 0].tolist() == [100, 100, 100, 255] == pixels[-1, 9].tolist()
    ink = (pixels[-9:-2, 2:7, 0] == 255).tolist()
    assert ink == digits(1).tolist()


def test_frame_number_is_visible_on_transparent_images():
    pixels = plain((0, 0, 0, 0), (60, 40))
    write_number(pixels, 1)
    assert pixels[-1, 0].tolist() == [0, 0, 0, 140]  # 55 % of 255
    assert pixels[-9, 4].tolist() == [255, 255, 255, 255]


def test_frame_number_that_does_not_fit_is_left_out():
    pixels = plain((9, 9, 9, 255), (12, 10))
    write_number(pixels, 123456)
    assert (pixels == plain((9, 9, 9, 255), (12, 10))).all()


def test_images_are_written_one_by_one(tmp_path):
    paths = [tmp_path / f"{n}.png" for n in (3, 5)]
    sink = PictureSink(paths)
    sink.write(1, plain((1, 2, 3, 4)))
    assert not paths[0].exists() and np.array(Image.open(paths[1]))[0, 0].tolist() == [1, 2, 3, 4]
    sink.write(0, plain((9, 8, 7, 255)))
    sink.close()
    assert np.array(Image.open(paths[0]).convert("RGB"))[0, 0].tolist() == [9, 8, 7]
    assert sink.n_bytes == sum(path.stat().st_size for path in paths)


def test_finished_images_are_kept_when_the_rest_is_aborted(tmp_path):
    sink = PictureSink([tmp_path / "0.png", tmp_path / "1.png"])
    sink.write(0, plain((1, 2, 3, 255)))
    sink.abort()
    assert [path.name for path in tmp_path.iterdir()] == ["0.png"]


@pytest.mark.parametrize(
    ("name", "words"), [("missing/0.png", "does not exist"), ("0.psd", "cannot be written as this")]
)
def test_unwritable_image_is_one_line(tmp_path, name, words):
    with pytest.raises(OutputError, match=words):
        PictureSink([tmp_path / name]).write(0, plain((1, 2, 3, 255)))


@pytest.mark.parametrize(
    ("size", "count", "wanted"),
    [
        ((1280, 720), 12, (4, 3)),
        ((800, 600), 4, (2, 2)),
        ((640, 480), 1, (1, 1)),
        ((1200, 100), 9, (9, 1)),
        ((100, 1200), 5, (1, 5)),
    ],
)
def test_sheet_layout_fills_the_image(size, count, wanted):
    assert sheet_layout(size, count) == wanted


def test_sheet_shows_every_frame_in_its_cell(tmp_path):
    path = tmp_path / "sheet.png"
    sink = SheetSink(path, (121, 92), [0, 7, 14])
    assert (sink.columns, sink.rows, sink.cell, sink.size) == (2, 2, (60, 46), (120, 92))
    colors = [(200, 0, 0, 255), (0, 200, 0, 255), (0, 0, 200, 255)]
    for frame, color in enumerate(colors):
        sink.write(frame, plain(color, sink.cell))
    assert not path.exists()
    sink.close()
    sheet = np.array(Image.open(path).convert("RGBA"))
    assert sheet.shape == (92, 120, 4) and sink.n_bytes == path.stat().st_size
    cells = sheet[:46, :60], sheet[:46, 60:], sheet[46:, :60]
    for frame, (cell, color) in enumerate(zip(cells, colors, strict=True)):
        expected = plain(color, sink.cell)
        write_number(expected, (0, 7, 14)[frame])
        assert (cell == expected).all()
    assert (sheet[46:, 60:] == colors[0]).all()  # empty: the first frame's background


def test_aborted_sheet_leaves_no_file(tmp_path):
    sink = SheetSink(tmp_path / "sheet.png", (120, 92), [0])
    sink.write(0, plain((1, 2, 3, 255), sink.cell))
    sink.abort()
    assert list(tmp_path.iterdir()) == []


def test_cells_that_are_too_small_are_refused(tmp_path):
    with pytest.raises(ViewerError) as caught:
        SheetSink(tmp_path / "sheet.png", (64, 48), range(100))
    assert str(caught.value) == (
        "contact sheet: 100 frames in 64 x 48 pixels are 6 x 4 each, which is too small to see "
        "anything"
    )
