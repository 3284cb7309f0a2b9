"""Rendered legends: position, visibility and undisturbed surroundings."""

from dataclasses import replace

import numpy as np
import pytest
from test_legend import legend, strip

from viewer.rendering.camera import Camera, fit
from viewer.rendering.colors import colormap
from viewer.rendering.offscreen import Offscreen
from viewer.rendering.options import DisplayOptions
from viewer.rendering.overlay.legend import Legend, LegendEntry, legend_pixels
from viewer.rig.scene import Actor, Scene, scene_box, scene_points

SIZE = 640, 360
CODE = np.array([1 << 16, 1 << 8, 1])  # converts a colour to a single number


@pytest.fixture(scope="module")
def offscreen():
    with Offscreen() as result:
        yield result


def rows_with(pixels, color):
    """Return the rows of an image that contain a colour."""
    return np.flatnonzero((pixels[..., :3] == color).all(axis=2).any(axis=1))


def test_bar_runs_from_the_first_to_the_last_colour():
    pixels = legend_pixels(legend("pruning", [0, 0, 0, 0, 0, 0.04]), SIZE)
    colors = colormap()[:, :3]
    bar = rows_with(pixels, colors[0])
    row = pixels[bar[len(bar) // 2], :, :3].astype(int)
    places = [int(np.abs(row - color).sum(axis=1).argmin()) for color in colors[[2, 64, 128, 253]]]
    assert places == sorted(places) and places[-1] - places[0] > 100
    # The bar is linear: a quarter of the colours is a quarter of the bar.
    assert places[1] - places[0] == pytest.approx((places[-1] - places[0]) * 62 / 251, abs=2)


@pytest.mark.parametrize("is_light", [False, True])
def test_text_contrasts_with_the_panel_and_what_is_behind_it(is_light):
    """WCAG 2 asks for a contrast of at least 4.5 for text."""
    pixels = legend_pixels(legend("weight:j1", [0, 1, 0, 0, 0, 0]), SIZE, is_light)
    behind = 255.0 if is_light else 60.0
    alpha = pixels[..., 3:] / 255.0
    seen = (alpha * pixels[..., :3] + (1.0 - alpha) * behind) / 255.0
    linear = np.where(seen <= 0.04045, seen / 12.92, ((seen + 0.055) / 1.055) ** 2.4)
    luminance = linear @ [0.2126, 0.7152, 0.0722]
    panel = luminance[1, 1]
    heading = luminance[: len(luminance) // 4]
    text = heading.min() if is_light else heading.max()
    brighter, darker = max(panel, text), min(panel, text)
    assert (panel > 0.5) == is_light
    assert (brighter + 0.05) / (darker + 0.05) > 4.5


def test_isolines_are_on_the_bar():
    found = legend("weight:j1", [0, 1, 0, 0, 0, 0])
    with_lines, without = (legend_pixels(one, SIZE) for one in (found, replace(found, lines=())))
    changed = (with_lines != without).any(axis=(0, 2))
    columns = np.flatnonzero(changed)
    assert len(columns) == 9
    assert np.ptp(np.diff(columns)) <= 1


def test_swatches_are_listed_downwards_in_their_order():
    entries = tuple(LegendEntry((200, 10 * index, 40), f"joint {index}") for index in range(5))
    pixels = legend_pixels(Legend("Dominant joint", entries=entries), SIZE)
    tops = [rows_with(pixels, entry.color)[0] for entry in entries]
    steps = np.diff(tops)
    assert (steps > 0).all() and np.ptp(steps) <= 1


def joints(count, size, name="joint {}"):
    """Return the legend of n joints, and the first pixel column of each swatch, None if hidden."""
    entries = tuple(
        LegendEntry((200, index % 256, 40 + index // 256), name.format(index))
        for index in range(count)
    )
    pixels = legend_pixels(Legend("Dominant joint", entries=entries), size)
    # The first pixel of a colour, counted down the columns, is in its leftmost column.
    columns = np.swapaxes(pixels[..., :3], 0, 1).astype(int)
    codes, first = np.unique(columns @ CODE, return_index=True)
    lefts = dict(zip(codes.tolist(), (first // pixels.shape[0]).tolist(), strict=True))
    return pixels, [lefts.get(int(np.array(entry.color) @ CODE)) for entry in entries]


@pytest.mark.parametrize("size", [(400, 300), (1280, 720), (1920, 1080)])
@pytest.mark.parametrize("count", [24, 37])
def test_every_joint_of_a_body_or_creature_has_its_swatch(size, count):
    pixels, lefts = joints(count, size)
    assert None not in lefts and lefts == sorted(lefts)
    assert pixels.shape[0] <= 0.9 * size[1] and pixels.shape[1] <= 0.45 * size[0]


def test_many_joints_are_listed_in_balanced_columns():
    _, lefts = joints(40, (1280, 720))
    columns = [lefts.count(left) for left in sorted(set(lefts))]
    assert columns == [20, 20]


def test_letters_shrink_before_columns_reach_the_figure():
    name = "a joint with a long name {}"
    few, many = (joints(count, (1280, 720), name) for count in (2, 60))
    swatches = [len(rows_with(pixels, (200, 0, 40))) for pixels, _ in (few, many)]
    assert 0.6 * swatches[0] <= swatches[1] < swatches[0]
    assert None not in many[1] and many[0].shape[1] <= 0.45 * 1280


def test_overflow_is_counted():
    pixels, lefts = joints(2000, (1280, 720))
    shown = lefts.index(None)
    assert shown > 100 and all(left is None for left in lefts[shown:])
    assert pixels.shape[0] <= 0.9 * 720 and pixels.shape[1] <= 0.45 * 1280
    # The line with the number of omitted joints is the last of the last column and has no swatch.
    per_column = lefts.count(lefts[0])
    assert (shown + 1) % per_column == 0


def test_small_image_has_fewer_swatches():
    pixels, lefts = joints(37, (300, 120))
    assert pixels.shape[0] <= 0.9 * 120
    seen = [left is not None for left in lefts]
    assert 2 < sum(seen) < 37 and seen == sorted(seen, reverse=True)


@pytest.mark.parametrize(("size", "fits"), [((640, 360), True), ((60, 360), False),
                                            ((640, 30), False)])  # fmt: skip
def test_legend_that_does_not_fit_is_left_out(size, fits):
    assert (legend_pixels(legend("pruning", [0, 0, 0, 0, 0, 0.04]), size) is not None) == fits


def test_letters_grow_with_the_image():
    found = legend("pruning", [0, 0, 0, 0, 0, 0.04])
    heights = [legend_pixels(found, size).shape[0] for size in (SIZE, (1280, 720), (3840, 2160))]
    assert heights[0] < heights[1] < heights[2]
    assert heights[2] < 0.25 * 2160


def test_names_with_line_breaks_stay_on_one_line():
    entries = (
        LegendEntry((200, 0, 40), "two\nlines\t" + "x" * 500),
        LegendEntry((0, 200, 40), "骨"),
    )
    pixels = legend_pixels(Legend("Dominant joint", entries=entries), SIZE)
    assert pixels.shape[1] < 0.9 * SIZE[0]


def draw(offscreen, name="dominant", size=SIZE, **options):
    rows = [[(0, 1.0)], [(1, 1.0)], [(1, 1.0)], [(2, 1.0)], [(2, 1.0)], [(2, 1.0)]]
    scene = Scene([Actor(strip(rows))])
    camera = Camera(azimuth=0.0, inclination=0.0)
    fit(camera, scene_points(scene), size[0] / size[1])
    shown = DisplayOptions(shading="scalar", scalar=name, background="transparent", grid=False)
    for key, value in options.items():
        setattr(shown, key, value)
    offscreen.renderer.notes.clear()
    return offscreen.render(scene, size, camera, shown, scene_box(scene))


@pytest.mark.parametrize("samples", [1, 4])
def test_legend_is_drawn_pixel_by_pixel_into_the_corner(offscreen, samples):
    plain = draw(offscreen, samples=samples)
    picture = draw(offscreen, samples=samples, legend=True)
    pixels = legend_pixels(offscreen.renderer.scalars.legend, SIZE)
    changed = (plain != picture).any(axis=2)
    rows, columns = np.flatnonzero(changed.any(axis=1)), np.flatnonzero(changed.any(axis=0))
    top, left = rows[0], columns[0]
    assert (rows[-1] - top + 1, columns[-1] - left + 1) == pixels.shape[:2]
    assert top == left == 5
    found = picture[top : rows[-1] + 1, left : columns[-1] + 1]
    # There is nothing behind the legend, so colours and opacity are exact except for rounding.
    np.testing.assert_allclose(found.astype(int), pixels, atol=2)


def test_legend_covers_the_figure_and_is_drawn_last(offscreen):
    plain = draw(offscreen, size=(200, 150))
    picture = draw(offscreen, size=(200, 150), legend=True, show="both", wireframe=True)
    pixels = legend_pixels(offscreen.renderer.scalars.legend, (200, 150))
    height, width = pixels.shape[:2]
    inside = picture[2 : 2 + height, 2 : 2 + width].astype(int)
    solid = pixels[..., 3] == 255
    assert solid.any() and (plain[2 : 2 + height, 2 : 2 + width][..., 3] > 0).any()
    np.testing.assert_allclose(inside[solid], pixels[solid], atol=2)


def test_other_shading_modes_have_no_legend(offscreen):
    plain = draw(offscreen, shading="phong")
    np.testing.assert_array_equal(plain, draw(offscreen, shading="phong", legend=True))


def test_image_that_is_too_small_for_a_legend_is_reported(offscreen):
    plain = draw(offscreen, size=(40, 40))
    np.testing.assert_array_equal(plain, draw(offscreen, size=(40, 40), legend=True))
    assert offscreen.renderer.notes == ["an image of 40 x 40 pixels has no room for a legend"]


def test_legend_follows_view_and_size(offscreen):
    first = draw(offscreen, legend=True)
    draw(offscreen, "influences", legend=True)
    draw(offscreen, legend=True, size=(1280, 720))
    np.testing.assert_array_equal(draw(offscreen, legend=True), first)
