"""Batched decoding of images: contents, errors in order, and a common limit of pixels."""

import io
import threading
import warnings
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from viewer.errors import FormatError
from viewer.media import image
from viewer.media.image import decode_picture, decode_pictures, decoding_pictures


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
        assert begun.wait(10.0)
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
