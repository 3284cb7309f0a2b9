"""The mouse in the view: orbit, pan, zoom, and no effect of the mouse over panels."""

import copy

import numpy as np
import pytest
from app.curves.plotted import clip_text
from app.posing_rigs import around, joint_seen

from viewer.app.core.view_frame import view_frame
from viewer.app.posing.gizmo import handle_at
from viewer.app.posing.posing import Posing
from viewer.app.posing.rotate_tool import RADIUS
from viewer.rendering.camera import camera_axes


def _aim(camera):
    return (*camera.target, camera.distance, camera.azimuth, camera.inclination)


def test_left_drag_orbits(hand):
    camera = hand.state.camera
    before = copy.deepcopy(camera)
    x, y = hand.middle
    hand.pull((x, y), (x + 50, y + 25))
    assert camera.azimuth == pytest.approx(before.azimuth - 20)
    assert camera.inclination == pytest.approx(before.inclination + 10)
    assert camera.distance == before.distance and (camera.target == before.target).all()


def test_drag_within_one_frame_orbits(hand):
    azimuth = hand.state.camera.azimuth
    x, y = hand.middle
    hand.move((x, y))
    hand.io.add_mouse_button_event(0, True)
    hand.io.add_mouse_pos_event(x + 50, y)
    hand.io.add_mouse_button_event(0, False)
    hand.step(4)
    assert hand.state.camera.azimuth == pytest.approx(azimuth - 20)


@pytest.mark.parametrize(("button", "held"), [(1, ""), (2, ""), (0, "shift")])
def test_pan_moves_the_target_with_the_pointer(hand, button, held):
    camera = hand.state.camera
    before = copy.deepcopy(camera)
    x, y = hand.middle
    hand.pull((x, y), (x + 64, y - 32), button, held)
    right, up, _ = camera_axes(camera)
    points = 2 * camera.half_height / hand.state.view_rect[3]  # scene units per point
    moved = camera.target - before.target
    assert moved @ right == pytest.approx(-64 * points)
    assert moved @ up == pytest.approx(-32 * points)
    assert (camera.azimuth, camera.distance) == (before.azimuth, before.distance)


def test_wheel_zooms_to_the_pointer(hand):
    camera = hand.state.camera
    x, y, width, height = hand.state.view_rect
    pointer = (round(x + 0.75 * width), round(y + 0.25 * height))

    def below_pointer():
        right, up, _ = camera_axes(camera)
        scale = 2 * camera.half_height / height
        across, upward = pointer[0] - x - width / 2, y + height / 2 - pointer[1]
        return camera.target + scale * (across * right + upward * up)

    point, distance = below_pointer(), camera.distance
    hand.wheel(3, pointer)
    assert camera.distance < distance
    assert below_pointer() == pytest.approx(point)
    hand.wheel(-6, pointer)
    assert camera.distance > distance
    assert below_pointer() == pytest.approx(point)


def test_wheel_before_any_mouse_position_leaves_a_finite_camera(hand):
    hand.io.add_mouse_pos_event(-3.4e38, -3.4e38)
    hand.io.add_mouse_wheel_event(0.0, 5.0)
    hand.step(3)
    hand.assert_sane()
    assert np.abs(hand.state.camera.target).max() < 10


@pytest.mark.parametrize("label", ["Attached skin", "joint arm", "Distance"])
def test_mouse_over_a_panel_leaves_the_camera(hand, label):
    before = _aim(hand.state.camera)
    x, y = hand.place(label, 0.9)
    hand.wheel(3, (x, y + 2))
    hand.pull((x, y), (x, y + 10), button=1)
    hand.pull((x, y), (x, y + 10), button=2)
    assert _aim(hand.state.camera) == before


def test_drag_that_begins_on_a_slider_never_orbits(hand):
    before = _aim(hand.state.camera)
    hand.pull("root.x", hand.middle)
    assert _aim(hand.state.camera) == before


def test_drag_that_begins_in_the_view_continues_over_panels(hand):
    before, pose = hand.state.camera.azimuth, hand.dofs()
    hand.pull(hand.middle, hand.place("root.x"))
    assert hand.state.camera.azimuth != before and (hand.dofs() == pose).all()


def test_mouse_moves_the_camera_in_the_area_of_hidden_panels(hand):
    hand.key("tab")
    before = hand.state.camera.azimuth
    hand.pull((40, 300), (90, 300))
    assert hand.state.camera.azimuth == pytest.approx(before - 20)


def test_orbit_stops_at_the_poles(hand):
    x, y = hand.middle
    hand.pull((x, y), (x, y + 3000))
    assert hand.state.camera.inclination == 90
    hand.pull((x, y), (x, y - 3000))
    assert hand.state.camera.inclination == -90


def test_repeated_zoom_keeps_values_finite(hand):
    for notches in (200, -400, 800):
        hand.wheel(notches, hand.middle)
        hand.assert_sane()


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
