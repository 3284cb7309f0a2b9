"""The mouse in the view: orbit, pan, zoom, and no effect of the mouse over panels."""

import copy

import numpy as np
import pytest

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
