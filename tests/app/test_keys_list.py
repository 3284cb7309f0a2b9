"""The shortcut list: complete columns at the usual text size, scrollable if they do not fit."""

import pytest
from imgui_bundle import imgui

from viewer.app.features import KEYS, MOUSE
from viewer.app.keys import Keyboard
from viewer.app.overlays import column_layout

N_LINES = len(KEYS) + len(MOUSE)


def listed(hand):
    hand.key("h")
    hand.step(3)
    return imgui.internal.find_window_by_name("##keys")


@pytest.mark.parametrize(
    ("room", "wanted"),
    [
        ((1000, 1000), (1, 50, True)),
        ((1000, 999), (2, 25, True)),
        ((800, 500), (2, 25, True)),
        ((1300, 400), (3, 17, True)),
        ((799, 500), (1, 50, False)),
        ((1199, 400), (2, 25, False)),
        ((100, 2000), (1, 50, False)),  # too narrow for one column
        ((10, 1), (1, 50, False)),
    ],
)
def test_list_uses_the_fewest_columns_that_fit(room, wanted):
    assert column_layout(50, room, (400.0, 20.0)) == wanted


@pytest.mark.parametrize("size", [(900, 1150), (1200, 700)])
def test_list_stays_within_the_window_and_takes_no_input(drive, rig, size):
    hand = drive(*rig, size=size, samples=1)
    window = listed(hand)
    assert window.pos.y >= 0 and window.pos.y + window.size.y <= size[1]
    assert window.pos.x >= 0 and window.pos.x + window.size.x <= size[0]
    assert window.scroll_max.y == window.scroll_max.x == 0
    distance = hand.state.camera.distance
    hand.wheel(3, hand.middle)
    assert hand.state.camera.distance < distance


def test_all_lines_are_shown_at_the_usual_size(drive, rig, texts):
    hand = drive(*rig, size=(1200, 700), samples=1)
    texts.clear()
    listed(hand)
    assert {key.text for key in KEYS} | {text for _, text in MOUSE} <= set(texts)


def test_wheel_scrolls_if_the_list_does_not_fit(drive, rig):
    hand = drive(*rig, size=(600, 300), samples=1)
    window = listed(hand)
    assert window.pos.y >= 0 and window.pos.y + window.size.y <= 300
    line = imgui.get_text_line_height_with_spacing()
    # The scroll range is the height of all lines minus the visible part.
    assert window.scroll_max.y == pytest.approx(N_LINES * line - window.size.y, abs=3 * line)
    distance = hand.state.camera.distance
    for _ in range(40):
        hand.wheel(-3, (window.pos.x + 40, window.pos.y + 40))
    assert window.scroll.y == window.scroll_max.y > 0
    assert hand.state.camera.distance == distance
    hand.key("escape")
    assert not hand.state.of(Keyboard).is_listed
