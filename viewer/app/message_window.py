"""The window "Messages" with the message log, and the dialog for errors."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.ink import ERROR, ink
from viewer.app.core.messages import Message, message_line
from viewer.app.core.state import AppState
from viewer.app.core.widgets import (
    begin_window,
    button,
    checkbox,
    explain,
    same_line_if_room,
)
from viewer.phrases import printable

__all__ = ["draw_error", "draw_message_window"]

_ERROR_TITLE = "Error"
_TITLE = "Messages"
_SIZE = (42.0, 22.0)  # initial size of the window, in font sizes
_LONGEST = 1000  # maximum length of a message in characters


def draw_message_window(state: AppState) -> None:
    """Draw the window if it is open."""
    if not state.messages.is_open:
        return
    shown, stays = begin_window(_TITLE, _SIZE)
    if shown:
        _draw_content(state)
    imgui.end()
    state.messages.is_open = stays


def _draw_content(state: AppState) -> None:
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
            _draw_message(message)
        if follows:
            imgui.set_scroll_here_y(1.0)
    imgui.end_child()


def _draw_message(message: Message) -> None:
    is_error = message.kind == "error"
    if is_error:
        imgui.push_style_color(imgui.Col_.text, ink(ERROR))
    imgui.text_wrapped(printable(message_line(message), _LONGEST))
    if is_error:
        imgui.pop_style_color()


def draw_error(state: AppState) -> None:
    """Draw the error dialog above everything else, if there is an error."""
    state.messages.log_error(state.error)
    if not state.error:
        return
    imgui.open_popup(_ERROR_TITLE)
    center = imgui.get_main_viewport().get_center()
    imgui.set_next_window_pos(center, imgui.Cond_.always, (0.5, 0.5))
    width = min(560.0, 0.92 * imgui.get_main_viewport().size.x)
    imgui.set_next_window_size((width, 0.0))
    opened, stays = imgui.begin_popup_modal(_ERROR_TITLE, True, imgui.WindowFlags_.no_resize)
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
