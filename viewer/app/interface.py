"""Layout and drawing of the interface: menu, docked panels and overlays."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import imgui

from viewer.app.core.reasons import no_panel
from viewer.app.core.state import AppState
from viewer.app.features import PANELS, Panel, panel_module
from viewer.app.manual.manual_window import draw_manual
from viewer.app.menus import draw_menus
from viewer.app.message_window import draw_error, draw_message_window
from viewer.app.overlays import draw_overlays
from viewer.app.shown_panels import ShownPanels, is_open, set_open

__all__ = ["draw_interface"]

_DOCK = "viewer dock"
_LEFT, _RIGHT = (0.235, 0.30, 14.0), (0.27, 0.36, 17.0)
"""Default and largest fraction of the window's width, and the minimum width in font sizes."""
_BOTTOM, _LOWEST = 0.2, 10.0
"""Fraction of the window's height for bottom panels, and the minimum height in font sizes."""


def draw_interface(state: AppState) -> list[Path]:
    """Draw everything but the scene; return files to open from a menu."""
    state.item_rects.clear()
    if state.panels_visible:
        chosen = draw_menus(state)
        dock = _draw_dock(state)
        leading = ""
        for name, panel in PANELS.items():
            if is_open(state, name) and not no_panel(state, panel.needs):
                appears = _draw_panel(state, name, panel)
                leading = panel.title if appears and panel.leads else leading
        if leading:
            # Set after the panels are drawn: a menu that closes brings another panel to the front.
            imgui.set_window_focus(leading)
        node = imgui.internal.dock_builder_get_central_node(dock)
        state.view_rect = (node.pos.x, node.pos.y, node.size.x, node.size.y)
    else:
        chosen = []
        viewport = imgui.get_main_viewport()
        state.view_rect = (viewport.pos.x, viewport.pos.y, viewport.size.x, viewport.size.y)
    draw_overlays(state)
    draw_message_window(state)
    draw_manual(state)
    draw_error(state)
    return chosen


def _draw_dock(state: AppState) -> int:
    """Draw the dock space, with the default layout if none was stored."""
    shown = state.of(ShownPanels)
    dock = imgui.get_id(_DOCK)
    is_new = imgui.internal.dock_builder_get_node(dock) is None
    if is_new or shown.wants_reset:
        _build_layout(dock)
        shown.wants_reset = False
        shown.closed.clear()
        shown.opened.clear()
    flags = imgui.DockNodeFlags_.passthru_central_node
    flags |= imgui.DockNodeFlags_.no_docking_over_central_node
    imgui.dock_space_over_viewport(dock, imgui.get_main_viewport(), flags)
    return dock


def _build_layout(dock: int) -> None:
    builder = imgui.internal
    builder.dock_builder_remove_node(dock)
    builder.dock_builder_add_node(dock, imgui.internal.DockNodeFlagsPrivate_.dock_space)
    builder.dock_builder_set_node_size(dock, imgui.get_main_viewport().size)
    left_part, right_part = _fraction(_LEFT), _fraction(_RIGHT)
    height = imgui.get_main_viewport().size.y
    fraction = min(max(_BOTTOM, _LOWEST * imgui.get_font_size() / max(height, 1.0)), 0.4)
    whole = builder.dock_builder_split_node(dock, imgui.Dir.down, fraction)
    split = builder.dock_builder_split_node(whole.id_at_opposite_dir, imgui.Dir.left, left_part)
    left, rest = split.id_at_dir, split.id_at_opposite_dir
    fraction = right_part / (1.0 - left_part)
    right = builder.dock_builder_split_node(rest, imgui.Dir.right, fraction).id_at_dir
    middle = builder.dock_builder_split_node(right, imgui.Dir.down, 0.64)
    bottom = builder.dock_builder_split_node(middle.id_at_dir, imgui.Dir.down, 0.48)
    places = {
        "left": left,
        "bottom": whole.id_at_dir,
        "right 1": middle.id_at_opposite_dir,
        "right 2": bottom.id_at_opposite_dir,
        "right 3": bottom.id_at_dir,
    }
    for panel in PANELS.values():
        builder.dock_builder_dock_window(panel.title, places[panel.place])
    builder.dock_builder_finish(dock)


def _fraction(side: tuple[float, float, float]) -> float:
    """Return a side's fraction of the width: the default, or more if the window is narrow."""
    usual, largest, wanted = side
    width = max(imgui.get_main_viewport().size.x, 1.0)
    return max(usual, min(largest, wanted * imgui.get_font_size() / width))


def _dock_of_neighbour(panel: Panel) -> int:
    """Return the dock node of another panel with the same place, 0 if none is docked."""
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
        # A panel that is missing from the stored layout would float over the others.
        imgui.set_next_window_dock_id(neighbour, imgui.Cond_.first_use_ever)
    shown, stays = imgui.begin(panel.title, True, flags)
    appears = imgui.is_window_appearing()
    if shown:
        # Labels are to the right of their widgets and must not be clipped.
        imgui.push_item_width(-7.5 * imgui.get_font_size())
        panel_module(name).draw(state)
        imgui.pop_item_width()
    imgui.end()
    if not stays:
        set_open(state, name, False)
    return appears
