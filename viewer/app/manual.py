"""The Manual window: the list of pages, and the chosen page."""

from __future__ import annotations

import re
from dataclasses import field
from itertools import groupby

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.app.core.theme import ink
from viewer.app.core.widgets import begin_menu, begin_window, menu_item, note_item
from viewer.data_classes import dataclass
from viewer.errors import ViewerError
from viewer.manual import PAGES, page_text

_SIZE = (60.0, 40.0)  # size of the window, in font sizes
_TOPICS = 8.5  # width of the list, in font sizes
_TITLE = 1.35  # scale of the title's font
_TITLE_COLOR = (1.0, 0.78, 0.45, 1.0)
_CODE_COLOR = (0.72, 0.85, 0.95, 1.0)
_ALIGNED = re.compile(" {2,}#")
_NARROWEST, _WIDEST = 6, 60  # smallest and largest width of a column, characters
_FENCE = "```"
_ITEM = re.compile(r"(\s*)- (.*)")
_CELLS = re.compile(r"(?<!\\)\|")
_MARKS = re.compile(r"`|\*\*")


@dataclass(slots=True)
class Manual:
    """State of the manual's window."""

    topic: str = ""
    """A key of ``viewer.manual.PAGES``; empty while the window is closed."""
    pages: dict[str, list[Block]] = field(default_factory=dict)
    """Blocks of the pages shown so far, by topic."""


@dataclass(frozen=True, slots=True)
class Block:
    """One part of a page."""

    kind: str
    """``"title"``, ``"heading"``, ``"text"``, ``"item"``, ``"code"`` or ``"table"``."""
    text: str = ""
    """One line of text to wrap, or all lines of a code block; empty for tables."""
    rows: tuple[tuple[str, ...], ...] = ()
    """Cells of a table; the header comes first."""


def draw_manual_menu(state: AppState) -> None:
    """Draw a menu with an item for each page."""
    if not begin_menu(state, "Manual"):
        return
    manual = state.of(Manual)
    for topic in PAGES:
        # Some pages have the same names as other menu items.
        if menu_item(state, f"{_title(topic)}##page {topic}", "", topic == manual.topic):
            manual.topic = topic
    imgui.end_menu()


def draw_manual(state: AppState) -> None:
    """Draw the window if a page was chosen."""
    manual = state.of(Manual)
    if not manual.topic:
        return
    shown, stays = begin_window("Manual", _SIZE)
    if shown:
        _draw_topics(state, manual)
        imgui.same_line()
        _draw_page(state, manual)
    imgui.end()
    if not stays:
        manual.topic = ""


def _title(topic: str) -> str:
    """Return a topic's label in menus."""
    return topic.capitalize()


def _draw_topics(state: AppState, manual: Manual) -> None:
    """Draw the list of pages, at the left."""
    if imgui.begin_child("##topics", (_TOPICS * imgui.get_font_size(), 0.0)):
        for topic, text in PAGES.items():
            if imgui.selectable(f"{_title(topic)}##{topic}", topic == manual.topic)[0]:
                manual.topic = topic
            note_item(state, f"page {topic}")
            if imgui.is_item_hovered():
                imgui.set_tooltip(text)
    imgui.end_child()


def _draw_page(state: AppState, manual: Manual) -> None:
    """Draw the chosen page; each page keeps its scroll position."""
    topic = manual.topic
    if topic not in manual.pages:
        try:
            manual.pages[topic] = blocks_of(page_text(topic))
        except ViewerError as problem:  # the installation is incomplete
            state.error, manual.topic = str(problem), ""
            return
    if imgui.begin_child(f"##page {topic}", (0.0, 0.0), imgui.ChildFlags_.borders):
        for number, block in enumerate(manual.pages[topic]):
            _draw_block(block, number)
    imgui.end_child()


def _draw_block(block: Block, number: int) -> None:
    if block.kind == "title":
        imgui.push_font(None, _TITLE * imgui.get_style().font_size_base)
        imgui.text_colored(ink(_TITLE_COLOR), block.text)
        imgui.pop_font()
    elif block.kind == "heading":
        imgui.spacing()
        imgui.separator_text(block.text)
    elif block.kind == "item":
        imgui.bullet()
        imgui.same_line()
        imgui.text_wrapped(block.text)
    elif block.kind == "code":
        _draw_code(block.text, number)
    elif block.kind == "table":
        _draw_table(block, number)
    else:
        imgui.text_wrapped(block.text)
    if block.kind != "item":
        imgui.spacing()


def _draw_code(text: str, number: int) -> None:
    """Draw lines without wrapping, in a frame with a scroll bar if they are too long."""
    flags = imgui.ChildFlags_.frame_style | imgui.ChildFlags_.auto_resize_y
    scrolls = imgui.WindowFlags_.horizontal_scrollbar
    if imgui.begin_child(f"##code {number}", (0.0, 0.0), flags, scrolls):
        imgui.push_style_color(imgui.Col_.text, ink(_CODE_COLOR))
        # Spaces align comments only in a monospaced font.
        imgui.text_unformatted(_ALIGNED.sub("   #", text))
        imgui.pop_style_color()
    imgui.end_child()


def _draw_table(block: Block, number: int) -> None:
    """Draw a table as wide as the page, with columns in proportion to their longest cells."""
    flags = imgui.TableFlags_.borders_inner_h | imgui.TableFlags_.row_bg
    head, *rows = block.rows
    if not imgui.begin_table(f"##table {number}", len(head), flags):
        return
    for column, text in enumerate(head):
        longest = max(len(row[column]) for row in block.rows)
        weight = float(min(max(longest, _NARROWEST), _WIDEST))
        imgui.table_setup_column(text, imgui.TableColumnFlags_.width_stretch, weight)
    if any(head):
        imgui.table_headers_row()
    for row in rows:
        imgui.table_next_row()
        for text in row:
            imgui.table_next_column()
            imgui.text_wrapped(text)
    imgui.end_table()


def blocks_of(text: str) -> list[Block]:
    """Return the blocks of a Markdown text."""
    found: list[Block] = []
    # Every second part is code; its first line names the language.
    for number, part in enumerate(re.split(rf"^{_FENCE}", text, flags=re.MULTILINE)):
        if number % 2:
            found.append(Block("code", part.partition("\n")[2].rstrip("\n")))
        else:
            found += _prose(part)
    return found


def _prose(text: str) -> list[Block]:
    """Return the blocks of text without code."""
    found: list[Block] = []
    lines = text.splitlines()
    for is_empty, group in groupby(lines, lambda line: not line.strip()):
        if not is_empty:
            found += _paragraph([*group])
    return found


def _paragraph(lines: list[str]) -> list[Block]:
    """Return the blocks of consecutive nonempty lines."""
    if lines[0].startswith("|"):
        rows = (_cells(line) for number, line in enumerate(lines) if number != 1)
        return [Block("table", rows=tuple(rows))]
    found: list[tuple[str, list[str]]] = []
    for line in lines:
        item = _ITEM.match(line)
        if line.startswith("#"):
            kind = "title" if line.startswith("# ") else "heading"
            found.append((kind, [line.lstrip("# ")]))
        elif item is not None:
            found.append(("item", [item[2]]))
        elif found and found[-1][0] in ("item", "text"):
            found[-1][1].append(line.strip())
        else:
            found.append(("text", [line.strip()]))
    return [Block(kind, _plain(" ".join(parts))) for kind, parts in found]


def _cells(line: str) -> tuple[str, ...]:
    """Return the cells of a table row, without the bars at its ends."""
    return tuple(_plain(cell.strip().replace("\\|", "|")) for cell in _CELLS.split(line)[1:-1])


def _plain(text: str) -> str:
    """Return text without the markup of code and bold text."""
    return _MARKS.sub("", text)
