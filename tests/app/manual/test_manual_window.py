"""The manual window: opened from the menu, read, and closed."""

import pytest
from imgui_bundle import imgui, rich_md

from viewer.app.manual import Manual
from viewer.manual import PAGES, page_text


def shown(hand) -> str:
    return hand.state.of(Manual).topic


def headings() -> list[str]:
    """Return the headings of the page that was drawn last."""
    return [heading.text for heading in rich_md.last_render_headings()]


def written(topic: str) -> list[str]:
    """Return the headings in a page's text, without its code."""
    prose = "".join(page_text(topic).split("```")[::2])
    lines = [line.lstrip("# ") for line in prose.splitlines() if line.startswith("#")]
    return [line.replace("`", "") for line in lines]


def test_pages_open_from_the_menu_and_the_list(drive, rig):
    hand = drive(*rig, size=(1000, 640), samples=1)
    hand.menu("menu Help", "menu Manual", "Captures##page captures")
    assert shown(hand) == "captures" and headings() == written("captures")
    hand.click("page keys")
    hand.step(2)
    assert shown(hand) == "keys" and headings() == written("keys")


@pytest.mark.parametrize("size", [(900, 640), (300, 200)])
def test_every_page_is_drawn_inside_the_window(drive, rig, size):
    hand = drive(*rig, size=size, samples=1)
    for topic in PAGES:
        hand.state.of(Manual).topic = topic
        hand.step(2)
        window = imgui.internal.find_window_by_name("Manual")
        assert headings() == written(topic)
        assert window.active and window.size.x <= size[0] and window.size.y <= size[1]
    assert set(hand.state.of(Manual).pages) == set(PAGES) and not hand.state.error


def test_escape_closes_only_the_manual_window(drive, rig):
    hand = drive(*rig, size=(1000, 640), samples=1)
    hand.state.selected_joint = 1
    hand.state.of(Manual).topic = "motion"
    hand.step(2)
    hand.key("escape")
    assert shown(hand) == "" and hand.state.selected_joint == 1


def test_escape_closes_the_manual_after_a_click_on_its_code(drive, rig):
    hand = drive(*rig, size=(1000, 640), samples=1)
    hand.state.of(Manual).topic = "pictures"
    hand.step(2)
    window = imgui.internal.find_window_by_name("Manual")
    hand.click((window.pos.x + 0.5 * window.size.x, window.pos.y + 160))
    hand.key("escape")
    assert shown(hand) == ""


def test_missing_page_shows_a_message(drive, rig, monkeypatch, tmp_path):
    monkeypatch.setattr("viewer.resources._PACKAGE", tmp_path / "viewer")
    hand = drive(*rig, size=(1000, 640), samples=1)
    hand.state.of(Manual).topic = "motion"
    hand.step(2)
    assert "lacks manual/motion.md" in hand.state.error and shown(hand) == ""
