"""Dialog with the question before a running job or unsaved edits are lost."""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import imgui

from viewer.app.closing.questions import keep_open, question_of
from viewer.app.core.state import AppState
from viewer.app.core.widgets import button, explain, same_line_if_room
from viewer.phrases import printable

__all__ = ["draw_question"]

_WIDTH = 28.0  # in font sizes


def draw_question(state: AppState) -> None:
    """Draw the question above everything else if there is one, and apply the answer."""
    question = question_of(state)
    if question is None:
        return
    title = f"{question.title}###closing"
    imgui.open_popup(title)
    viewport = imgui.get_main_viewport()
    imgui.set_next_window_pos(viewport.get_center(), imgui.Cond_.always, (0.5, 0.5))
    width = min(_WIDTH * imgui.get_font_size(), 0.92 * viewport.size.x)
    imgui.set_next_window_size((width, 0.0))
    opened, stays = imgui.begin_popup_modal(title, True, imgui.WindowFlags_.no_resize)
    if not opened:
        return
    answer: Callable[[AppState], None] | None = None if stays else keep_open
    for line in question.lines:
        imgui.text_wrapped(printable(line, 1000))
    for number, (label, effect, act) in enumerate(question.answers):
        if number:
            same_line_if_room(label)
        if button(state, label):
            answer = act
        explain(effect)
    if answer is not None:
        imgui.close_current_popup()
    imgui.end_popup()
    if answer is not None:
        answer(state)
