"""The Skinning panel: method, influence limit, normalising."""

import numpy as np
import pytest

from viewer.rigs.scalars import compute
from viewer.rigs.skinning import Skinning


@pytest.fixture
def skinning(drive, rig):
    """A test driver on the Skinning panel of the tiny rig in a bent and rotated pose."""
    hand = drive(*rig, size=(1000, 1000), samples=1)
    dofs = hand.dofs()
    dofs[hand.dof_index("arm.x")], dofs[hand.dof_index("arm.y")] = 1.0, 2.0
    return _posed(hand, dofs)


@pytest.fixture
def wide(drive_body):
    """A test driver on the Skinning panel of a posed body with many influences per vertex."""
    hand = drive_body("smpl", n_vertices=96)
    return _posed(hand, 0.8 * np.sin(np.arange(len(hand.dofs()))))


def _posed(hand, dofs):
    """Show the panel of a figure with this initial pose."""
    hand.show_panel("Skinning")
    hand.state.actor.pose.dofs[:] = dofs
    hand.state.history.start(hand.state.update_version(), hand.state.clock.time)
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


def test_blend_slider_mixes_both_methods(skinning):
    for label in ("LBS", "DQS"):
        skinning.click(label)
        skinning.drag("DQS fraction", 0.25)
        assert _chosen(skinning).method == "mix"
        assert _chosen(skinning).blend_factor == pytest.approx(0.25, abs=0.02)


def test_blend_drag_is_one_undo_step(skinning):
    skinning.drag("DQS fraction", 0.75)
    assert skinning.undo_steps == 1
    skinning.key("z", "ctrl")
    assert _chosen(skinning) == Skinning()
    skinning.key("z", "ctrl shift")
    assert _chosen(skinning).method == "mix"
    assert _chosen(skinning).blend_factor == pytest.approx(0.75, abs=0.02)


def test_typed_blend_factor_is_clamped(skinning):
    for text in ("7", "-3", "nan", "1e39", ""):
        skinning.click("Mixed")
        skinning.enter_value("DQS fraction", text)
        assert 0.0 <= _chosen(skinning).blend_factor <= 1.0
    assert skinning.scene_picture().any()


def test_engine_box_limits_to_four_influences_and_back(wide):
    wide.click("engine")
    assert _chosen(wide).max_influences == 4
    wide.click("engine")
    assert _chosen(wide).max_influences == 0
    assert wide.undo_steps == 2


def test_influences_slider_acts_only_with_the_box_checked(wide):
    wide.drag("Influences", 0.0)
    assert _chosen(wide).max_influences == 0
    whole = wide.scene_picture()
    wide.click("engine")
    steps = wide.undo_steps
    wide.drag("Influences", 0.0)
    assert _chosen(wide).max_influences == 1 and wide.undo_steps == steps + 1
    assert (wide.scene_picture() != whole).any()
    wide.drag("Influences", 1.0)
    assert _chosen(wide).max_influences == 4  # no vertex of this model has more influences


def test_normalise_box_is_one_undo_step_and_is_greyed_while_influences_are_limited(skinning):
    skinning.click("Normalise weights")
    assert _chosen(skinning).normalize and skinning.undo_steps == 1
    skinning.click("Normalise weights")
    assert not _chosen(skinning).normalize
    skinning.click("engine")
    skinning.click("Normalise weights")
    assert not _chosen(skinning).normalize


def test_normalising_scales_the_drawn_weights(drive, rig):
    text = rig[1].read_text().replace("2 0 0.5 1 0.5", "2 0 0.25 1 0.25")
    rig[1].write_text(text)
    hand = drive(*rig, size=(1000, 1000), samples=1)
    hand.show_panel("Skinning")
    stored = hand.scene_picture()
    hand.click("Normalise weights")
    assert (hand.scene_picture() != stored).any()
    # Halved weights move the middle square from a height of 1 m to half of that, 0.5 m lower.
    hand.state.actor.pose.dofs[:] = 0
    values = compute("normalized", hand.state.actor.figure, hand.state.actor.pose, Skinning())
    half = 0.5 * np.linalg.norm([0.2, 1.0, 0.2])
    np.testing.assert_allclose(values, [0] * 4 + [half] * 4 + [0] * 4, atol=1e-12)


def test_panel_of_a_skeleton_without_a_skin_shows_a_message(drive, rig, texts):
    hand = drive(rig[0])
    hand.show_panel("Skinning")
    texts.clear()
    hand.step()
    assert any(text.startswith("This figure has no skin attached") for text in texts)
    assert "engine" not in hand.state.item_rects
