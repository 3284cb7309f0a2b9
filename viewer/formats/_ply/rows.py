"""The numbers behind the header of a ``.ply``: text or bytes, elements one after the other."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.errors import counted
from viewer.formats._numbers import parse_numbers, parse_words
from viewer.formats._ply.header import Element, Header
from viewer.formats._source import Source, no_number

__all__ = ["Table", "read_tables"]

Places = NDArray[np.int64]
Numbers = NDArray[Any]


@dataclass(slots=True)
class Table:
    """One element's rows.

    Attributes
    ----------
    element : Element
        What the header says of it.
    columns : dict of str to (N,)
        Its properties that are no lists.
    lists : dict of str to ((N,), (M,))
        Its lists: how many values each row has, and the values of all rows.
    offsets : (N,) or None
        Where each row is in a text.
    """

    element: Element
    columns: dict[str, Numbers] = field(default_factory=dict)
    lists: dict[str, tuple[Places, Numbers]] = field(default_factory=dict)
    offsets: Places | None = None

    def offset(self, row: int) -> int | None:
        """Return where in the file a row is; None in one of bytes, which has no lines."""
        return None if self.offsets is None else int(self.offsets[row])


def read_tables(source: Source, header: Header) -> dict[str, Table]:
    """Read all elements, by name.

    Raises
    ------
    FormatError
        If there are fewer numbers than the header says, or something else than numbers.
    """
    body: _Text | _Binary
    body = _Binary(source, header) if header.order else _Text(source, header)
    tables: dict[str, Table] = {}
    for element in header.elements:
        table = Table(element)
        cursor = body.begin(element)
        table.offsets = body.offsets(cursor)
        for prop in element.properties:
            if prop.count_kind:
                counts, values, cursor = body.take_lists(table, cursor, prop.count_kind, prop.kind)
                table.lists[prop.name] = counts, values
            else:
                table.columns[prop.name], cursor = body.take(cursor, prop.kind)
        body.end(element, cursor)
        tables.setdefault(element.name, table)
    body.finish()
    return tables


def _flat(starts: Places, counts: Places, step: int) -> Places:
    """Return the places of all values of lists that begin at ``starts``."""
    total = np.cumsum(counts) - counts
    return np.repeat(starts - total * step, counts) + np.arange(counts.sum()) * step


class _Text:
    """Numbers as words, one row a line."""

    def __init__(self, source: Source, header: Header) -> None:
        self.source, self.start = source, header.end
        self.data = source.data.rstrip(b"\x1a")
        self.values, bad = parse_numbers(self.data, self.start, len(self.data))
        letters = np.frombuffer(self.data, dtype=np.uint8, offset=self.start)
        inked = ~((letters == 32) | ((letters >= 9) & (letters <= 13)))
        self.begins = np.flatnonzero(inked & ~np.concatenate([[False], inked[:-1]]))
        if bad >= 0:
            offset = self.start + int(self.begins[bad])
            word = source.next_word(offset)
            assert word is not None  # it was found there
            if source.faults is None:
                raise source.error(no_number(word.group()), offset)
            self.values = parse_words(self.data, self.start, len(self.data))
        ends = np.flatnonzero((letters == 10) | (letters == 13))
        lines = np.searchsorted(ends, self.begins)
        # The first word of every line with words, and how many it has.
        is_first = np.concatenate([[True], lines[1:] != lines[:-1]]) if len(lines) else lines > 0
        self.firsts = np.flatnonzero(is_first)
        self.counts = np.diff(np.append(self.firsts, len(self.begins)))
        self.line = 0

    def begin(self, element: Element) -> Places:
        """Return the first word of each row."""
        last = self.line + element.count * bool(element.properties)
        if last > len(self.firsts):
            raise self.source.error(
                f"{element.name}: expected {element.count} lines, "
                f"found {len(self.firsts) - self.line}",
                element.offset,
            )
        rows = slice(self.line, last)
        self.rows_left = self.firsts[rows] + self.counts[rows]
        self.line = last
        return self.firsts[rows]

    def offsets(self, cursor: Places) -> Places | None:
        """Return where in the file words are."""
        return self.begins[cursor] + self.start

    def take(self, cursor: Places, kind: str) -> tuple[Numbers, Places]:
        """Return the next number of each row."""
        self._need(cursor + 1)
        return self.values[cursor], cursor + 1

    def take_lists(
        self, table: Table, cursor: Places, count_kind: str, kind: str
    ) -> tuple[Places, Numbers, Places]:
        """Return the next list of each row."""
        counts, cursor = self.take(cursor, count_kind)
        whole = np.clip(np.nan_to_num(counts), -(2.0**40), 2.0**40).astype(np.int64)
        wrong = np.flatnonzero((whole != counts) | (whole < 0))
        if len(wrong):
            raise self.source.error(
                f"{table.element.name}: expected how many follow, found {counts[wrong[0]]:g}",
                self._offset(cursor[wrong[0]] - 1),
            )
        self._need(cursor + whole)
        return whole, self.values[_flat(cursor, whole, 1)], cursor + whole

    def end(self, element: Element, cursor: Places) -> None:
        """Refuse rows with more numbers than their properties take."""
        more = np.flatnonzero(cursor[: len(self.rows_left)] < self.rows_left)
        if len(more) and element.properties:
            self._refuse(int(more[0]), int(cursor[more[0]]))

    def finish(self) -> None:
        """Warn of lines that no element has."""
        left = len(self.firsts) - self.line
        if left:
            self.source.warn(f"ignored {counted(left, 'line')} after the last element")
            words = np.flatnonzero(np.isnan(self.values[self.firsts[self.line] :]))
            if len(words):  # only where faults are noted: others were refused at the start
                offset = self._offset(int(self.firsts[self.line] + words[0]))
                message = "expected numbers, found words after the last element"
                self.source.refuse_error(self.source.error(message, offset), len(words))

    def _need(self, cursor: Places) -> None:
        short = np.flatnonzero(cursor > self.rows_left)
        if len(short):
            self._refuse(int(short[0]), int(cursor[short[0]]))

    def _refuse(self, row: int, cursor: int) -> None:
        line = self.line - len(self.rows_left) + row
        first = int(self.firsts[line])
        raise self.source.error(
            f"expected {cursor - first}{' or more' * bool(cursor > self.rows_left[row])} numbers "
            f"in the line, found {self.counts[line]}",
            self._offset(first),
        )

    def _offset(self, word: int) -> int:
        return self.start + int(self.begins[word])


class _Binary:
    """Numbers as bytes."""

    def __init__(self, source: Source, header: Header) -> None:
        self.source, self.order = source, header.order
        self.data, self.position = source.data, header.end

    def begin(self, element: Element) -> Places:
        """Return where each row begins: rows of one size at once, others by their counts."""
        sizes = [int(prop.kind[1]) for prop in element.properties if not prop.count_kind]
        sizes += [int(prop.count_kind[1]) for prop in element.properties if prop.count_kind]
        left = len(self.data) - self.position
        if sum(sizes) * element.count > left:
            raise self._short(element, left)
        if not element.has_lists:
            return self.position + np.arange(element.count, dtype=np.int64) * sum(sizes)
        starts = self._even(element)
        return self._walked(element) if starts is None else starts

    def offsets(self, cursor: Places) -> Places | None:
        """Return nothing: bytes have no lines."""
        return None

    def _even(self, element: Element) -> Places | None:
        """Return where rows begin if the lists of all are as long as those of the first."""
        if element.count == 0:
            return np.zeros(0, np.int64)
        size = self._row_size(element, self.position)
        if size * element.count > len(self.data) - self.position:
            return None
        starts = self.position + np.arange(element.count, dtype=np.int64) * size
        cursor = starts
        for prop in element.properties:
            if prop.count_kind:
                counts, cursor = self.take(cursor, prop.count_kind)
                if (counts != counts[0]).any():
                    return None
                cursor = cursor + int(counts[0]) * int(prop.kind[1])
            else:
                cursor = cursor + int(prop.kind[1])
        return starts

    def _row_size(self, element: Element, start: int) -> int:
        """Return the bytes of one row; past the end of the file counts are 0."""
        place = start
        for prop in element.properties:
            size = int(prop.kind[1])
            if prop.count_kind:
                width = int(prop.count_kind[1])
                number = int.from_bytes(
                    self.data[place : place + width],
                    "little" if self.order == "<" else "big",
                    signed=prop.count_kind[0] == "i",
                )
                place += width + max(number, 0) * size
            else:
                place += size
        return place - start

    def _walked(self, element: Element) -> Places:
        """Walk from row to row: where lists differ in length nothing else tells where one begins.

        A step per face, not per vertex; files of triangles alone never come here.
        """
        starts = np.empty(element.count, dtype=np.int64)
        place, end = self.position, len(self.data)
        for row in range(element.count):
            starts[row] = place
            place += self._row_size(element, place)
            if place > end:
                raise self._short(element, end - self.position)
        return starts

    def take(self, cursor: Places, kind: str) -> tuple[Numbers, Places]:
        """Return the next number of each row, in the machine's own order of bytes."""
        size = int(kind[1])
        if len(cursor) == 0:
            return np.zeros(0, dtype=kind), cursor
        # A window of one number at every byte: rows need not be aligned.
        windows = np.ndarray(
            len(self.data) - size + 1, dtype=self.order + kind, buffer=self.data, strides=(1,)
        )
        return windows[cursor].astype(kind), cursor + size

    def take_lists(
        self, table: Table, cursor: Places, count_kind: str, kind: str
    ) -> tuple[Places, Numbers, Places]:
        """Return the next list of each row."""
        counts, cursor = self.take(cursor, count_kind)
        whole = counts.astype(np.int64)
        wrong = np.flatnonzero(whole < 0)
        if len(wrong):
            raise self.source.error(
                f"{table.element.name} {wrong[0]}: expected how many follow, "
                f"found {whole[wrong[0]]}"
            )
        size = int(kind[1])
        values, _ = self.take(_flat(cursor, whole, size), kind)
        return whole, values, cursor + whole * size

    def end(self, element: Element, cursor: Places) -> None:
        """Go on behind the last row."""
        if len(cursor):
            self.position = int(cursor[-1])

    def finish(self) -> None:
        """Warn of bytes that no element has."""
        left = len(self.data) - self.position
        if left:
            self.source.warn(f"ignored {counted(left, 'byte')} after the last element")

    def _short(self, element: Element, left: int) -> Exception:
        return self.source.error(
            f"{element.name}: expected {element.count} rows, found the end of the file after "
            f"{left} bytes of them",
            element.offset,
        )
