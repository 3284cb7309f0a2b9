"""``viewer render --view`` and ``--cameras`` with images of the cameras of a capture."""

import numpy as np
import pytest
from formats.filmed_capture import CENTER, SIDE, write_filmed
from PIL import Image

import viewer
from viewer.cli import run
from viewer.rendering.pinhole import frustum_corners

pytestmark = pytest.mark.slow

_QUICK = ("--quality", "draft", "--force")


@pytest.fixture
def recording(tmp_path):
    return write_filmed(tmp_path / "take")


def drawn(recording, out, *options):
    size = f"{SIDE}x{SIDE}"
    still = ("--view", "01", "--no-grid", "--size", size, "--samples", "1", *_QUICK)
    assert run(["render", str(recording), "-o", str(out), *still, *options]) == 0
    return np.array(Image.open(out).convert("RGB")).astype(int)


def test_undistorted_image_is_drawn_behind_the_scene(recording, tmp_path, capsys):
    pixels = drawn(recording, tmp_path / "a.png", "--frame", "0")
    row = pixels[int(CENTER), :, 0]
    # The image is dimmed to 60 %, and the line is at its position without distortion.
    assert row[2] == 60 and int(np.argmin(row[80:])) + 80 == 90
    error = capsys.readouterr().err
    assert "images/01: 1 of 3 frames have no image: 1\n" in error
    assert "its lens distortion of up to 7.1 pixels is removed from its images\n" in error
    assert drawn(recording, tmp_path / "a.png", "--frame", "2")[50, 2, 0] == 120


def test_frame_without_image_has_the_background(recording, tmp_path):
    pixels = drawn(recording, tmp_path / "a.png", "--frame", "1", "--background", "#ff0000")
    assert pixels[2, 2].tolist() == [255, 0, 0]


def test_images_with_a_different_aspect_ratio_are_reported_and_not_drawn(
    recording, tmp_path, capsys
):
    for path in (recording / "images" / "01").iterdir():
        Image.new("RGB", (60, 30), (9, 9, 9)).save(path)
    pixels = drawn(recording, tmp_path / "a.png", "--background", "#ff0000", "--frame", "0")
    assert pixels[2, 2].tolist() == [255, 0, 0]
    error = capsys.readouterr().err
    assert "its images have 60 x 30 pixels, the calibration 101 x 101: they do not match" in error


def test_images_are_read_from_the_given_folder(recording, tmp_path, capsys):
    (recording / "images").rename(tmp_path / "elsewhere")
    elsewhere = ("--images", str(tmp_path / "elsewhere"))
    assert drawn(recording, tmp_path / "a.png", *elsewhere, "--frame", "0")[50, 2, 0] == 60
    out = str(tmp_path / "b.png")
    assert run(["render", str(recording), "-o", out, "--images", str(recording)]) == 2
    expected = "take: expected a folder of images for a camera (01), found none\n"
    assert capsys.readouterr().err.endswith(expected)


def test_frustum_shows_the_image_in_the_viewing_direction(recording, tmp_path):
    view = viewer.load(recording).views[0]
    # The frustum ends 2 in front of (0, -5, 0), where half of 101 pixels are 1.01 to the left and
    # up.
    corners = frustum_corners(view, 2.0)
    np.testing.assert_allclose(corners[0], [-1.01, -3.0, 1.01], atol=1e-12)
    np.testing.assert_allclose(corners[2], [1.01, -3.0, -1.01], atol=1e-12)
    out = tmp_path / "c.png"
    options = ("--cameras", "--no-grid", "--front", "-y", "--azimuth", "180", "--frame", "2")
    assert (
        run(["render", str(recording), "-o", str(out), "--size", "480x360", *_QUICK, *options]) == 0
    )
    pixels = np.array(Image.open(out).convert("RGB")).astype(int)
    assert (pixels == 200).all(axis=2).sum() > 20  # the grey of the image


def test_damaged_image_is_reported_and_not_drawn(recording, tmp_path, capsys):
    (recording / "images" / "01" / "000000.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    drawn(recording, tmp_path / "a.png", "--frame", "0")
    assert "camera 01: its first image is not readable" in capsys.readouterr().err
