"""The Joints panel of captured keypoints: description, names and confidences."""

import pytest
from app.captured import NAMES, dots
from imgui_bundle import imgui

from viewer.rig.scene import Scene


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
