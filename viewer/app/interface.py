"""Drawing of the interface: menu, docked panels and overlays."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import imgui

from viewer.app.core.reasons import no_panel
from viewer.app.core.state import AppState
from viewer.app.features import PANELS, Panel, panel_module
from viewer.app.layout import Layout, bring_to_front, draw_dock, keep_fronts
from viewer.app.manual.manual_window import draw_manual
from viewer.app.menus import draw_menus
from viewer.app.message_window import draw_error, draw_message_window
from viewer.app.overlays import draw_overlays
from viewer.app.preferences.preferences_window import draw_preferences
from viewer.app.shown_panels import ShownPanels, is_open, set_open

__all__ = ["draw_interface"]


def draw_interface(state: AppState) -> list[Path]:
    """Draw everything except the scene; return files to open from a menu."""
    state.item_rects.clear()
    if state.panels_visible:
        chosen = draw_menus(state)
        dock = draw_dock(state)
        leading = ""
        for name, panel in PANELS.items():
            if is_open(state, name) and not no_panel(state, panel.needs):
                appears = _draw_panel(state, name, panel)
                leading = panel.title if appears and panel.leads else leading
        for fronts in (state.of(Layout).fronts, state.of(ShownPanels).fronts):
            for title in fronts:
                bring_to_front(title)
            fronts.clear()
        if leading:
            # Set after the panels are drawn: a menu that closes brings another panel to the front.
            bring_to_front(leading)
        node = imgui.internal.dock_builder_get_central_node(dock)
        state.view_rect = (node.pos.x, node.pos.y, node.size.x, node.size.y)
    else:
        chosen = []
        keep_fronts(state.of(Layout))
        viewport = imgui.get_main_viewport()
        state.view_rect = (viewport.pos.x, viewport.pos.y, viewport.size.x, viewport.size.y)
    draw_overlays(state)
    draw_message_window(state)
    draw_manual(state)
    draw_preferences(state)
    draw_error(state)
    return chosen


def _dock_of_neighbour(panel: Panel) -> int:
    """Return the dock node of another panel with the same initial dock, or 0 if none is docked."""
    for other in PANELS.values():
        window = None
        if other.place == panel.place and other is not panel:
            window = imgui.internal.find_window_by_name(other.title)
        if window is not None and window.dock_id:
            return int(window.dock_id)
    return 0


def _draw_panel(state: AppState, name: str, panel: Panel) -> bool:
    """Draw one panel; return whether it has just appeared."""
    # A panel that appears together with a figure must not cover other panels.
    is_quiet = panel.needs and not panel.leads
    flags = imgui.WindowFlags_.no_focus_on_appearing if is_quiet else imgui.WindowFlags_.none
    neighbour = _dock_of_neighbour(panel)
    if neighbour:
        # A panel that is missing from the stored layout would float over the other panels.
        imgui.set_next_window_dock_id(neighbour, imgui.Cond_.first_use_ever)
    shown, stays = imgui.begin(panel.title, True, flags)
    appears = imgui.is_window_appearing()
    if shown:
        panel_module(name).draw(state)
    imgui.end()
    if not stays:
        set_open(state, name, False)
    return appears
