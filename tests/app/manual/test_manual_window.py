"""The manual window: opened from the menu, read, and closed."""

import pytest
from imgui_bundle import imgui

from viewer.app.manual import Manual
from viewer.manual import PAGES


def shown(hand) -> str:
    return hand.state.of(Manual).topic


def test_pages_open_from_the_menu_and_the_list(drive, rig, texts) -> None:
    hand = drive(*rig, size=(1000, 640), samples=1)
    hand.menu("menu Help", "menu Manual", "Captures##page captures")
    assert shown(hand) == "captures"
    assert any(text.startswith("A person is identified by id") for text in texts)
    texts.clear()
    hand.click("page keys")
    hand.step(2)
    assert shown(hand) == "keys" and "reset the pose to the file's pose" in texts


@pytest.mark.parametrize("size", [(900, 640), (300, 200)])
def test_every_page_is_drawn_inside_the_window(drive, rig, size) -> None:
    hand = drive(*rig, size=size, samples=1)
    for topic in PAGES:
        hand.state.of(Manual).topic = topic
        hand.step(2)
        window = imgui.internal.find_window_by_name("Manual")
        assert window.active and window.size.x <= size[0] and window.size.y <= size[1]
    assert set(hand.state.of(Manual).pages) == set(PAGES) and not hand.state.error


def test_escape_closes_only_the_manual_window(drive, rig) -> None:
    hand = drive(*rig, size=(1000, 640), samples=1)
    hand.state.selected_joint = 1
    hand.state.of(Manual).topic = "motion"
    hand.step(2)
    hand.key("escape")
    assert shown(hand) == "" and hand.state.selected_joint == 1


def test_missing_page_shows_a_message(drive, rig, monkeypatch, tmp_path) -> None:
    monkeypatch.setattr("viewer.resources._PACKAGE", tmp_path / "viewer")
    hand = drive(*rig, size=(1000, 640), samples=1)
    hand.state.of(Manual).topic = "motion"
    hand.step(2)
    assert "lacks manual/motion.md" in hand.state.error and shown(hand) == ""
