"""The axis gizmo: a click rotates the camera to an axis in a fifth of a second; a drag orbits."""

import numpy as np
import pytest

from viewer.app.view.axis_gizmo import AxisGizmo
from viewer.app.view.camera_panel import fly_to
from viewer.app.view.flight import Flight
from viewer.rendering.camera import VIEWS, camera_axes

ARM = 31.0  # points


@pytest.fixture
def seen(drive, rig):
    """A test driver on a window with the camera between the axes."""
    hand = drive(*rig, size=(1000, 640), pixels_per_point=1.0)
    hand.state.camera.azimuth, hand.state.camera.inclination = 35.0, 25.0
    hand.step(2)
    return hand


def end_of(hand, axis, sign=1):
    """Return the window position of an axis end; the camera sees x to the right and y up."""
    x, y = hand.place("axis gizmo")
    right, up, _ = camera_axes(hand.state.camera)
    return x + sign * ARM * right[axis], y - sign * ARM * up[axis]


def backward(hand):
    return camera_axes(hand.state.camera)[2]


def test_click_on_an_axis_end_looks_from_there(seen):
    camera = seen.state.camera
    opened = camera.azimuth, camera.inclination
    for axis, sign in ((0, 1), (1, 1), (2, 1), (0, -1), (1, -1), (2, -1)):
        camera.azimuth, camera.inclination = opened
        seen.click(end_of(seen, axis, sign))
        assert seen.state.of(Flight).is_active
        seen.step(12)
        assert not seen.state.of(Flight).is_active
        np.testing.assert_allclose(backward(seen), sign * np.eye(3)[axis], atol=1e-12)
        assert seen.undo_steps == 0


def test_second_click_looks_from_the_opposite_side(seen):
    seen.key("_1")
    seen.step(15)
    seen.click(end_of(seen, 2))
    seen.step(15)
    assert (seen.state.camera.azimuth, seen.state.camera.inclination) == VIEWS["back"]


def test_camera_moves_gradually_and_fits_the_view_after_its_move(seen):
    seen.key("f")
    angles = []
    seen.menu("menu View", "Left view")
    for _ in range(14):
        angles.append(seen.state.camera.azimuth)
        seen.step()
    assert angles == sorted(angles) and len({*angles}) > 5 and angles[-1] == 90.0
    assert seen.state.framing.is_fitting


def test_orbiting_stops_a_camera_move(seen):
    fly_to(seen.state, "left")
    x, y = seen.middle
    seen.pull((x, y), (x + 40, y))
    seen.step(15)
    assert seen.state.camera.azimuth < 80.0


def test_drag_orbits_twice_as_fast_as_in_the_view(seen):
    x, y = seen.place("axis gizmo")
    seen.pull((x, y), (x + 20, y - 10))
    assert seen.state.camera.azimuth == pytest.approx(35.0 - 18.0)
    assert seen.state.camera.inclination == pytest.approx(25.0 - 9.0)


def test_gizmo_click_selects_nothing_and_hiding_panels_hides_the_gizmo(seen):
    seen.state.selected_joint = 1
    seen.click(seen.place("axis gizmo"))
    assert seen.state.selected_joint == 1
    seen.key("tab")
    seen.step(2)
    assert "axis gizmo" not in seen.state.item_rects


def test_gizmo_follows_the_up_axis(seen):
    seen.state.camera.up = "z"
    seen.step(2)
    # z points up for every camera position.
    assert end_of(seen, 2)[1] < seen.place("axis gizmo")[1] - 20
    seen.click(end_of(seen, 2))
    seen.step(15)
    np.testing.assert_allclose(backward(seen), [0, 0, 1], atol=1e-12)


def test_gizmo_is_drawn_into_the_window_but_not_into_pictures(seen):
    x0, y0, x1, y1 = (round(side) for side in seen.state.item_rects["axis gizmo"])
    with_gizmo, picture = seen.screen()[y0:y1, x0:x1], seen.scene_picture()
    seen.menu("menu View", "Axis gizmo")
    assert not seen.state.of(AxisGizmo).is_shown
    assert (seen.screen()[y0:y1, x0:x1] != with_gizmo).any(axis=-1).mean() > 0.1
    assert (seen.scene_picture() == picture).all()
