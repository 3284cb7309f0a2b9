"""Mesh parts in the window, hidden in their panel or by a right click, and shown again by undo."""

from dataclasses import replace

import numpy as np
import pytest

import viewer
from viewer.app.context_menu import ContextMenu
from viewer.app.core.reasons import no_panel
from viewer.rig.scene import Actor, Scene


@pytest.fixture
def parts(drive, rig):
    """A test driver on the tiny column, which has three parts: lid, foot and walls."""
    figure = viewer.load(*rig).actors[0].figure
    listed = np.array([0, 0, 1, 1, *[2] * 16])
    mesh = replace(figure.mesh, parts=("lid", "", "walls"), triangle_parts=listed)
    hand = drive(scene=Scene([Actor(replace(figure, mesh=mesh))]), size=(1000, 1000))
    hand.show_panel("Parts")
    hand.step(3)
    return hand


def test_check_boxes_hide_parts_and_undo_shows_them(parts):
    actor = parts.state.actor
    parts.click("part 2")
    parts.click("part 0")
    assert actor.hidden_parts == {0, 2}
    parts.key("z", "ctrl")
    assert actor.hidden_parts == {2}
    parts.click("Invert")
    assert actor.hidden_parts == {0, 1}
    parts.click("Show all")
    assert not actor.hidden_parts
    parts.click("part 1", button=1)
    parts.step(2)
    parts.click("Show only this part")
    assert actor.hidden_parts == {0, 2}


def test_right_click_hides_the_part_under_the_pointer(parts):
    parts.click(parts.middle, button=1)
    parts.step(3)
    assert parts.state.of(ContextMenu).spot.part == 2
    parts.click("Hide part")
    assert parts.state.actor.hidden_parts == {2}
    parts.key("z", "ctrl")
    assert not parts.state.actor.hidden_parts


def test_panel_requires_several_parts(hand):
    assert no_panel(hand.state, "parts") == "this figure has only one part"
