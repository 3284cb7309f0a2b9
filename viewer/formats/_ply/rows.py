"""Parser for the rows after the header of a ``.ply``: text or binary, element after element."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Part, Phrase
from viewer.errors import FormatError
from viewer.formats._mesh.polygons import triangles_of
from viewer.formats._ply.even import even_binary, even_text
from viewer.formats._ply.header import CORNERS, Element, Header, Property
from viewer.formats._source import Source
from viewer.formats._text.line_sizes import line_sizes
from viewer.formats._text.numbers import parse_numbers, parse_words, word_begins
from viewer.formats._text.words import number_key

__all__ = ["Table", "read_tables"]

Places = NDArray[np.int64]
Indices = NDArray[np.integer]
Numbers = NDArray[Any]

_WORD = re.compile(rb"[^ \t\n\r\v\f]+")


@dataclass(slots=True)
class Table:
    """One element's rows.

    Attributes
    ----------
    element : Element
        Declaration of the element in the header.
    columns : dict of str to (N,)
        Properties of the element that are not lists.
    lists : dict of str to ((N,), (M,))
        List properties: the number of values of each row, and the values of all rows.
    offset_of : callable or None
        Returns the offset of a row; slow, for errors only. None in a binary file.
    is_first : bool
        Whether it is the first element with its name; later ones are read and discarded.
    """

    element: Element
    columns: dict[str, Numbers] = field(default_factory=dict)
    lists: dict[str, tuple[Places, Numbers]] = field(default_factory=dict)
    offset_of: Callable[[int], int] | None = None
    is_first: bool = True

    def offset(self, row: int) -> int | None:
        """Return the offset of a row in the file; None in a binary file, which has no lines."""
        return None if self.offset_of is None else self.offset_of(row)


def read_tables(source: Source, header: Header) -> dict[str, Table]:
    """Read all elements and return them by name.

    Raises
    ------
    FormatError
        If there are fewer numbers than the header declares, or words that are not numbers.
    """
    body: _Text | _Binary
    body = _Binary(source, header) if header.order else _Text(source, header)
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


def _flat(starts: Places, counts: Places, step: int) -> Places:
    """Return the positions of all values of lists that begin at ``starts``."""
    total = np.cumsum(counts) - counts
    return np.repeat(starts - total * step, counts) + np.arange(counts.sum()) * step


class _Text:
    """Rows of a text file, one per line; words that are not numbers become NaN."""

    def __init__(self, source: Source, header: Header) -> None:
        self.source, self.start = source, header.end
        self.data = source.data.rstrip(b"\x1a")
        self.values, bad = parse_numbers(self.data, self.start, len(self.data))
        if bad >= 0:
            self.values = parse_words(self.data, self.start, len(self.data))
        self.has_bad = bad >= 0
        # Find the first word and the number of words of every non-empty line.
        self.counts = line_sizes(self.data, self.start)
        self.firsts = np.cumsum(self.counts, dtype=np.int64) - self.counts
        self.line = 0
        self._begins: Places | None = None

    def take_even(self, table: Table) -> bool:
        """Read an element if all its rows have the same size; return whether they do."""
        element = table.element
        last = self.line + element.count
        if self.has_bad or element.count == 0 or last > len(self.counts):
            return False
        counts = self.counts[self.line : last]
        first, width = int(self.firsts[self.line]), int(counts[0])
        if (counts != width).any():
            return False
        block = self.values[first : first + width * element.count].reshape(-1, width)
        found = even_text(element, block)
        if found is None:
            return False
        table.columns, table.lists = found
        table.offset_of = lambda row: self._offset(first + width * row)
        self.line = last
        return True

    def begin(self, element: Element) -> Places:
        """Return the first word of each row."""
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
        places = _flat(cursor, whole, 1)
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
        """Warn about lines after the last element."""
        left = len(self.firsts) - self.line
        if left:
            self.source.warn("F006.ply-lines", n=left)
            first = self.firsts[self.line]
            words = first + np.flatnonzero(np.isnan(self.values[first:]))
            if len(words):
                self._refuse_first(words, Phrase("ply-rest"))

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


class _Binary:
    """Rows of a binary file."""

    def __init__(self, source: Source, header: Header) -> None:
        self.source, self.order = source, header.order
        self.data, self.position = source.data, header.end

    def begin(self, element: Element) -> Places:
        """Return the offset of each row; if row sizes differ, it is derived from the counts."""
        sizes = [int(prop.kind[1]) for prop in element.properties if not prop.count_kind]
        sizes += [int(prop.count_kind[1]) for prop in element.properties if prop.count_kind]
        left = len(self.data) - self.position
        if sum(sizes) * element.count > left:
            raise self._short(element, left)
        if not element.has_lists:
            return self.position + np.arange(element.count, dtype=np.int64) * sum(sizes)
        return self._walked(element)

    def offsets(self, cursor: Places) -> Callable[[int], int] | None:
        """Return None, as binary files have no lines."""
        return None

    def take_even(self, table: Table) -> bool:
        """Read an element if all its rows have the same size; return whether they do."""
        element = table.element
        if element.count == 0:
            return False
        counts = self._list_sizes(element, self.position)[1]
        # Lists longer than the file are refused with the element.
        if sum(counts) > len(self.data) or any(count < 0 for count in counts):
            return False
        found = even_binary(element, self.data, self.position, self.order, counts)
        if found is None:
            return False
        (table.columns, table.lists), size = found
        self.position += size * element.count
        return True

    def _row_size(self, element: Element, start: int) -> int:
        """Return the size of one row in bytes; counts beyond the end of the file are 0."""
        return self._list_sizes(element, start)[0]

    def _list_sizes(self, element: Element, start: int) -> tuple[int, list[int]]:
        """Return the size of one row in bytes, and the lengths of its lists as declared."""
        place, counts = start, list[int]()
        for prop in element.properties:
            size = int(prop.kind[1])
            if prop.count_kind:
                width = int(prop.count_kind[1])
                number = int.from_bytes(
                    self.data[place : place + width],
                    "little" if self.order == "<" else "big",
                    signed=prop.count_kind[0] == "i",
                )
                counts.append(number)
                place += width + max(number, 0) * size
            else:
                place += size
        return place - start, counts

    def _walked(self, element: Element) -> Places:
        """Return the starts of rows, found one after another because their lists differ in length.

        This takes one iteration per face; files that contain only triangles never need it.
        """
        starts = np.empty(element.count, dtype=np.int64)
        place, end = self.position, len(self.data)
        for row in range(element.count):
            starts[row] = place
            place += self._row_size(element, place)
            if place > end:
                raise self._short(element, end - self.position)
        return starts

    def take(self, table: Table, cursor: Places, prop: Property) -> tuple[Numbers, Places]:
        """Return the next number of each row."""
        return self._numbers(cursor, prop.kind)

    def _numbers(self, cursor: Places, kind: str) -> tuple[Numbers, Places]:
        """Return the number at each offset, in native byte order."""
        size = int(kind[1])
        if len(cursor) == 0:
            return np.zeros(0, dtype=kind), cursor
        # A window with the size of a number starts at every byte, as rows need not be aligned.
        windows = np.ndarray(
            len(self.data) - size + 1, dtype=self.order + kind, buffer=self.data, strides=(1,)
        )
        return windows[cursor].astype(kind), cursor + size

    def take_lists(
        self, table: Table, cursor: Places, prop: Property
    ) -> tuple[Places, Numbers, Places]:
        """Return the next list of each row."""
        counts, cursor = self._numbers(cursor, prop.count_kind)
        whole = counts.astype(np.int64)
        wrong = np.flatnonzero(whole < 0)
        if len(wrong):
            row = int(wrong[0])
            item = Phrase("ply-row", element=table.element.name, row=row)
            raise self.source.fault("F002.ply-list", item=item, found=int(whole[row]))
        size = int(prop.kind[1])
        values, _ = self._numbers(_flat(cursor, whole, size), prop.kind)
        return whole, values, cursor + whole * size

    def end(self, element: Element, cursor: Places) -> None:
        """Continue after the last row."""
        if len(cursor):
            self.position = int(cursor[-1])

    def finish(self) -> None:
        """Warn about bytes after the last element."""
        left = len(self.data) - self.position
        if left:
            self.source.warn("F006.ply-bytes", n=left)

    def _short(self, element: Element, left: int) -> FormatError:
        return self.source.fault(
            "F002.ply-short",
            element.offset,
            element=element.name,
            expected=element.count,
            size=left,
        )
