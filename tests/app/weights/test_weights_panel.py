"""The Weights panel: scalar colours, range and legend, and vertex tools."""

from dataclasses import replace

import numpy as np
import pytest
from app.tiny import SKEL, skin_text
from imgui_bundle import imgui
from numpy.testing import assert_array_equal

import viewer
from viewer.app.preferences.preferences import Appearance
from viewer.app.weights.weights_panel import no_view, start_heat_map, toggle_weights
from viewer.plugins import Plugin
from viewer.rendering.colors import colormap
from viewer.rigs.annotations import VertexField
from viewer.rigs.scalars import (
    SCALARS,
    compute,
    informative_quantity,
    joint_influences,
    missing_part,
    most_influential,
)
from viewer.rigs.scene import Actor
from viewer.rigs.skinning import Skinning


@pytest.fixture
def bent(drive, rig):
    """A test driver on the Weights panel of the tiny rig in a bent and rotated pose."""
    hand = drive(*rig, size=(1000, 1000), pixels_per_point=0.5)
    dofs = hand.dofs()
    dofs[hand.dof_index("arm.x")], dofs[hand.dof_index("arm.y")] = 1.0, 2.0
    return _posed(hand, dofs)


@pytest.fixture
def wide(drive_body):
    """A test driver on the Weights panel of a posed body with many influences per vertex."""
    hand = drive_body("smpl", n_vertices=96, pixels_per_point=1.0)
    return _posed(hand, 0.8 * np.sin(np.arange(len(hand.dofs()))))


def _posed(hand, dofs):
    """Show the panel of a figure with this initial pose."""
    hand.show_panel("Weights")
    hand.state.actor.pose.dofs[:] = dofs
    hand.state.options.skinning.max_influences = 4
    hand.state.options.scalar = "pruning"
    hand.state.history.start(hand.state.update_version(), hand.state.clock.time)
    hand.step(2)
    return hand


def _chosen(hand) -> Skinning:
    return hand.state.options.skinning


def _legend_colours(hand):
    """Return the positions of the legend's dark, middle and bright colours, or None."""
    x, y, width, _ = hand.state.view_rect
    screen, colours = hand.screen(), colormap(256)[:, :3].astype(int)
    for row in range(int(y), int(y) + 70):
        pixels = screen[row, int(x) : int(x + width)].astype(int)
        ends = [np.abs(pixels - colours[index]).sum(axis=1) <= 12 for index in (2, 128, 253)]
        if all(end.any() for end in ends):
            return [int(np.flatnonzero(end).mean()) for end in ends]
    return None


def test_heat_map_box_switches_the_shading_and_the_legend(wide, texts):
    plain = wide.scene_picture()
    assert _legend_colours(wide) is None
    wide.click("Heat map")
    assert wide.state.options.shading == "scalar"
    assert (wide.scene_picture() != plain).any()
    dark, middle, bright = _legend_colours(wide)
    assert dark < middle < bright
    texts.clear()
    wide.step()
    assert "Distance to 4 influences, mm" in texts
    wide.click("Heat map")
    assert wide.state.options.shading == "auto"
    assert _legend_colours(wide) is None
    assert_array_equal(wide.scene_picture(), plain)


def test_heat_map_can_be_undone(wide):
    wide.click("Heat map")
    wide.key("z", "ctrl")
    assert wide.state.options.shading == "auto"
    wide.key("z", "ctrl shift")
    assert wide.state.options.shading == "scalar"


def test_scalar_range_spans_the_vertices(wide, texts):
    _chosen(wide).max_influences = 2
    wide.click("Heat map")
    for name in SCALARS:
        _check_range(wide, texts, name)


def _check_range(wide, texts, name):
    wide.state.options.scalar, wide.state.selected_joint = name, 0
    wide.step(2)
    actor = wide.state.actor
    joint = ":#0" if SCALARS[name].takes_joint else ""
    values = compute(f"{name}{joint}", actor.figure, actor.pose, _chosen(wide))
    low, high = wide.state.stats.scalar_range
    lacks = missing_part(name + joint, actor.figure)
    assert (low, high) == ((0.0, 0.0) if lacks else (values.min(), values.max()))
    texts.clear()
    wide.step()
    shown = [text for text in texts if text.startswith("up to")]
    if SCALARS[name].unit != "length":
        assert not shown
        return
    assert shown and shown[0].endswith("mm in this pose")
    # Three digits in millimetres.
    said = float(shown[0].split()[2].replace(",", ""))
    assert said == pytest.approx(1000 * high, rel=6e-3)
    # The model has no symmetry map, and its weights already sum to 1.
    assert high > 0 or name in ("asymmetry", "normalized")


def test_scalar_range_follows_the_pose(wide):
    wide.state.options.scalar = "methods"
    wide.click("Heat map")
    wide.step(2)
    assert wide.state.stats.scalar_range[1] > 0
    wide.key("r")
    wide.step(2)
    assert wide.state.stats.scalar_range[1] == pytest.approx(0, abs=1e-12)


def test_legend_states_that_all_values_are_zero(bent, texts):
    # The tiny rig has two influences per vertex, so a limit of four changes nothing.
    bent.click("Heat map")
    bent.step(2)
    texts.clear()
    bent.step()
    assert "0 everywhere" in texts
    assert bent.state.stats.scalar_range == (0.0, 0.0)


def test_lengths_without_a_unit_are_fractions_of_the_size(bent, texts):
    bent.state.options.scalar = "methods"
    bent.click("Heat map")
    bent.step(2)
    texts.clear()
    bent.step()
    assert "Distance LBS to DQS, % of the size" in texts
    actor = bent.state.actor
    plain = replace(_chosen(bent), method="lbs")
    values = compute("methods", actor.figure, actor.pose, plain)
    size = np.linalg.norm([0.4, 2.0, 0.4])  # the size of the column's bounding box
    found = next(text for text in texts if text.startswith("up to"))
    assert float(found.split()[2]) == pytest.approx(100 * values.max() / size, rel=6e-3)


def test_views_are_chosen_from_the_list(wide):
    options = wide.state.options
    lacking = {"asymmetry": "a symmetry map", "parts": "body parts", "field": "fields",
               "class": "classes"}  # fmt: skip
    for name in SCALARS:
        options.scalar, options.shading = "pruning", "auto"
        choose(wide, name)
        if name in lacking:
            assert no_view(wide.state, name) == f"no figure in the scene has {lacking[name]}"
            assert (options.scalar, options.shading) == ("pruning", "auto"), name
            wide.key("escape")  # a click on a disabled entry leaves the list open
        else:
            assert no_view(wide.state, name) == ""
            assert (options.scalar, options.shading) == (name, "scalar"), name


def choose(hand, name):
    """Choose a view from the list."""
    hand.click("##Heat map of")
    hand.step(2)
    hand.click(f"view {name}")
    hand.step(2)


@pytest.fixture
def _plugins(monkeypatch):
    """Two plug-ins, one of which cannot be imported."""
    found = (
        Plugin("scalars", "bad", "no_such_module", "broken 1.0"),
        Plugin("scalars", "height", "viewer.plugin_template.scalars:HEIGHT", "mine 0.1"),
    )
    monkeypatch.setattr("viewer.plugins._installed", lambda group: found)
    monkeypatch.setattr("viewer.rigs.scalars._PLUGGED", {})
    yield
    SCALARS.pop("height", None)


@pytest.mark.usefixtures("_plugins")
def test_quantity_of_a_plugin_is_chosen_from_the_list(wide):
    choose(wide, "height")
    assert wide.state.options.scalar == "height" and wide.state.error == ""
    low, high = wide.state.stats.scalar_range
    heights = viewer.deform(wide.state.actor.figure, wide.state.actor.pose)[0][:, 1]
    assert low == 0.0 and high == pytest.approx(np.ptp(heights), rel=1e-5)
    choose(wide, "bad")
    assert wide.state.error.startswith("plug-in broken 1.0 (scalars bad): cannot be imported")
    assert wide.state.options.scalar == "height"


def test_greyed_view_shows_the_reason(wide, tooltips):
    wide.click("##Heat map of")
    wide.step(2)
    wide.move("view parts")
    wide.step(60)
    assert "no figure in the scene has body parts" in tooltips


@pytest.fixture
def tooltips(monkeypatch):
    """Texts of tooltips."""
    said = []
    monkeypatch.setattr(imgui, "set_tooltip", said.append)
    return said


def test_joint_legend_lists_the_joints(wide, texts):
    wide.state.options.scalar = "dominant"
    wide.click("Heat map")
    wide.step(2)
    texts.clear()
    wide.step()
    entries = wide.state.stats.legend.entries
    assert len(entries) > 2
    shown = [entry.text for entry in entries if entry.text in texts]
    assert shown == [entry.text for entry in entries[: len(shown)]] and len(shown) > 2
    hidden = len(entries) - len(shown)
    assert hidden == 0 or f"and {hidden} more" in texts


def test_joint_weight_view_shows_the_selected_joint(wide, texts):
    wide.state.options.scalar = "weight"
    wide.click("Heat map")
    for joint in (0, 1):
        wide.state.selected_joint = joint
        wide.step(2)
        texts.clear()
        wide.step()
        assert f"Weight of {wide.state.actor.figure.skeleton.names[joint]}" in texts
    wide.state.selected_joint = -1
    wide.step(2)
    texts.clear()
    wide.step()
    assert "no joint is selected" in texts
    assert "Click the skin in the view, or a joint in the tree." in texts


def test_list_keeps_the_joint_given_on_the_command_line(wide):
    wide.state.options.scalar = "weight:#1"
    wide.click("Heat map")
    wide.step(2)
    assert wide.state.options.scalar == "weight:#1"


def test_image_with_a_legend_gets_no_second_legend(wide, texts):
    wide.state.options.legend = True
    wide.click("Heat map")
    wide.step(2)
    texts.clear()
    wide.step()
    assert "Distance to few influences, mm" not in texts
    assert _legend_colours(wide) is not None  # drawn into the image


def test_fixed_range_starts_with_the_automatic_range_and_stays_ordered(bent):
    choose(bent, "stretch")
    # Strains are shown from -m to m in percent; the range in the statistics is already in percent.
    most = max(map(abs, bent.state.stats.scalar_range))
    bent.click("Fixed")
    low, high = bent.state.options.scalar_range
    assert (low, high) == (-float(f"{most:.3g}"), float(f"{most:.3g}"))
    type_into(bent, "To", "50")
    assert bent.state.options.scalar_range == (low, 50.0)
    type_into(bent, "From", "60")  # a minimum above the maximum
    assert bent.state.options.scalar_range == (low, 50.0)
    type_into(bent, "From", "-12.5")
    assert bent.state.options.scalar_range == (-12.5, 50.0)
    assert [tick.text for tick in bent.state.stats.legend.ticks] == ["0", "+20", "+40"]
    bent.click("Automatic")
    assert bent.state.options.scalar_range is None


def type_into(hand, label, text):
    """Replace the number in a field."""
    hand.double_click(hand.place(label, 0.2))
    hand.key("a", "ctrl")
    hand.type(text.replace("-", ""))
    if text.startswith("-"):
        hand.key("home")
        hand.type("-")
    hand.key("enter")
    hand.step(2)


def test_changing_the_view_resets_the_range(bent):
    choose(bent, "stretch")
    bent.click("Fixed")
    choose(bent, "methods")
    assert bent.state.options.scalar_range is None


def test_range_and_isolines_are_greyed_for_integers(wide):
    choose(wide, "influences")
    for label in ("Fixed", "Isolines"):
        wide.click(label)
    assert wide.state.options.scalar_range is None and wide.state.options.isolines is None


def test_isolines_box_shows_the_default_and_keeps_overrides(bent):
    bent.state.selected_joint = 1
    choose(bent, "weight")
    assert bent.state.stats.legend.lines  # the default for weights
    bent.click("Isolines")
    assert bent.state.options.isolines is False
    bent.step(2)
    assert not bent.state.stats.legend.lines
    bent.click("Isolines")
    assert bent.state.options.isolines is None
    choose(bent, "methods")
    bent.click("Isolines")
    assert bent.state.options.isolines is True


def test_legend_check_box_draws_the_legend_in_pictures(bent):
    choose(bent, "methods")
    before = bent.scene_picture()
    bent.click("Legend in pictures")
    bent.step(2)
    assert bent.state.options.legend and (bent.scene_picture() != before).any()


def test_selection_overrides_the_named_joint(bent, texts):
    bent.state.options.scalar, bent.state.options.shading = "weight:root", "scalar"
    bent.state.selected_joint = 1
    bent.step(2)
    assert "of root" in texts
    bent.click("Of the selected joint")
    texts.clear()
    bent.step(2)
    assert bent.state.options.scalar == "weight" and "of arm" in texts


def test_shortcut_toggles_weights_of_the_selected_joint(bent):
    bent.key("v")
    assert bent.says("Weights of root")
    bent.click(bent.place("joint arm", 0.5))
    bent.step(2)
    assert bent.state.stats.legend.title == "Weight of arm"
    bent.key("v")
    assert bent.state.options.shading == "auto"


def test_shortcut_on_a_figure_without_weights_shows_a_message(drive, rig):
    hand = drive(rig[0])
    hand.key("v")
    assert hand.says("there is no mesh") and hand.state.options.shading == "auto"


def test_multiple_fields_are_listed(bent):
    actor = bent.state.actor
    count = actor.figure.mesh.n_vertices
    fields = (
        VertexField("far", "Distance", np.linspace(0.0, 2.0, count)),
        VertexField("near", "Closeness", np.linspace(1.0, 5.0, count)),
    )
    bent.state.scene.actors[0] = replace(actor, figure=replace(actor.figure, fields=fields))
    bent.step(2)
    choose(bent, "field")
    assert bent.state.stats.scalar_range == (0.0, 2.0)
    bent.pick("Field", 1)
    bent.step(2)
    assert bent.state.options.scalar == "field:near"
    assert bent.state.stats.scalar_range == (1.0, 5.0)


def test_legend_grows_with_the_scale_of_the_interface(wide):
    wide.click("Heat map")
    dark, _, bright = _legend_colours(wide)
    wide.state.of(Appearance).screen_scale = 1.5
    wide.step(3)
    left, _, right = _legend_colours(wide)
    assert right - left == pytest.approx(1.5 * (bright - dark), rel=0.05)


TIP = "balljoint arm {\n        balljoint tip { }"


@pytest.fixture
def tipped(drive, tmp_path):
    """A test driver on the tiny rig with an additional child of the arm that moves no vertex."""
    skel, skin = tmp_path / "tipped.skel", tmp_path / "tipped.skin"
    skel.write_text(SKEL.replace("balljoint arm {", TIP))
    skin.write_text(skin_text(3).replace("2 0 0.5 1 0.5", "2 0 0.25 1 0.75"))
    return drive(skel, skin, size=(1000, 1000), samples=1)


def shown(hand):
    """Return the lowest and highest value of the drawn view."""
    hand.step(3)
    return hand.state.stats.scalar_range


def test_influence_of_a_joint_is_the_sum_of_its_weights(tipped):
    figure = tipped.state.actor.figure
    # Four vertices follow the root, four the arm, and four both.
    np.testing.assert_allclose(joint_influences(figure), [5.0, 7.0, 0.0])
    assert most_influential(figure) == 1
    assert informative_quantity("weight", [figure]) == "weight:arm"
    assert most_influential(replace(figure, skin=None)) == -1


@pytest.mark.parametrize("way", ["check box", "shading", "key"])
def test_heat_map_selects_the_joint_with_the_most_influence(tipped, way):
    if way == "check box":
        tipped.show_panel("Weights")
        tipped.click("Heat map")
    elif way == "shading":
        start_heat_map(tipped.state)
    else:
        tipped.key("v")
    assert tipped.state.selected_joint == 1
    assert tipped.state.options.scalar == "weight"
    assert shown(tipped) == (0.0, 1.0)


def test_selected_joint_with_influence_stays(tipped):
    tipped.state.selected_joint = 0
    toggle_weights(tipped.state)
    assert tipped.state.selected_joint == 0 and shown(tipped) == (0.0, 1.0)


def test_selected_joint_without_influence_is_replaced_with_a_note(tipped):
    tipped.state.selected_joint = 2
    toggle_weights(tipped.state)
    assert tipped.state.selected_joint == 1 and shown(tipped) == (0.0, 1.0)
    assert tipped.says("tip has no influence")
    # A later explicit choice is kept, although the joint moves no vertex.
    tipped.state.selected_joint = 2
    assert shown(tipped) == (0.0, 0.0)


def test_chosen_view_is_not_replaced(tipped):
    tipped.state.options.scalar = "entropy"
    start_heat_map(tipped.state)
    assert tipped.state.options.scalar == "entropy" and tipped.state.selected_joint == -1


def test_field_is_the_first_that_is_not_zero_everywhere(tipped):
    state = tipped.state
    count = state.actor.figure.mesh.n_vertices
    fields = (
        VertexField("empty", "Empty", np.zeros(count)),
        VertexField("full", "Full", np.arange(float(count))),
    )
    mesh = replace(state.actor.figure, skeleton=None, skin=None, fields=fields)
    state.scene.actors[:] = [Actor(mesh)]
    state.choose_actor(0)
    start_heat_map(state)  # the field is shown because there are no weights
    assert state.options.scalar == "field:full"
    assert shown(tipped) == (0.0, count - 1.0)
