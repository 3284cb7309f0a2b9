"""The contents of legends: round numbers, units, entries sorted by area, and notes."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import skeleton

from viewer.rendering.colors import NOTHING
from viewer.rendering.options import DisplayOptions
from viewer.rendering.overlay.legend import ColoredFigure, LegendEntry, legend_of, round_ticks
from viewer.rendering.scalar_look import look_of, shown_ends
from viewer.rig.annotations import BodyParts, VertexField
from viewer.rig.figure import Figure
from viewer.rig.mesh import Mesh
from viewer.rig.scalars import SCALARS, menu_title, missing_part
from viewer.rig.skin import skin_from_lists
from viewer.rig.skinning import Skinning


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


@pytest.mark.parametrize("power", range(-12, 13))
@pytest.mark.parametrize("share", [1.0, 1.3, 2.0, 3.7, 4.999, 5.0, 7.77, 9.99])
def test_every_range_has_two_to_six_ticks(power, share):
    ticks = round_ticks(0.0, share * 10.0**power)
    assert 2 <= len(ticks) <= 6
    places = [tick.place for tick in ticks]
    assert places == sorted(places) and len({tick.text for tick in ticks}) == len(ticks)


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
