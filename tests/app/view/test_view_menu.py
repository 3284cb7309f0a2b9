"""The View menu, its keys, and the check boxes of the Display panel."""

import pytest

from viewer.app.view.display_panel import JOINT_TOGGLES
from viewer.app.weights.weights_panel import Weights

KEYS = {"xray": ("b", ""), "joint_names": ("j", ""), "joint_axes": ("j", "shift")}


@pytest.mark.parametrize("name", JOINT_TOGGLES)
def test_menu_and_key_toggle_joint_display(hand, name):
    text, _ = JOINT_TOGGLES[name]
    before = hand.scene_picture()
    hand.menu("menu View", text)
    assert getattr(hand.state.options, name) and hand.says(f"{text} on")
    hand.step(2)
    assert (hand.scene_picture() != before).any()
    assert hand.undo_steps == 1
    key, held = KEYS[name]
    hand.key(key, held)
    hand.step(2)
    assert not getattr(hand.state.options, name) and hand.says(f"{text} off")
    assert (hand.scene_picture() == before).all()


def test_display_panel_has_the_same_check_boxes(drive, rig):
    hand = drive(*rig, size=(1000, 1000), samples=1)
    for short, name in (("X-ray", "xray"), ("Names", "joint_names"), ("Axes", "joint_axes")):
        hand.click(f"{short}###{name}")
        assert getattr(hand.state.options, name)


def test_menu_turns_the_heat_map_on_and_off(hand):
    hand.click(hand.place("joint arm", 0.5))
    hand.menu("menu View", "Weights of the selected joint")
    assert (hand.state.options.shading, hand.state.options.scalar) == ("scalar", "weight")
    assert hand.says("Weights of arm")
    hand.menu("menu View", "Weights of the selected joint")
    assert hand.state.options.shading == "auto"


def test_menu_toggles_picking_of_vertices(hand):
    hand.menu("menu View", "Pick vertices")
    assert hand.state.of(Weights).picks_vertices and hand.says("Clicks pin vertices")
    hand.menu("menu View", "Pick vertices")
    assert not hand.state.of(Weights).picks_vertices


def test_joint_display_is_greyed_without_a_skeleton(drive, rig):
    hand = drive(rig[1])
    for text in ("X-ray", "Joint names", "Joint axes", "Unpin vertex"):
        hand.menu("menu View", text)
        hand.key("escape")
    assert not hand.state.options.xray and not hand.state.options.joint_names


def test_vertex_display_is_greyed_without_a_skin(drive, rig):
    lone = drive(rig[0])
    for text in ("Weights of the selected joint", "Pick vertices", "Inspect vertex under cursor"):
        lone.menu("menu View", text)
        lone.key("escape")
    assert lone.state.options.shading == "auto" and not lone.state.of(Weights).picks_vertices
