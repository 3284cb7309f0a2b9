"""PNG files, which must contain exactly the given pixels when read by Pillow."""

import io
import sys

import numpy as np
import pytest
from PIL import Image

from viewer.media.png import encode_png


def noise(height: int, width: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width, 4), dtype=np.uint8)


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (7, 1), (48, 64), (300, 301)])
def test_png_contains_every_pixel_with_alpha(size: tuple[int, int]) -> None:
    pixels = noise(*size, seed=sum(size))
    with Image.open(io.BytesIO(encode_png(pixels))) as picture:
        assert picture.mode == "RGBA" or (pixels[..., 3] == 255).all()
        np.testing.assert_array_equal(np.array(picture.convert("RGBA")), pixels)


@pytest.mark.parametrize("size", [(1, 1), (33, 20)])
def test_opaque_png_has_no_alpha(size: tuple[int, int]) -> None:
    pixels = noise(*size, seed=1)
    pixels[..., 3] = 255
    with Image.open(io.BytesIO(encode_png(pixels))) as picture:
        assert picture.mode == "RGB"
        np.testing.assert_array_equal(np.array(picture), pixels[..., :3])


def test_png_of_a_view_into_a_larger_array_is_correct() -> None:
    pixels = noise(20, 40, seed=2)[::-1, 3:33]
    with Image.open(io.BytesIO(encode_png(pixels))) as picture:
        np.testing.assert_array_equal(np.array(picture), pixels)


def test_png_without_isal_contains_every_pixel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "isal", None)
    monkeypatch.setitem(sys.modules, "isal.isal_zlib", None)
    pixels = noise(20, 30, seed=3)
    with Image.open(io.BytesIO(encode_png(pixels))) as picture:
        np.testing.assert_array_equal(np.array(picture), pixels)
