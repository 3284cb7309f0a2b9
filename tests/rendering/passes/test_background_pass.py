"""Backgrounds, which are computed once per size and equal in every frame."""

import numpy as np
import pytest
from rendering.drawn_figures import scene_of, sphere
from rendering.plain_pictures import draw, front, plain

from viewer.rig.scene import Scene

EMPTY = Scene([])


@pytest.mark.parametrize("samples", [1, 4])
def test_every_frame_has_the_same_gradient(offscreen, samples) -> None:
    options = plain(background="gradient", samples=samples)
    sizes = [(60, 40), (60, 40), (60, 40), (40, 30), (60, 40)]
    found = [draw(offscreen, EMPTY, options, size=size) for size in sizes]
    # The first background is computed, the second copied, and other sizes do not change it.
    for frame in (found[1], found[2], found[4]):
        np.testing.assert_array_equal(frame, found[0])
    # The dithered sRGB colours are 0.36, 0.43, 0.52 at the upper and 0.80, 0.83, 0.86 at the lower
    # edge.
    for row, color in ((0, (0.36, 0.43, 0.52)), (-1, (0.80, 0.83, 0.86))):
        step = (np.array((0.80, 0.83, 0.86)) - (0.36, 0.43, 0.52)) / 80.0
        expected = 255.0 * (np.array(color) + (step if row == 0 else -step))
        np.testing.assert_allclose(found[0][row, :, :3].mean(axis=0), expected, atol=1.0)


@pytest.mark.parametrize(
    "background, color",
    [("white", (255, 255, 255, 255)), ("#336699", (51, 102, 153, 255)), ("transparent", (0,) * 4)],
)
def test_color_fills_the_image_exactly(offscreen, background, color) -> None:
    for samples in (1, 4):
        picture = draw(offscreen, EMPTY, plain(background=background, samples=samples))
        assert (picture == color).all()


def test_frame_shows_no_pixels_of_the_previous_frame(offscreen) -> None:
    options = plain(background="gradient")
    empty = draw(offscreen, EMPTY, options)
    draw(offscreen, scene_of(sphere(8)), options, front())
    np.testing.assert_array_equal(draw(offscreen, EMPTY, options), empty)
