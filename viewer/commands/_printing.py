"""Tables and coloured lines; colours appear only in a terminal."""

from __future__ import annotations

import sys
from collections.abc import Collection, Sequence
from io import StringIO
from typing import TextIO


def print_line(*parts: str | tuple[str, str], file: TextIO | None = None) -> None:
    """Print consecutive strings, some with a rich style such as ``"red"``, on one line."""
    stream = sys.stdout if file is None else file
    if stream is None or not stream.isatty():
        print("".join(part if isinstance(part, str) else part[0] for part in parts), file=stream)
        return
    from rich.console import Console
    from rich.text import Text

    Console(file=stream).print(Text.assemble(*parts), soft_wrap=True)


def table_lines(rows: Sequence[Sequence[str]], right: Collection[int] = ()) -> list[str]:
    """Lay out rows of equal length in columns as wide as their cells; some are right-aligned.

    >>> table_lines([["", "joints"], ["walk", "0.5"]], right=[1])
    ['      joints', 'walk     0.5']
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 1))
    for column in range(len(rows[0]) if rows else 0):
        table.add_column(justify="right" if column in right else "left", no_wrap=True)
    for row in rows:
        table.add_row(*map(Text, row))
    # Wide enough for any row, so that nothing is truncated.
    width = sum(max(len(cell) for cell in column) * 2 + 2 for column in zip(*rows, strict=True))
    text = StringIO()
    Console(file=text, width=width + 1, color_system=None, legacy_windows=False).print(table)
    return [line.rstrip() for line in text.getvalue().splitlines()]
