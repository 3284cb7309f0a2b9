"""The Manual window: the list of pages, and the chosen page, drawn by imgui-bundle."""

from __future__ import annotations

from dataclasses import field

from imgui_bundle import imgui, rich_md

from viewer.app.core.state import AppState
from viewer.app.core.widgets import begin_menu, begin_window, menu_item, note_item
from viewer.data_classes import dataclass
from viewer.errors import ViewerError
from viewer.manual import PAGES, page_text

_SIZE = (60.0, 40.0)  # size of the window, in font sizes
_TOPICS = 8.5  # width of the list, in font sizes


@dataclass(slots=True)
class Manual:
    """State of the manual's window."""

    topic: str = ""
    """A key of ``viewer.manual.PAGES``; empty while the window is closed."""
    pages: dict[str, str] = field(default_factory=dict)
    """Markdown of the pages shown so far, by topic."""
    drawing: rich_md.Context | None = None
    """Fonts and code blocks of the pages; made when the first page is shown."""

    def release(self) -> None:
        """Free the fonts and code blocks."""
        if self.drawing is not None:
            rich_md.destroy_context(self.drawing)
            self.drawing = None


def draw_manual_menu(state: AppState) -> None:
    """Draw a menu with an item for each page."""
    if not begin_menu(state, "Manual"):
        return
    manual = state.of(Manual)
    for topic in PAGES:
        # Some pages have the same names as other menu items.
        if menu_item(state, f"{topic.capitalize()}##page {topic}", "", topic == manual.topic):
            manual.topic = topic
    imgui.end_menu()


def draw_manual(state: AppState) -> None:
    """Draw the window if a page was chosen."""
    manual = state.of(Manual)
    if not manual.topic:
        return
    shown, stays = begin_window("Manual", _SIZE)
    if shown:
        # Draw the list of pages, at the left.
        if imgui.begin_child("##topics", (_TOPICS * imgui.get_font_size(), 0.0)):
            for topic, text in PAGES.items():
                if imgui.selectable(f"{topic.capitalize()}##{topic}", topic == manual.topic)[0]:
                    manual.topic = topic
                note_item(state, f"page {topic}")
                if imgui.is_item_hovered():
                    imgui.set_tooltip(text)
        imgui.end_child()
        imgui.same_line()
        _draw_page(state, manual)
    imgui.end()
    if not stays:
        manual.topic = ""


def _draw_page(state: AppState, manual: Manual) -> None:
    """Draw the chosen page; each page keeps its scroll position."""
    topic = manual.topic
    if topic not in manual.pages:
        try:
            manual.pages[topic] = page_text(topic)
        except ViewerError as problem:  # the installation is incomplete
            state.error, manual.topic = str(problem), ""
            return
    if imgui.begin_child(f"##page {topic}", (0.0, 0.0), imgui.ChildFlags_.borders):
        manual.drawing = manual.drawing or rich_md.create_context()
        rich_md.set_current_context(manual.drawing)
        rich_md.render(manual.pages[topic])
    imgui.end_child()
