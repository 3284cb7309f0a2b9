"""Open panels: most are open until closed, the others open only on request."""

from imgui_bundle import imgui

from viewer.app.layout import PANELS, ShownPanels, is_open, set_open


def test_panels_on_demand_are_closed_at_first(hand):
    state = hand.state
    assert "lint" in PANELS and PANELS["lint"].on_demand
    for name, panel in PANELS.items():
        assert is_open(state, name) == (not panel.on_demand)


def test_panels_open_and_close(hand):
    state = hand.state
    for name in ("lint", "stats"):
        for opened in (True, True, False, False, True):
            set_open(state, name, opened)
            assert is_open(state, name) == opened
    assert state.of(ShownPanels).opened == {"lint"} and not state.of(ShownPanels).closed


def test_tab_close_button_closes_a_panel_on_demand(hand):
    set_open(hand.state, "lint", True)
    hand.step(4)
    assert "Check" in hand.state.item_rects or "Recheck" in hand.state.item_rects
    tab = imgui.internal.find_window_by_name("Lint").dc.dock_tab_item_rect
    hand.click((tab.max.x - 12, 0.5 * (tab.min.y + tab.max.y)))
    hand.step(3)
    assert not hand.state.of(ShownPanels).opened and not hand.state.of(ShownPanels).closed
