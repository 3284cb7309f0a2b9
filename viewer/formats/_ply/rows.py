"""Parser for the rows after the header of a ``.ply``: text or binary, element after element."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Part, Phrase
from viewer.errors import FormatError
from viewer.formats._mesh.polygons import triangles_of
from viewer.formats._ply.binary_rows import BinaryRows
from viewer.formats._ply.even import compact, even_text
from viewer.formats._ply.header import CORNERS, Element, Header, Property
from viewer.formats._ply.table import Numbers, Places, Table, list_places
from viewer.formats._source import Source
from viewer.formats._text.growing_table import GrowingTable
from viewer.formats._text.line_sizes import line_sizes
from viewer.formats._text.numbers import parse_numbers, parse_words, word_begins
from viewer.formats._text.words import number_key
from viewer.progress import report_bytes

__all__ = ["Table", "read_tables"]

Indices = NDArray[np.integer]

_PART = 1 << 17  # rows that are parsed together, to limit the memory of their values
_WORD = re.compile(rb"[^ \t\n\r\v\f]+")


def read_tables(source: Source, header: Header) -> dict[str, Table]:
    """Read all elements and return them by name.

    Raises
    ------
    FormatError
        If there are fewer numbers than the header declares, or words that are not numbers.
    """
    body: _Text | BinaryRows
    body = BinaryRows(source, header) if header.order else _Text(source, header)
    tables: dict[str, Table] = {}
    for element in header.elements:
        table = Table(element, is_first=element.name not in tables)
        if body.take_even(table):
            tables.setdefault(element.name, table)
            continue
        cursor = body.begin(element)
        table.offset_of = body.offsets(cursor)
        for prop in element.properties:
            if prop.count_kind:
                counts, values, cursor = body.take_lists(table, cursor, prop)
                table.lists[prop.name] = counts, values
            else:
                table.columns[prop.name], cursor = body.take(table, cursor, prop)
        body.end(element, cursor)
        tables.setdefault(element.name, table)
    body.finish()
    return tables


class _Text:
    """Rows of a text file, one per line; words that are not numbers become NaN."""

    def __init__(self, source: Source, header: Header) -> None:
        self.source, self.start = source, header.end
        self._lines = line_sizes(self.data, self.start)
        self.counts = self._lines.words
        self.line = 0
        self._begins: Places | None = None
        self._firsts: Places | None = None
        self._values: Numbers | None = None
        self.has_bad = False  # correct once all values have been parsed

    @property
    def data(self) -> bytes:
        """The file, without a final Ctrl-Z."""
        return self.source.data.rstrip(b"\x1a")

    @property
    def values(self) -> Numbers:
        """All values; only irregular files need them together."""
        if self._values is None:
            self._values, bad = parse_numbers(self.data, self.start, len(self.data))
            if bad >= 0:
                self._values = parse_words(self.data, self.start, len(self.data))
            self.has_bad = bad >= 0
        return self._values

    @property
    def firsts(self) -> Places:
        """The first word of every non-empty line."""
        if self._firsts is None:
            self._firsts = np.cumsum(self.counts, dtype=np.int64) - self.counts
        return self._firsts

    def take_even(self, table: Table) -> bool:
        """Read an element if all its rows have the same size; return whether they do."""
        element = table.element
        last = self.line + element.count
        if self.has_bad or element.count == 0 or last > len(self.counts):
            return False
        counts = self.counts[self.line : last]
        width = int(counts[0])
        if (counts != width).any():
            return False
        rows = self._even_rows(element, width)
        found = None if rows is None else even_text(element, rows)
        if found is None:
            return False
        first = int(self.counts[: self.line].sum(dtype=np.int64))
        table.columns, table.lists = found
        table.offset_of = lambda row: self._offset(first + width * row)
        self.line = last
        return True

    def _even_rows(self, element: Element, width: int) -> Numbers | None:
        """Return the numbers of an element, (N, width), as integers if all are; None if invalid."""
        has_lists = any(prop.count_kind for prop in element.properties)
        table = GrowingTable((width,), np.int32 if has_lists else np.float64)
        last = self.line + element.count
        for line in range(self.line, last, _PART):
            start, end = (self._lines.offset(at) for at in (line, min(line + _PART, last)))
            values, bad = parse_numbers(self.data, start, end, is_kept=element.count <= _PART)
            if bad >= 0:
                return None
            # Corners are indices, which take half the memory as int32.
            table.add(
                compact(values.reshape(-1, width)) if has_lists else values.reshape(-1, width)
            )
            report_bytes(end, len(self.data))
        return table.rows()

    def begin(self, element: Element) -> Places:
        """Return the first word of each row."""
        _ = self.values  # parsed first, so that invalid words are known
        last = self.line + element.count * bool(element.properties)
        if last > len(self.firsts):
            raise self.source.fault(
                "F002.ply-lines",
                element.offset,
                element=element.name,
                expected=element.count,
                found=len(self.firsts) - self.line,
            )
        rows = slice(self.line, last)
        self.rows_left = self.firsts[rows] + self.counts[rows]
        self.line = last
        return self.firsts[rows]

    def offsets(self, cursor: Places) -> Callable[[int], int] | None:
        """Return a function that finds the offset of a row in the file."""
        return lambda row: self._offset(int(cursor[row]))

    def take(self, table: Table, cursor: Places, prop: Property) -> tuple[Numbers, Places]:
        """Return the next number of each row."""
        self._need(cursor + 1)
        values = self.values[cursor]
        if self.has_bad:
            rows = np.flatnonzero(np.isnan(values))
            is_place = table.element.name == "vertex" and prop.name in ("x", "y", "z")
            part: Part = "positions" if is_place and table.is_first else ""
            self._refuse_words(table, cursor[rows], rows, part, rows if part else None)
        return values, cursor + 1

    def take_lists(
        self, table: Table, cursor: Places, prop: Property
    ) -> tuple[Places, Numbers, Places]:
        """Return the next list of each row."""
        self._need(cursor + 1)
        counts = self.values[cursor]
        whole = np.clip(np.nan_to_num(counts), -(2.0**40), 2.0**40).astype(np.int64)
        wrong = np.flatnonzero((whole != counts) | (whole < 0))
        if len(wrong):
            raise self._no_count(table, int(wrong[0]), int(cursor[wrong[0]]))
        cursor = cursor + 1
        self._need(cursor + whole)
        places = list_places(cursor, whole, 1)
        values = self.values[places]
        if self.has_bad:
            bad = np.flatnonzero(np.isnan(values))
            rows = np.repeat(np.arange(len(whole)), whole)[bad]
            is_face = table.element.name == "face" and prop.name in CORNERS and table.is_first
            part: Part = "triangles" if is_face else ""
            lost = triangles_of(whole, rows) if is_face else None
            self._refuse_words(table, places[bad], rows, part, lost)
        return whole, values, cursor + whole

    def _refuse_words(
        self,
        table: Table,
        words: Places,
        rows: Places,
        part: Part,
        places: Indices | None,
    ) -> None:
        """Refuse words that are not numbers, each in a row of a table."""
        if len(words):
            item = Phrase("ply-row", element=table.element.name, row=int(rows[0]))
            self._refuse_first(words, item, part, places)

    def _refuse_first(
        self,
        words: Places,
        item: Phrase,
        part: Part = "",
        places: Indices | None = None,
    ) -> None:
        first = int(words[0])
        word = self._word(first)
        self.source.refuse(
            number_key(word), self._offset(first), len(words), part, places, item=item, found=word
        )

    def _no_count(self, table: Table, row: int, word: int) -> FormatError:
        """Return the error for a list without a valid count."""
        item = Phrase("ply-row", element=table.element.name, row=row)
        found = float(self.values[word])
        if np.isnan(found):
            text = self._word(word)
            return self.source.fault(number_key(text), self._offset(word), item=item, found=text)
        return self.source.fault("F002.ply-list", self._offset(word), item=item, found=found)

    def end(self, element: Element, cursor: Places) -> None:
        """Refuse rows with more numbers than their properties need."""
        more = np.flatnonzero(cursor[: len(self.rows_left)] < self.rows_left)
        if len(more) and element.properties:
            self._refuse(int(more[0]), int(cursor[more[0]]))

    def finish(self) -> None:
        """Warn about lines after the last element, and release the text."""
        left = len(self.counts) - self.line
        if left:
            self.source.warn("F006.ply-lines", n=left)
            first = self.firsts[self.line]
            words = first + np.flatnonzero(np.isnan(self.values[first:]))
            if len(words):
                self._refuse_first(words, Phrase("ply-rest"))
        del self._lines
        self.source.release()

    def _need(self, cursor: Places) -> None:
        short = np.flatnonzero(cursor > self.rows_left)
        if len(short):
            self._refuse(int(short[0]), int(cursor[short[0]]))

    def _refuse(self, row: int, cursor: int) -> None:
        line = self.line - len(self.rows_left) + row
        first = int(self.firsts[line])
        expected, found, where = cursor - first, int(self.counts[line]), self._offset(first)
        if cursor > self.rows_left[row]:
            raise self.source.fault("F002.ply-fewer", where, expected=expected, found=found)
        raise self.source.fault("F002.ply-more", where, expected=expected, found=found)

    def _word(self, word: int) -> bytes:
        found = _WORD.match(self.data, self._offset(word))
        return b"" if found is None else found.group()

    def _offset(self, word: int) -> int:
        if self._begins is None:
            letters = np.frombuffer(self.data, dtype=np.uint8, offset=self.start)
            self._begins = word_begins(letters)
        return self.start + int(self._begins[word])
