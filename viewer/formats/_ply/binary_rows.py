"""Parser for the rows of a binary ``.ply``."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from viewer.diagnostics import Phrase
from viewer.errors import FormatError
from viewer.formats._ply.even import even_binary
from viewer.formats._ply.header import Element, Header, Property
from viewer.formats._ply.table import Numbers, Places, Table, list_places
from viewer.formats._source import Source

__all__ = ["BinaryRows"]


class BinaryRows:
    """Rows of a binary file."""

    def __init__(self, source: Source, header: Header) -> None:
        self.source, self.order = source, header.order
        self.data, self.position = source.data, header.end

    def begin(self, element: Element) -> Places:
        """Return the offset of each row; rows of different sizes are followed by their counts."""
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
        """Return the starts of rows, followed one by one because their lists differ in length.

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
        values, _ = self._numbers(list_places(cursor, whole, size), prop.kind)
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
