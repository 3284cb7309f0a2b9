"""The contents of legends: round numbers, units, entries sorted by area, and notes."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import skeleton

from viewer.rendering.camera import Camera, fit
from viewer.rendering.colors import NOTHING, colormap
from viewer.rendering.options import DisplayOptions
from viewer.rendering.overlay.legend import (
    ColoredFigure,
    Legend,
    LegendColumns,
    LegendEntry,
    legend_columns,
    legend_of,
    legend_pixels,
    round_ticks,
)
from viewer.rendering.scalar_look import look_of, shown_ends
from viewer.rigs.annotations import BodyParts, VertexField
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh
from viewer.rigs.scalars import SCALARS, menu_title, missing_part
from viewer.rigs.scene import Actor, Scene, scene_box, scene_points
from viewer.rigs.skin import skin_from_lists
from viewer.rigs.skinning import Skinning


def strip(influences=None, **parts) -> Figure:
    """Return a fan of four triangles with areas 1, 2, 3 and 4."""
    points = [[0.0, 0, 0], [0, -1, 0], [2, 0, 0], [0, 2, 0], [-3, 0, 0], [0, -8 / 3, 0]]
    triangles = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]
    surface = Mesh(np.array(points), np.tile([0.0, 0, 1], (6, 1)), np.array(triangles))
    rows = influences or [[(0, 1.0)]] * 6
    skin = skin_from_lists(rows, np.tile(np.eye(4), (3, 1, 1)))
    return Figure("strip", surface, skeleton([-1, 0, 1], np.zeros((3, 3))), skin, **parts)


def legend(name, *numbers, figure=None, **options):
    """Return the legend of figures with given vertex values."""
    figure = figure or strip(unit="m")
    shown_options = DisplayOptions(scalar=name, **options)
    values = [np.array(each, dtype=float) for each in numbers]
    ends = shown_ends(name, figure, [(v.min(), v.max()) for v in values], shown_options)
    look = look_of(name, figure, ends, shown_options)
    having = (
        [] if missing_part(name, figure) else [ColoredFigure(figure, each, look) for each in values]
    )
    return legend_of(name, having, shown_options.skinning, [figure])


@pytest.mark.parametrize(
    ("low", "high", "texts"),
    [
        (0, 1, ["0", "0.2", "0.4", "0.6", "0.8", "1.0"]),
        (0, 12.3, ["0", "5", "10"]),
        (0, 42.2, ["0", "10", "20", "30", "40"]),
        (-0.5, 1.5, ["-0.5", "0", "0.5", "1.0", "1.5"]),
        (0, 3e-7, ["0", "1e-07", "2e-07", "3e-07"]),
        (0, 2.5e7, ["0", "5e+06", "1e+07", "1.5e+07", "2e+07", "2.5e+07"]),
        (7.0, 7.4, ["7.0", "7.1", "7.2", "7.3", "7.4"]),
    ],
)
def test_ticks_are_round_numbers_at_their_positions(low, high, texts):
    ticks = round_ticks(low, high)
    assert [tick.text for tick in ticks] == texts
    for tick in ticks:
        assert low + tick.place * (high - low) == pytest.approx(float(tick.text), abs=1e-12)
        assert -1e-9 <= tick.place <= 1 + 1e-9


def test_ticks_of_differences_have_signs():
    texts = [tick.text for tick in round_ticks(-60.0, 60.0, signed=True)]
    assert texts == ["-50", "0", "+50"]


@pytest.mark.parametrize("share", [1.0, 1.3, 2.0, 3.7, 4.999, 5.0, 7.77, 9.99])
def test_every_range_has_two_to_six_ticks(share):
    for power in range(-12, 13):
        ticks = round_ticks(0.0, share * 10.0**power)
        assert 2 <= len(ticks) <= 6, power
        places = [tick.place for tick in ticks]
        assert places == sorted(places) and len({tick.text for tick in ticks}) == len(ticks), power


def test_lengths_are_in_millimetres():
    found = legend("pruning", [0, 0.001, 0.0123, 0, 0, 0])
    assert found.heading == "Distance to 4 influences, mm"
    assert [tick.text for tick in found.ticks] == ["0", "5", "10"]
    assert found.note == "from 0 to 12.3"
    assert found.colors.shape == (256, 4)
    assert found.entries == found.lines == ()


def test_weight_legend_has_isolines_and_a_zero_swatch():
    found = legend("weight:j1", [0, 0.5, 0.25, 0, 0, 0])
    assert found.heading == "Weight of j1"
    assert found.entries == (LegendEntry(NOTHING, "no weight"),)
    np.testing.assert_allclose(found.lines, np.arange(1, 10) / 10)
    assert found.ticks[-1].text == "1.0" and found.ticks[-1].place == pytest.approx(1.0)
    assert found.note == "from 0 to 0.5"
    assert legend("weight:j1", [0.5] * 6, isolines=False).lines == ()
    assert len(legend("entropy", [0.5] * 6, isolines=True).lines) == 9


def test_difference_range_is_symmetric():
    found = legend("stretch", [-10, 0, 30, 0, 0, 0])
    assert found.unit == "%"
    assert [tick.text for tick in found.ticks] == ["-20", "0", "+20"]
    assert [tick.place for tick in found.ticks] == pytest.approx([1 / 6, 1 / 2, 5 / 6])
    assert found.note == "from -10 to +30"


def test_fixed_range_sets_the_bar_and_a_note_states_the_actual_range():
    found = legend("pruning", [0, 0.1, 0, 0, 0, 0], scalar_range=(5.0, 10.0))
    assert [tick.text for tick in found.ticks] == ["5", "6", "7", "8", "9", "10"]
    assert found.note == "from 0 to 100"


def test_typical_range_also_reports_the_extremes():
    numbers = np.array([-10.0, 0, 30, 0, 0, 480])
    figure, shown_options = strip(), DisplayOptions(scalar="stretch")
    for ends, note in (
        ((-40.0, 40.0), "99 %: up to ±40; from -10 to +480"),
        ((-480.0, 480.0), "from -10 to +480"),
    ):
        look = look_of("stretch", figure, ends, shown_options)
        found = legend_of("stretch", [ColoredFigure(figure, numbers, look)], Skinning(), [figure])
        assert found.note == note


def test_all_zero_values_are_reported():
    found = legend("methods", [0] * 6)
    assert found.ticks == () and found.note == "0 everywhere"


def test_counts_are_labelled_blocks():
    found = legend("influences", [1, 2, 4, 1, 1, 1])
    assert [tick.text for tick in found.ticks] == ["1", "2", "3", "4"]
    assert [tick.place for tick in found.ticks] == [0.125, 0.375, 0.625, 0.875]
    assert len(found.colors) == 4
    with_none = legend("influences", [0, 2, 1, 1, 1, 1])
    assert [tick.text for tick in with_none.ticks] == ["0", "1", "2"]
    assert tuple(with_none.colors[0, :3]) == NOTHING


def test_many_counts_label_only_some_blocks():
    found = legend("influences", [1, 24, 4, 1, 1, 1])
    assert len(found.colors) == 24
    assert [tick.text for tick in found.ticks] == ["3", "6", "9", "12", "15", "18", "21", "24"]
    assert found.ticks[0].place == pytest.approx(2.5 / 24)


def test_uniform_count_has_one_block():
    found = legend("influences", [2] * 6)
    assert [(tick.text, tick.place) for tick in found.ticks] == [("2", 0.5)]


def test_joints_are_listed_by_area():
    # Each vertex has a third of its triangles: vertex 4 (3 + 4) / 3, vertex 3 (2 + 3) / 3, vertex 0
    # 10 / 3.
    found = legend("dominant", [1, 2, 2, 0, -1, 2])
    # j1: 10/3; none: 7/3; j2: 1/3 + 1 + 4/3 = 8/3; j0: 5/3.
    assert [entry.text for entry in found.entries] == ["j1", "j2", "no influence", "j0"]
    assert found.entries[2].color == NOTHING
    assert len({entry.color for entry in found.entries}) == 4
    assert len(found.colors) == 0 and found.note == ""


def test_joints_of_identical_figures_are_listed_once():
    found = legend("dominant", [0] * 6, [1, 0, 0, 0, 0, 0])
    assert [entry.text for entry in found.entries] == ["j0", "j1"]


def test_parts_are_listed_by_name():
    parts = BodyParts(("head", "tail", "wing"), np.array([0, 1, 1, 1, 1, 1]))
    found = legend("parts", [0, 1, 1, 1, 1, 1], figure=strip(body_parts=parts))
    assert found.heading == "Body parts"
    assert [entry.text for entry in found.entries] == ["tail", "head"]


@pytest.mark.parametrize("name", SCALARS)
def test_missing_data_is_reported(name):
    bare = replace(strip(), skin=None)
    nothing = [-1.0 if SCALARS[name].kind == "categorical" else 0.0] * 6
    found = legend(name, nothing, figure=bare)
    assert found.title == menu_title(name, Skinning())
    assert found.note == f"no figure has {SCALARS[name].needs}"
    assert found.ticks == found.entries == () and len(found.colors) == 0


def test_unknown_and_missing_joints_are_reported():
    assert legend("weight", [0] * 6).note == "no joint is selected"
    assert legend("weight:toe", [0] * 6).note == 'no figure has a joint "toe"'


@pytest.mark.parametrize(("kept", "title"), [
    (0, "Distance to 4 influences"), (8, "Distance to 8 influences"), (1, "Distance to 1 influence")
])  # fmt: skip
def test_title_states_the_number_of_influences(kept, title):
    found = legend("pruning", [0, 0.1, 0, 0, 0, 0], skinning=Skinning(max_influences=kept))
    assert found.heading == f"{title}, mm"
    assert legend("pruning", [0] * 6, figure=replace(strip(), skin=None)).title.endswith(
        "4 influences"
    )


def test_title_is_kept_while_the_figure_with_the_field_is_hidden():
    having = strip(fields=(VertexField("near", "How near", np.zeros(6)),))
    found = legend_of("field:near", [], Skinning(), [strip(), having])
    assert (found.title, found.note) == ("How near", "not available for the visible figures")
    assert legend_of("field:near", [], Skinning(), [strip()]).title == "Field"


def test_empty_list_has_no_column():
    assert legend_columns([], 3, 100.0) == LegendColumns((), ())
    assert legend_columns([], 3, 100.0).rows == 0


def test_one_column_is_used_if_its_lines_fit():
    assert legend_columns([4.0, 7.0, 5.0], 3, 100.0) == LegendColumns((3,), (7.0,))


def test_columns_are_balanced_and_as_wide_as_needed():
    found = legend_columns([4.0, 7.0, 5.0, 3.0, 2.0], 4, 100.0)
    assert found == LegendColumns((3, 2), (7.0, 3.0))
    assert found.rows == 3


def test_full_columns_are_used_if_balanced_columns_are_too_wide():
    # Balanced columns of 2 + 2 entries need 9 + 9; full columns of 3 + 1 need 9 + 2.
    assert legend_columns([1.0, 9.0, 9.0, 2.0], 3, 12.0) == LegendColumns((3, 1), (9.0, 2.0))


def test_overflow_is_counted_on_a_separate_line():
    found = legend_columns([5.0] * 10, 3, 11.0)
    assert found == LegendColumns((3, 2), (5.0, 5.0), 5)
    assert found.rows == 3


@pytest.mark.parametrize(("rows", "counts", "left_out"), [(2, (1,), 3), (1, (0,), 4)])
def test_first_column_is_kept_in_any_width(rows, counts, left_out):
    found = legend_columns([50.0] * 4, rows, 11.0)
    assert found == LegendColumns(counts, (50.0,), left_out)
    assert found.rows == rows


SIZE = 640, 360
CODE = np.array([1 << 16, 1 << 8, 1])  # converts a colour to a single number


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
