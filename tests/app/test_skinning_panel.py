"""The Skinning panel: method, few influences, normalising, and the heat map with its legend."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from viewer.rendering.colormap import colormap
from viewer.rig.scalars import SCALARS, compute
from viewer.rig.skinning import Skinning


@pytest.fixture
def skinning(drive, rig):
    """A hand on the Skinning panel of the tiny rig, which is bent and turned."""
    hand = drive(*rig, size=(900, 1000), samples=1)
    dofs = hand.dofs()
    dofs[hand.dof_index("arm.x")], dofs[hand.dof_index("arm.y")] = 1.0, 2.0
    return _posed(hand, dofs)


@pytest.fixture
def wide(drive_body):
    """A hand on the Skinning panel of a body with many influences a vertex, posed."""
    hand = drive_body("smpl", n_vertices=96)
    return _posed(hand, 0.8 * np.sin(np.arange(len(hand.dofs()))))


def _posed(hand, dofs):
    """Show the panel of a figure that was in this pose from the start."""
    hand.show_panel("Skinning")
    hand.state.actor.pose.dofs[:] = dofs
    hand.state.history.start(hand.state.scene, hand.state.options)
    hand.step(2)
    return hand


def _chosen(hand) -> Skinning:
    return hand.state.options.skinning


def test_radio_buttons_choose_the_method(skinning):
    pictures = []
    for label, method in (("DQS", "dqs"), ("Mixed", "mix"), ("LBS", "lbs")):
        skinning.click(label)
        assert _chosen(skinning).method == method
        pictures.append(skinning.scene_picture())
    assert (pictures[0] != pictures[1]).any() and (pictures[1] != pictures[2]).any()
    assert skinning.undo_steps >= 3


def test_share_slider_mixes_from_either_method(skinning):
    for label in ("LBS", "DQS"):
        skinning.click(label)
        skinning.drag("DQS share", 0.25, "DQS share")
        assert _chosen(skinning).method == "mix"
        assert _chosen(skinning).share == pytest.approx(0.25, abs=0.02)


def test_share_drag_is_one_step(skinning):
    skinning.drag("DQS share", 0.75, "DQS share")
    assert skinning.undo_steps == 1
    skinning.key("z", "ctrl")
    assert _chosen(skinning) == Skinning()
    skinning.key("z", "ctrl shift")
    assert _chosen(skinning).method == "mix"
    assert _chosen(skinning).share == pytest.approx(0.75, abs=0.02)


def test_typed_share_stays_between_the_methods(skinning):
    for text in ("7", "-3", "nan", "1e39", ""):
        skinning.click("Mixed")
        skinning.enter_value("DQS share", text)
        assert 0.0 <= _chosen(skinning).share <= 1.0
    assert skinning.scene_picture().any()


def test_engine_box_cuts_to_four_influences_and_back(wide):
    wide.click("engine")
    assert _chosen(wide).max_influences == 4
    wide.click("engine")
    assert _chosen(wide).max_influences == 0
    assert wide.undo_steps == 2


def test_influences_slider_counts_only_with_the_box(wide):
    wide.drag("Influences", 0.0, "Influences")
    assert _chosen(wide).max_influences == 0
    whole = wide.scene_picture()
    wide.click("engine")
    steps = wide.undo_steps
    wide.drag("Influences", 0.0, "Influences")
    assert _chosen(wide).max_influences == 1 and wide.undo_steps == steps + 1
    assert (wide.scene_picture() != whole).any()
    wide.drag("Influences", 1.0, "Influences")
    assert _chosen(wide).max_influences == 4  # no vertex of this model has more


def test_normalise_box_is_one_step_and_rests_while_influences_are_cut(skinning):
    skinning.click("Normalise weights")
    assert _chosen(skinning).normalize and skinning.undo_steps == 1
    skinning.click("Normalise weights")
    assert not _chosen(skinning).normalize
    skinning.click("engine")
    skinning.click("Normalise weights")
    assert not _chosen(skinning).normalize


def test_normalising_scales_the_weights_of_the_picture(drive, rig):
    text = rig[1].read_text().replace("2 0 0.5 1 0.5", "2 0 0.25 1 0.25")
    rig[1].write_text(text)
    hand = drive(*rig, size=(900, 1000), samples=1)
    hand.show_panel("Skinning")
    stored = hand.scene_picture()
    hand.click("Normalise weights")
    assert (hand.scene_picture() != stored).any()
    # Halved weights pull the middle square, 1 m up, to half of its height: it is 0.5 m lower.
    hand.state.actor.pose.dofs[:] = 0
    values = compute("normalized", hand.state.actor.figure, hand.state.actor.pose, Skinning())
    half = 0.5 * np.linalg.norm([0.2, 1.0, 0.2])
    np.testing.assert_allclose(values, [0] * 4 + [half] * 4 + [0] * 4, atol=1e-12)


def _legend_colours(hand):
    """Return where the legend has its dark, middle and bright colour, None without a legend."""
    x, y, width, _ = hand.state.view_rect
    screen, colours = hand.screen(), colormap(256)[:, :3].astype(int)
    for row in range(int(y), int(y) + 70):
        pixels = screen[row, int(x) : int(x + width)].astype(int)
        ends = [np.abs(pixels - colours[index]).sum(axis=1) <= 12 for index in (2, 128, 253)]
        if all(end.any() for end in ends):
            return [int(np.flatnonzero(end).mean()) for end in ends]
    return None


def test_heat_map_box_switches_the_shading_and_the_legend(wide, texts):
    wide.click("engine")
    plain = wide.scene_picture()
    assert _legend_colours(wide) is None
    wide.click("Heat map")
    assert wide.state.options.shading == "scalar"
    assert (wide.scene_picture() != plain).any()
    dark, middle, bright = _legend_colours(wide)
    assert dark < middle < bright
    texts.clear()
    wide.step()
    assert "Distance to few influences, mm" in texts
    wide.click("Heat map")
    assert wide.state.options.shading == "phong"
    assert _legend_colours(wide) is None
    assert_array_equal(wide.scene_picture(), plain)


def test_heat_map_is_undone(wide):
    wide.click("Heat map")
    wide.key("z", "ctrl")
    assert wide.state.options.shading == "phong"
    wide.key("z", "ctrl shift")
    assert wide.state.options.shading == "scalar"


@pytest.mark.parametrize("name", SCALARS)
def test_scalar_range_is_that_of_the_vertices(wide, texts, name):
    wide.click("engine")
    wide.drag("Influences", 0.34, "Influences")
    assert _chosen(wide).max_influences == 2
    wide.state.options.scalar, wide.state.selected_joint = name, 0
    wide.click("Heat map")
    wide.step(2)
    actor = wide.state.actor
    joint = ":#0" if SCALARS[name].takes_joint else ""
    values = compute(f"{name}{joint}", actor.figure, actor.pose, _chosen(wide))
    low, high = wide.state.stats.scalar_range
    assert (low, high) == (values.min(), values.max())
    texts.clear()
    wide.step()
    shown = [text for text in texts if text.startswith("up to")]
    if SCALARS[name].unit != "length":
        assert not shown
        return
    assert shown and shown[0].endswith("mm in this pose")
    # Three digits, in millimetres.
    said = float(shown[0].split()[2].replace(",", ""))
    assert said == pytest.approx(1000 * high, rel=6e-3)
    # The model has no symmetry map, and its weights are scaled to 1 already.
    assert high > 0 or name in ("asymmetry", "normalized")


def test_scalar_range_follows_the_pose(wide):
    wide.state.options.scalar = "methods"
    wide.click("Heat map")
    wide.step(2)
    assert wide.state.stats.scalar_range[1] > 0
    wide.key("r")
    wide.step(2)
    assert wide.state.stats.scalar_range[1] == pytest.approx(0, abs=1e-12)


def test_legend_says_where_there_is_nothing_to_see(skinning, texts):
    # The tiny rig has two influences a vertex: four are as good as all.
    skinning.click("Heat map")
    skinning.step(2)
    texts.clear()
    skinning.step()
    assert "0 everywhere" in texts
    assert skinning.state.stats.scalar_range == (0.0, 0.0)


def test_lengths_without_a_unit_are_shares_of_the_size(skinning, texts):
    skinning.state.options.scalar = "methods"
    skinning.click("Heat map")
    skinning.step(2)
    texts.clear()
    skinning.step()
    assert "Distance LBS to DQS, % of the size" in texts
    actor = skinning.state.actor
    plain = replace(_chosen(skinning), method="lbs")
    values = compute("methods", actor.figure, actor.pose, plain)
    size = np.linalg.norm([0.4, 2.0, 0.4])  # of the column's box
    found = next(text for text in texts if text.startswith("up to"))
    assert float(found.split()[2]) == pytest.approx(100 * values.max() / size, rel=6e-3)


def test_heat_map_of_another_view_is_chosen_from_the_list(wide):
    wide.click("Heat map")
    for number, name in enumerate(SCALARS):
        wide.pick("##Heat map of", number)
        assert wide.state.options.scalar == name


def test_panel_of_a_lone_skeleton_says_so(drive, rig, texts):
    hand = drive(rig[0])
    hand.show_panel("Skinning")
    texts.clear()
    hand.step()
    assert "This figure has no skin that follows a skeleton." in texts
    assert "engine" not in hand.state.item_rects


def test_legend_of_joints_lists_them(wide, texts):
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


def test_weight_of_a_joint_is_that_of_the_selected_one(wide, texts):
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
    assert "no figure has a selected joint" in texts


def test_list_keeps_the_joint_of_the_command_line(wide):
    wide.state.options.scalar = "weight:#1"
    wide.click("Heat map")
    wide.step(2)
    assert wide.state.options.scalar == "weight:#1"


def test_picture_with_its_own_legend_has_no_second_one(wide, texts):
    wide.state.options.legend = True
    wide.click("Heat map")
    wide.step(2)
    texts.clear()
    wide.step()
    assert "Distance to few influences, mm" not in texts
    assert _legend_colours(wide) is not None  # drawn into the picture
