"""Batched decoding of images: contents, errors in order, and a common limit of pixels."""

import io
import sys
import threading
import tracemalloc
import warnings
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from viewer.errors import FormatError
from viewer.media import image
from viewer.media.image import decode_picture, decode_pictures, decoding_pictures, save_image
from viewer.media.png import encode_png


def png(pixels: np.ndarray) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG")
    return stream.getvalue()


def file(number: int) -> tuple[Path, bytes]:
    return Path(f"{number}.png"), png(np.full((2, 3, 4), number, np.uint8))


def test_images_are_returned_in_order_with_errors_at_their_positions():
    files = [file(number) for number in range(20)]
    files[7] = Path("7.png"), files[7][1][:45]
    files[9] = Path("9.png"), b"nothing"
    filters = list(warnings.filters)
    found = decode_pictures(files)
    assert warnings.filters == filters
    for number, pixels in enumerate(found):
        if number in (7, 9):
            assert isinstance(pixels, FormatError)
            assert pixels.diagnostic.path == files[number][0]
        else:
            assert (pixels == number).all() and pixels.shape == (2, 3, 4)
            assert not pixels.flags.writeable


def test_large_images_are_decoded_while_the_caller_works(monkeypatch):
    monkeypatch.setattr(image, "_FEW_BYTES", 0)
    monkeypatch.setattr(image.os, "cpu_count", lambda: 2)
    begun, decoded = threading.Event(), image._decoded

    def observed(opened):
        begun.set()
        return decoded(opened)

    monkeypatch.setattr(image, "_decoded", observed)
    with decoding_pictures([file(1), file(2)]) as finish:
        assert begun.wait(60.0)
        assert [pixels[0, 0, 0] for pixels in finish()] == [1, 2]


def test_filters_of_warnings_are_restored_if_the_caller_fails():
    filters = list(warnings.filters)
    with pytest.raises(ZeroDivisionError), decoding_pictures([file(1)]):
        raise ZeroDivisionError
    assert warnings.filters == filters


def test_empty_list_of_images_is_decoded():
    assert decode_pictures([]) == []


def test_images_share_a_limit_of_pixels(monkeypatch):
    monkeypatch.setattr(image, "_MAX_PIXELS", 15)
    found = decode_pictures([file(1), file(2), file(3)])
    assert [isinstance(one, FormatError) for one in found] == [False, False, True]
    assert decode_picture(*file(3)).shape == (2, 3, 4)


@pytest.mark.parametrize(("grey", "byte"), [(0, 0), (32768, 128), (65535, 255), (257 * 7, 7)])
def test_grey_images_with_16_bits_are_scaled(grey, byte):
    pixels = decode_picture(Path("a.png"), png(np.array([[grey]], np.uint16)))
    assert pixels.tolist() == [[[byte, byte, byte, 255]]]


def test_large_images_need_large_files(monkeypatch):
    """A file of one colour holds thousands of pixels per byte; decoding it took gigabytes."""
    monkeypatch.setattr(image, "_FREE_PIXELS", 100)
    flat = png(np.zeros((64, 64), np.uint8))
    noisy = png(np.random.default_rng(0).integers(0, 256, (64, 64), np.uint8))
    assert 16 * len(flat) + 100 < 64 * 64 < 16 * len(noisy) + 100
    found = decode_pictures([(Path("a.png"), flat)])[0]
    assert str(found).endswith(f"64 x 64 pixels are too many for {len(flat)} bytes")
    assert decode_picture(Path("a.png"), noisy).shape == (64, 64, 4)


@pytest.mark.parametrize("mode", ["RGBA", "RGB", "L", "LA", "P"])
def test_every_mode_becomes_red_green_blue_and_opacity(mode):
    stream = io.BytesIO()
    Image.new("RGBA", (3, 2), (90, 90, 90, 255)).convert(mode).save(stream, "PNG")
    pixels = decode_picture(Path("a.png"), stream.getvalue())
    assert pixels.shape == (2, 3, 4) and not pixels.flags.writeable
    assert np.abs(pixels.astype(int) - (90, 90, 90, 255)).max() <= (0 if mode != "P" else 30)


def noise(height: int, width: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width, 4), dtype=np.uint8)


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (7, 1), (48, 64), (300, 301)])
def test_png_contains_every_pixel_with_alpha(size):
    pixels = noise(*size, seed=sum(size))
    with Image.open(io.BytesIO(encode_png(pixels))) as picture:
        assert picture.mode == "RGBA" or (pixels[..., 3] == 255).all()
        np.testing.assert_array_equal(np.array(picture.convert("RGBA")), pixels)


@pytest.mark.parametrize("is_opaque", [True, False])
def test_png_of_several_bands_contains_every_pixel(is_opaque, monkeypatch):
    monkeypatch.setattr("viewer.media.png._BAND", 90)  # three rows of thirty pixels
    pixels = noise(10, 30, seed=5)
    pixels[..., 3] |= 255 * is_opaque
    with Image.open(io.BytesIO(encode_png(pixels))) as picture:
        np.testing.assert_array_equal(np.array(picture.convert("RGBA")), pixels)


def test_png_needs_no_copy_of_the_image():
    pixels = np.zeros((2000, 1000, 4), dtype=np.uint8)
    tracemalloc.start()
    try:
        encode_png(pixels)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < pixels.nbytes / 4


@pytest.mark.parametrize("size", [(1, 1), (33, 20)])
def test_opaque_png_has_no_alpha(size):
    pixels = noise(*size, seed=1)
    pixels[..., 3] = 255
    with Image.open(io.BytesIO(encode_png(pixels))) as picture:
        assert picture.mode == "RGB"
        np.testing.assert_array_equal(np.array(picture), pixels[..., :3])


def test_png_of_a_view_into_a_larger_array_is_correct():
    pixels = noise(20, 40, seed=2)[::-1, 3:33]
    with Image.open(io.BytesIO(encode_png(pixels))) as picture:
        np.testing.assert_array_equal(np.array(picture), pixels)


def test_png_without_isal_contains_every_pixel(monkeypatch):
    monkeypatch.setitem(sys.modules, "isal", None)
    monkeypatch.setitem(sys.modules, "isal.isal_zlib", None)
    pixels = noise(20, 30, seed=3)
    with Image.open(io.BytesIO(encode_png(pixels))) as picture:
        np.testing.assert_array_equal(np.array(picture), pixels)


@pytest.mark.parametrize("suffix", [".ppm", ".tif", ".tga", ".png"])
@pytest.mark.parametrize("alpha", [255, 90])
@pytest.mark.parametrize("order", [1, -1])
def test_lossless_formats_contain_every_pixel_in_either_order_of_rows(
    tmp_path, suffix, alpha, order
):
    """Rendered images have their last row first in memory."""
    pixels = noise(5, 7, seed=4)
    pixels[..., 3] = alpha
    size = save_image(tmp_path / f"a{suffix}", pixels[::order])
    assert size == (tmp_path / f"a{suffix}").stat().st_size
    with Image.open(tmp_path / f"a{suffix}") as picture:
        is_rgb = alpha == 255 or suffix == ".ppm"
        assert picture.mode == ("RGB" if is_rgb else "RGBA")
        wanted = pixels[::order, :, : 3 if is_rgb else 4]
        np.testing.assert_array_equal(np.array(picture), wanted)
