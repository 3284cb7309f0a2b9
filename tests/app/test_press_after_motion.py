"""Pointer motion and press between two frames, where the motion before the press is not a drag.
Remote desktops, tablets and slow machines deliver both together.
"""

import copy

import numpy as np
import pytest
from app.curves.plotted import clip_text
from app.posing_rigs import around, joint_seen

from viewer.app.core.view_frame import view_frame
from viewer.app.posing.gizmo import handle_at
from viewer.app.posing.posing import Posing
from viewer.app.posing.rotate_tool import RADIUS


@pytest.fixture(params=[True, False], ids=["trickled", "at once"])
def spread(request):
    """Whether ImGui spreads quick input over several frames; ``leap`` sets it."""
    return request.param


def leap(hand, place, button=0, spread=True):
    """Move and press within one frame, after the pointer has rested elsewhere."""
    hand.io.config_input_trickle_event_queue = spread
    hand.io.add_mouse_pos_event(*place)
    hand.press(button)
    hand.step(2)


def _aim(camera):
    return (*camera.target, camera.distance, camera.azimuth, camera.inclination)


@pytest.mark.parametrize(("button", "held"), [(0, ""), (1, ""), (2, ""), (0, "shift")])
def test_press_after_a_pointer_jump_leaves_the_camera(hand, spread, button, held):
    x, y = hand.middle
    hand.move((x - 100, y - 80))
    before = _aim(hand.state.camera)
    with hand.holding(held):
        leap(hand, (x + 100, y + 80), button, spread)
        assert _aim(hand.state.camera) == before
        hand.let_go(button)
    hand.step(2)
    assert _aim(hand.state.camera) == before


def test_drag_after_a_pointer_jump_starts_at_the_press_position(hand, spread):
    x, y = hand.middle
    hand.move((x - 100, y - 80))
    azimuth, inclination = hand.state.camera.azimuth, hand.state.camera.inclination
    leap(hand, (x, y), 0, spread)
    hand.move((x + 50, y + 25))
    hand.let_go()
    # 0.4 degrees per point
    assert hand.state.camera.azimuth == pytest.approx(azimuth - 20)
    assert hand.state.camera.inclination == pytest.approx(inclination + 10)


def test_second_button_pressed_in_a_drag_does_not_stop_it(hand):
    x, y = hand.middle
    hand.move((x, y))
    before = copy.deepcopy(hand.state.camera)
    hand.press(0)
    leap(hand, (x + 50, y), 1)
    assert hand.state.camera.azimuth == pytest.approx(before.azimuth - 20)
    assert hand.state.camera.target == pytest.approx(before.target)


def test_splitter_follows_the_pointer_from_the_press_position(hand, spread):
    x, y, width, height = hand.state.view_rect
    before = _aim(hand.state.camera)
    hand.move((x + width / 2, y + height / 2))
    leap(hand, (x - 1, y + height / 2), 0, spread)
    assert hand.state.view_rect[0] == x
    hand.move((x + 29, y + height / 2))
    hand.let_go()
    hand.step(2)
    assert hand.state.view_rect[0] == x + 30
    assert _aim(hand.state.camera)[4:] == before[4:]


def test_curve_plot_does_not_move_on_press(drive, rig, tmp_path, spread):
    (tmp_path / "wave.anim").write_text(clip_text())
    hand = drive(*rig, tmp_path / "wave.anim", size=(1280, 860), samples=1)
    hand.show_panel("Curves")
    hand.state.selected_joint = 1
    hand.step(3)
    hand.click("curve arm.x")
    hand.step(3)
    x0, y0, x1, _ = hand.state.item_rects["plot"]
    hand.move((x0 + 30, y0 + 5))
    before = hand.state.item_rects["key arm.x 0"]
    leap(hand, (x1 - 60, y0 + 5), 0, spread)
    assert hand.state.item_rects["key arm.x 0"] == pytest.approx(before)
    hand.move((x1 - 80, y0 + 5))
    hand.step(2)
    assert hand.state.item_rects["key arm.x 0"][0] == pytest.approx(before[0] - 20, abs=0.5)


def test_joint_handle_rotates_from_the_press_position(hand, spread):
    hand.state.selected_joint = 1
    hand.key("e")
    hand.step(2)
    x, y, _width, height = hand.state.view_rect
    hand.move((x + 20, y + height - 60))
    pose = hand.dofs()
    place = _ring(hand)
    leap(hand, place, 0, spread)
    assert hand.state.of(Posing).drag is not None and (hand.dofs() == pose).all()
    hand.let_go()
    assert (hand.dofs() == pose).all()


def _ring(hand):
    """Return a position on a ring of the Rotate tool."""
    frame = view_frame(hand.state)
    center = joint_seen(hand, hand.state.selected_joint)
    places = around(center, RADIUS, 0.0, 2.0 * np.pi, 36)
    return next(place for place in places if handle_at(hand.state, frame, place) is not None)
