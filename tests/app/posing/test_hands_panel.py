"""Panels of poses of hands and of captured points."""

import numpy as np
import pytest
from app.captured import NAMES, dots
from builders import family_figure
from imgui_bundle import imgui
from numpy.testing import assert_allclose

from viewer.app.layout import ShownPanels
from viewer.app.posing.posing import Posing
from viewer.rigs.geometry.rotation import matrix_to_rotation_vector
from viewer.rigs.pose import joint_rotations
from viewer.rigs.scene import Actor, Scene


@pytest.fixture
def hand(drive, tmp_path):
    scene = Scene([Actor(family_figure("smplx", tmp_path))])
    driver = drive(scene=scene, size=(1280, 800))
    driver.state.of(ShownPanels).closed |= {"joints", "shape"}
    driver.step(3)
    return driver


def vectors(driver, which):
    actor = driver.state.actor
    rotations = joint_rotations(actor.figure.skeleton, actor.pose)
    return matrix_to_rotation_vector(rotations[actor.figure.hands[which].joints]).ravel()


def test_mean_hand_is_that_of_the_file_and_flat_hand_is_zero(hand):
    left = hand.state.actor.figure.hands[0]
    hand.click("left mean")
    assert_allclose(vectors(hand, 0), left.mean, atol=1e-12)
    assert not vectors(hand, 1).any()
    hand.click("left flat")
    assert_allclose(vectors(hand, 0), 0.0, atol=1e-12)


def test_component_slider_adds_its_row_to_the_rotation_vectors(hand):
    right = hand.state.actor.figure.hands[1]
    hand.click("right mean")
    hand.drag("right component 2", 0.6)
    change = vectors(hand, 1) - right.mean
    row = right.components[2]
    share = change @ row / (row @ row)
    assert share > 0.1
    assert_allclose(change, share * row, atol=1e-9)
    hand.key("z", "ctrl")
    assert_allclose(vectors(hand, 1), right.mean, atol=1e-12)


def test_number_of_components_is_the_number_of_sliders(hand):
    assert "left component 5" in hand.state.item_rects
    assert "left component 6" not in hand.state.item_rects
    hand.state.of(Posing).n_hand_components = 12
    hand.step(2)
    assert "left component 11" in hand.state.item_rects


def test_figures_without_hands_have_no_hands_panel(drive):
    driver = drive(size=(1000, 640))
    assert not any("component" in label for label in driver.state.item_rects)
    assert np.size(driver.state.actor.figure.hands) == 0


@pytest.fixture
def points(drive):
    """A test driver on four points; in frame 1 they have lower confidences."""
    return drive(scene=Scene([dots([0.9, 0.05, 0.0, 0.5])]), size=(1000, 900), samples=1)


def at_frame(hand, frame, texts):
    hand.state.clock.seek(frame / 10.0)
    hand.step(2)
    texts.clear()
    hand.step(1)


def test_panel_describes_the_points(points, texts):
    at_frame(points, 0, texts)
    assert "4 captured points (face4), not a skeleton: there are no joints to rotate." in texts
    assert "4 detected at this time." in texts
    assert not any("open its .skel" in text for text in texts)


def test_panel_lists_names_and_current_confidence(points, texts, monkeypatch):
    bars = []
    draw = imgui.progress_bar

    def bar(share, size, text):
        bars.append((round(share, 3), text))
        draw(share, size, text)

    monkeypatch.setattr(imgui, "progress_bar", bar)
    at_frame(points, 1, texts)
    assert [text for text in texts if text in NAMES] == list(NAMES)
    assert bars[-3:] == [(0.9, "0.9"), (0.05, "0.05"), (0.5, "0.5")]
    assert texts.count("not detected") == 1
    assert "3 detected at this time, 1 of them with confidence below 0.1 and not drawn." in texts


def test_undetected_points_are_shown_as_undetected(points, texts):
    points.state.clock.mode = "run on"
    at_frame(points, 9, texts)
    assert "Absent at this time." in texts and texts.count("not detected") == 4


def test_filter_lists_points_by_name(points, texts):
    points.click("Filter")
    points.type("eye")
    points.step(1)
    listed = {label for label in points.state.item_rects if label.startswith("point ")}
    assert listed == {"point left_eye", "point right_eye"}
