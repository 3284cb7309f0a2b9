"""Numbered images and contact sheets."""

import numpy as np
import pytest
from PIL import Image

from viewer.errors import OutputError, ViewerError
from viewer.media.picture_sinks import PictureSink, SheetSink, sheet_layout, write_label


def plain(color, size=(40, 30)):
    return np.full((size[1], size[0], 4), color, dtype=np.uint8)


def test_label_is_white_on_a_dark_tag_in_the_lower_left_corner():
    pixels = plain((200, 200, 200, 255), (60, 40))
    write_label(pixels, "17")
    # The text is 9 pixels high with a margin of 3; the tag's grey of 16 covers the image with 62 %.
    assert pixels[-1, 0].tolist() == [86, 86, 86, 255] == pixels[-15, 0].tolist()
    assert pixels[-16, 0].tolist() == [200, 200, 200, 255]
    assert pixels[-12:-3, 3:16, 0].max() > 220
    assert (pixels[:, 30:] == 200).reshape(-1, 4)[:, :3].all()


def test_label_is_visible_on_transparent_images():
    pixels = plain((0, 0, 0, 0), (60, 40))
    write_label(pixels, "1")
    assert pixels[-1, 0].tolist() == [16, 16, 16, 158]  # 62 % of 255
    assert pixels[-12:-3, :, 3].max() > 220


def test_label_that_does_not_fit_is_left_out():
    pixels = plain((9, 9, 9, 255), (12, 10))
    write_label(pixels, "123456")
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


def test_finished_images_are_kept_if_recording_is_aborted(tmp_path):
    sink = PictureSink([tmp_path / "0.png", tmp_path / "1.png"])
    sink.write(0, plain((1, 2, 3, 255)))
    sink.abort()
    assert [path.name for path in tmp_path.iterdir()] == ["0.png"]


@pytest.mark.parametrize(
    ("name", "words"),
    [("missing/0.png", "does not exist"), ("0.psd", "cannot be written in this format")],
)
def test_unwritable_image_is_refused_in_one_line(tmp_path, name, words):
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
    sink = SheetSink(path, (122, 93), [0, 7, 14])
    # There is a gutter of one pixel between two cells of 60 x 46.
    assert (sink.columns, sink.rows, sink.cell, sink.size) == (2, 2, (60, 46), (121, 93))
    colors = [(200, 0, 0, 255), (0, 200, 0, 255), (0, 0, 200, 255)]
    for frame, color in enumerate(colors):
        sink.write(frame, plain(color, sink.cell))
    assert not path.exists()
    sink.close()
    sheet = np.array(Image.open(path).convert("RGBA"))
    assert sheet.shape == (93, 121, 4) and sink.n_bytes == path.stat().st_size
    cells = sheet[:46, :60], sheet[:46, 61:], sheet[47:, :60]
    for frame, (cell, color) in enumerate(zip(cells, colors, strict=True)):
        expected = plain(color, sink.cell)
        write_label(expected, str((0, 7, 14)[frame]))
        assert (cell == expected).all()
    assert (sheet[46] == 255).all() and (sheet[:, 60] == 255).all()
    assert (sheet[47:, 61:] == 255).all()  # this cell has no frame


def test_gutters_of_transparent_frames_are_transparent(tmp_path):
    sink = SheetSink(tmp_path / "sheet.png", (122, 93), [0, 1])
    for frame in range(2):
        sink.write(frame, plain((0, 0, 0, 0), sink.cell))
    sink.close()
    sheet = np.array(Image.open(tmp_path / "sheet.png").convert("RGBA"))
    assert not sheet[:, sink.cell[0] : sink.cell[0] + sink.gutter].any()


def test_cells_have_the_aspect_ratio_of_their_frames():
    assert sheet_layout((900, 300), 8, 0.4) == (8, 1)
    assert sheet_layout((900, 600), 8, 4.0) == (2, 4)


def test_aborted_sheet_leaves_no_file(tmp_path):
    sink = SheetSink(tmp_path / "sheet.png", (120, 92), [0])
    sink.write(0, plain((1, 2, 3, 255), sink.cell))
    sink.abort()
    assert list(tmp_path.iterdir()) == []


def test_cells_that_are_too_small_are_refused(tmp_path):
    with pytest.raises(ViewerError) as caught:
        SheetSink(tmp_path / "sheet.png", (64, 48), range(100))
    assert str(caught.value) == (
        "contact sheet: 100 frames in 64 x 48 pixels are 5 x 3 each, which is too small"
    )
