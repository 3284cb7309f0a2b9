"""Drawing of the interface: menu, docked panels and overlays."""

from __future__ import annotations

from collections.abc import Mapping

from imgui_bundle import imgui

from viewer.app.core.messages import message_line
from viewer.app.core.reasons import no_panel
from viewer.app.core.state import AppState
from viewer.app.core.theme import ERROR, text_color
from viewer.app.core.widgets import (
    begin_dialog,
    begin_window,
    button,
    checkbox,
    explain,
    same_line_if_room,
)
from viewer.app.features import KEYS
from viewer.app.layout import (
    Layout,
    Panel,
    ShownPanels,
    all_panels,
    bring_to_front,
    draw_dock,
    draw_panel,
    is_open,
    keep_fronts,
    set_open,
)
from viewer.app.manual import draw_manual
from viewer.app.menus import draw_menus
from viewer.app.overlays import draw_overlays
from viewer.app.preferences.preferences_window import draw_preferences
from viewer.phrases import printable

_SIZE = (42.0, 22.0)  # initial size of the window, in font sizes
_LONGEST = 1000  # maximum length of a message in characters


def draw_interface(state: AppState) -> None:
    """Draw everything except the scene."""
    state.item_rects.clear()
    if state.panels_visible:
        draw_menus(state)
        dock = draw_dock(state)
        leading = ""
        panels = all_panels()
        for name, panel in panels.items():
            if is_open(state, name) and not no_panel(state, panel.needs):
                appears = _draw_panel(state, name, panels)
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
        keep_fronts(state.of(Layout))
        viewport = imgui.get_main_viewport()
        state.view_rect = (viewport.pos.x, viewport.pos.y, viewport.size.x, viewport.size.y)
    draw_overlays(state)
    _draw_message_window(state)
    draw_manual(state)
    draw_preferences(state, KEYS)
    _draw_error(state)


def _draw_panel(state: AppState, name: str, panels: Mapping[str, Panel]) -> bool:
    """Draw one of the panels; return whether it has just appeared."""
    panel = panels[name]
    # A panel that appears together with a figure must not cover other panels.
    is_quiet = panel.needs and not panel.leads
    flags = imgui.WindowFlags_.no_focus_on_appearing if is_quiet else imgui.WindowFlags_.none
    for other in panels.values():
        if other.place != panel.place or other is panel:
            continue
        window = imgui.internal.find_window_by_name(other.title)
        if window is not None and window.dock_id:
            # A panel that is missing from the stored layout would float over its neighbours.
            imgui.set_next_window_dock_id(window.dock_id, imgui.Cond_.first_use_ever)
            break
    shown, stays = imgui.begin(panel.title, True, flags)
    appears = imgui.is_window_appearing()
    if shown:
        draw_panel(state, name)
    imgui.end()
    if not stays:
        set_open(state, name, False)
    return appears


def _draw_message_window(state: AppState) -> None:
    """Draw the window if it is open."""
    if not state.messages.is_open:
        return
    shown, stays = begin_window("Messages", _SIZE)
    if shown:
        listed = state.messages.log.listed(state.messages.lists_status)
        if button(state, "Copy all", "" if listed else "no messages yet"):
            imgui.set_clipboard_text("\n".join(map(message_line, listed)))
        explain("copy the messages to the clipboard, one per line")
        text = "Results of keys and buttons"
        same_line_if_room(text)
        state.messages.lists_status = checkbox(state, text, state.messages.lists_status)
        if imgui.begin_child("##messages", (0.0, 0.0), imgui.ChildFlags_.borders):
            # New messages are appended; the end stays visible unless the user scrolls away.
            follows = imgui.get_scroll_y() >= imgui.get_scroll_max_y()
            if not listed:
                imgui.text_disabled("no messages yet")
            for message in listed:
                with text_color(ERROR if message.kind == "error" else None):
                    imgui.text_wrapped(printable(message_line(message), _LONGEST))
            if follows:
                imgui.set_scroll_here_y(1.0)
        imgui.end_child()
    imgui.end()
    state.messages.is_open = stays


def _draw_error(state: AppState) -> None:
    """Draw the error dialog above everything else, if there is an error."""
    state.messages.log_error(state.error)
    if not state.error:
        return
    opened, stays = begin_dialog("Error", 560.0)
    if opened:
        imgui.text_wrapped(printable(state.error, 1000))
        if button(state, "OK"):
            stays = False
        imgui.same_line()
        if button(state, "Copy"):
            imgui.set_clipboard_text(state.error)
        if not stays:
            state.error = ""
            imgui.close_current_popup()
        imgui.end_popup()
