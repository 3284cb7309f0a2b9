"""Parser of the manual's subset of Markdown into blocks that can be drawn one by one."""

from __future__ import annotations

import re
from itertools import groupby

from viewer.data_classes import dataclass

__all__ = ["Block", "blocks_of"]

_FENCE = "```"
_ITEM = re.compile(r"(\s*)- (.*)")
_CELLS = re.compile(r"(?<!\\)\|")
_MARKS = re.compile(r"`|\*\*")


@dataclass(frozen=True, slots=True)
class Block:
    """One part of a page.

    Attributes
    ----------
    kind : str
        ``"title"``, ``"heading"``, ``"text"``, ``"item"``, ``"code"`` or ``"table"``.
    text : str
        One line of text to wrap, or all lines of a code block; empty for tables.
    rows : tuple of tuples of str
        Cells of a table; the header comes first.
    """

    kind: str
    text: str = ""
    rows: tuple[tuple[str, ...], ...] = ()


def blocks_of(text: str) -> list[Block]:
    r"""Return the blocks of a Markdown text.

    >>> [(block.kind, block.text) for block in blocks_of("# Keys\n\nH or **?**\nlists `them`.\n")]
    [('title', 'Keys'), ('text', 'H or ? lists them.')]
    """
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
