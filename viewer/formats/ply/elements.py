"""Elements of a ``.ply``: the header declares them, and rows of text or binary numbers follow.

In most files, all rows of an element have the same size. Their columns are then views of one array,
and the positions of individual numbers are not needed. Otherwise a cursor for each row moves from
one property to the next.
"""

from __future__ import annotations

import bisect
import re
from collections.abc import Callable
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Part, Phrase, wording
from viewer.errors import FormatError
from viewer.formats._polygons import triangles_of
from viewer.formats._source import Source
from viewer.formats._text.growing_table import GrowingTable
from viewer.formats._text.numbers import line_ends, parse_numbers, parse_words, word_begins
from viewer.formats._text.words import number_key
from viewer.phrases import brief, counted, listed, quoted
from viewer.progress import report_bytes

CORNERS = ("vertex_indices", "vertex_index")
"""Names of the property that lists a face's vertices."""
_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_LINE = re.compile(rb"([^\r\n]*)(\r\n|\r+\n|\n|\r|\Z)")
_LONGEST = 1 << 20  # maximum size of a header, bytes
_PART = 1 << 17  # rows that are parsed together, to limit the memory of their values
_PIECE = 1 << 18  # bytes per piece, whose temporary arrays stay in the processor's cache
_WORD = re.compile(rb"[^ \t\n\r\v\f]+")
_LINE_END = re.compile(rb"[\r\n]")
_WHOLE = 2.0**31  # numbers between it and its negative fit into an int32
_Indices = NDArray[np.integer]
_Places = NDArray[np.int64]
_Numbers = NDArray[Any]
_Columns = tuple[dict[str, _Numbers], dict[str, tuple[NDArray[np.int64], _Numbers]]]
"""Properties by name, and lists by name. A list consists of the number of values of each row, and
all values."""


@dataclass(frozen=True, slots=True)
class _Property:
    """One property: its type in numpy's notation, and the type of the count if it is a list."""

    name: str
    kind: str
    count_kind: str = ""


@dataclass(slots=True)
class _Element:
    """Consecutive rows with the same properties."""

    name: str
    count: int
    offset: int
    properties: list[_Property] = field(default_factory=list)

    @property
    def has_lists(self) -> bool:
        """Whether rows may have different sizes."""
        return any(prop.count_kind for prop in self.properties)


@dataclass(slots=True)
class Header:
    """Contents of a file."""

    order: str = ""
    """One of "", "<" or ">". Byte order; empty for text."""
    elements: list[_Element] = field(default_factory=list)
    """In file order."""
    comments: list[tuple[str, int]] = field(default_factory=list)
    """Comment strings and their offsets."""
    end: int = 0
    """Offset of the data."""


def read_header(source: Source) -> Header:
    """Read the lines up to ``end_header``."""
    header = Header()
    position, number, has_format = 0, 0, False
    while position < min(len(source.data), _LONGEST):
        match = _LINE.match(source.data, position)
        assert match is not None  # the pattern matches every text
        words = match[1].decode("utf-8", "surrogateescape").split()
        if number == 0 and words != ["ply"]:
            raise _no_ply(source, match[1])
        if words == ["end_header"]:
            if not has_format:
                raise source.fault(
                    "F002.ply-no-format: expected a `format` line, found none before end_header",
                    position,
                )
            header.end = _behind(source.data, match)
            return header
        keyword = words[0] if words else ""
        if keyword == "format":
            header.order, has_format = _order(source, words, position), True
        elif keyword in ("comment", "obj_info"):
            text = match[1].decode("utf-8", "surrogateescape").strip()
            header.comments.append((text[len(keyword) :].strip(), position))
        elif keyword == "element":
            header.elements.append(_element(source, words, position))
        elif keyword == "property":
            if not header.elements:
                raise source.fault(
                    "F002.ply-no-element: property: expected an element before it, found none",
                    position,
                )
            properties = header.elements[-1].properties
            properties.append(_property(source, properties, words, position))
        elif keyword and number:
            raise source.fault(
                'F002.ply-line: expected element, property, comment or end_header, found "{found}"',
                position,
                found=brief(keyword),
            )
        position, number = match.end(), number + 1
    raise source.fault("F002.ply-no-end: missing end_header", position)


def _no_ply(source: Source, line: bytes) -> FormatError:
    """Return the error for a file in another format."""
    looks = source.looks_like()
    if looks is not None:
        return source.fault(
            'F002.ply-looks: expected "ply" on the first line, found {looks}', 0, looks=looks
        )
    return source.fault(
        'F002.ply-start: expected "ply" on the first line, found {found}',
        0,
        found=quoted(line[:40]),
    )


def _behind(data: bytes, match: re.Match[bytes]) -> int:
    """Return the offset of the data, whose first byte may resemble the LF of a CR LF."""
    if match[2] == b"\r\n" and not data.startswith((b"ply\r\n", b"ply \r\n")):
        return match.end() - 1
    return match.end()


def _order(source: Source, words: list[str], offset: int) -> str:
    if len(words) != 3 or words[1] not in _ORDERS or words[2] != "1.0":
        found = " ".join(words[1:])
        raise source.fault(
            'F002.ply-format: format: expected one of {orders} and 1.0, found "{found}"',
            offset,
            orders=listed(list(_ORDERS)),
            found=brief(found),
        )
    return _ORDERS[words[1]]


def _element(source: Source, words: list[str], offset: int) -> _Element:
    is_count = len(words) == 3 and words[2].isascii() and words[2].isdecimal()
    if not is_count or len(words[2]) > 18:
        raise source.fault(
            'F002.ply-element: element: expected a name and a count, found "{found}"',
            offset,
            found=brief(" ".join(words[1:])),
        )
    return _Element(words[1], int(words[2]), offset)


def _property(source: Source, others: list[_Property], words: list[str], offset: int) -> _Property:
    kinds, name = (words[2:-1], words[-1]) if words[1:2] == ["list"] else (words[1:-1], words[-1])
    is_list = words[1:2] == ["list"]
    if len(kinds) != 1 + is_list or any(kind not in _TYPES for kind in kinds):
        raise source.fault(
            "F002.ply-property: property: expected a type and a name, or list, two types and a "
            'name, found "{found}"',
            offset,
            found=brief(" ".join(words[1:])),
        )
    if any(prop.name == name for prop in others):
        raise source.fault(
            'F002.ply-property-again: property: expected a unique name, found "{found}" again',
            offset,
            found=brief(name),
        )
    if is_list and _TYPES[kinds[0]].startswith("f"):
        raise source.fault(
            "F002.ply-list-count: property: expected an integer type for the list count, found "
            '"{found}"',
            offset,
            found=brief(kinds[0]),
        )
    return _Property(name, _TYPES[kinds[-1]], _TYPES[kinds[0]] if is_list else "")


@dataclass(slots=True)
class Table:
    """One element's rows."""

    element: _Element
    """Declaration of the element in the header."""
    columns: dict[str, _Numbers] = field(default_factory=dict)
    """dict of str to (N,). Properties of the element that are not lists."""
    lists: dict[str, tuple[_Places, _Numbers]] = field(default_factory=dict)
    """dict of str to ((N,), (M,)). List properties: the number of values of each row, and the
    values of all rows."""
    offset_of: Callable[[int], int] | None = None
    """Returns the offset of a row; slow, for errors only. None in a binary file."""
    is_first: bool = True
    """Whether it is the first element with its name; later ones are read and discarded."""

    def offset(self, row: int) -> int | None:
        """Return the offset of a row in the file; None in a binary file, which has no lines."""
        return None if self.offset_of is None else self.offset_of(row)

    def row(self, row: int) -> Phrase:
        """Return the phrase for a row in messages."""
        return Phrase("{element} {row}", element=brief(self.element.name), row=row)


def read_tables(source: Source, header: Header) -> dict[str, Table]:
    """Read all elements and return them by name."""
    body: _TextRows | _BinaryRows
    body = _BinaryRows(source, header) if header.order else _TextRows(source, header)
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


class _TextRows:
    """Rows of a text file, one per line; words that are not numbers become NaN."""

    def __init__(self, source: Source, header: Header) -> None:
        self.source, self.start = source, header.end
        self._lines = line_sizes(self.data, self.start)
        self.counts = self._lines.words
        self.line = 0
        self._begins: _Places | None = None
        self._firsts: _Places | None = None
        self._values: _Numbers | None = None
        self.has_bad = False  # correct once all values have been parsed

    @property
    def data(self) -> bytes:
        """The file, without a final Ctrl-Z."""
        return self.source.data.rstrip(b"\x1a")

    @property
    def values(self) -> _Numbers:
        """All values; only irregular files need them together."""
        if self._values is None:
            self._values, bad = parse_numbers(self.data, self.start, len(self.data))
            if bad >= 0:
                self._values = parse_words(self.data, self.start, len(self.data))
            self.has_bad = bad >= 0
        return self._values

    @property
    def firsts(self) -> _Places:
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
        found = None if rows is None else _even_text(element, rows)
        if found is None:
            return False
        first = int(self.counts[: self.line].sum(dtype=np.int64))
        table.columns, table.lists = found
        table.offset_of = lambda row: self._offset(first + width * row)
        self.line = last
        return True

    def _even_rows(self, element: _Element, width: int) -> _Numbers | None:
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
                _compact(values.reshape(-1, width)) if has_lists else values.reshape(-1, width)
            )
            report_bytes(end, len(self.data))
        return table.rows()

    def begin(self, element: _Element) -> _Places:
        """Return the first word of each row."""
        _ = self.values  # parsed first, so that invalid words are known
        last = self.line + element.count * bool(element.properties)
        if last > len(self.firsts):
            raise self.source.fault(
                "F002.ply-lines: {element}: expected {expected}, found {found}",
                element.offset,
                element=element.name,
                expected=counted(element.count, "line"),
                found=len(self.firsts) - self.line,
            )
        rows = slice(self.line, last)
        self.rows_left = self.firsts[rows] + self.counts[rows]
        self.line = last
        return self.firsts[rows]

    def offsets(self, cursor: _Places) -> Callable[[int], int] | None:
        """Return a function that finds the offset of a row in the file."""
        return lambda row: self._offset(int(cursor[row]))

    def take(self, table: Table, cursor: _Places, prop: _Property) -> tuple[_Numbers, _Places]:
        """Return the next number of each row."""
        self._need(cursor + 1)
        values = self.values[cursor]
        if self.has_bad:
            rows = np.flatnonzero(np.isnan(values))
            is_place = table.element.name == "vertex" and prop.name in ("x", "y", "z")
            part: Part = "positions" if is_place and table.is_first else ""
            if len(rows):
                item = table.row(int(rows[0]))
                self._refuse_words(cursor[rows], item, part, rows if part else None)
        return values, cursor + 1

    def take_lists(
        self, table: Table, cursor: _Places, prop: _Property
    ) -> tuple[_Places, _Numbers, _Places]:
        """Return the next list of each row."""
        self._need(cursor + 1)
        counts = self.values[cursor]
        whole = np.clip(np.nan_to_num(counts), -(2.0**40), 2.0**40).astype(np.int64)
        wrong = np.flatnonzero((whole != counts) | (whole < 0))
        if len(wrong):
            raise self._no_count(table, int(wrong[0]), int(cursor[wrong[0]]))
        cursor = cursor + 1
        self._need(cursor + whole)
        places = _list_places(cursor, whole, 1)
        values = self.values[places]
        if self.has_bad:
            bad = np.flatnonzero(np.isnan(values))
            rows = np.repeat(np.arange(len(whole)), whole)[bad]
            is_face = table.element.name == "face" and prop.name in CORNERS and table.is_first
            if len(bad):
                lost = triangles_of(whole, rows) if is_face else None
                part: Part = "triangles" if is_face else ""
                self._refuse_words(places[bad], table.row(int(rows[0])), part, lost)
        return whole, values, cursor + whole

    def _refuse_words(
        self, words: _Places, item: Phrase, part: Part = "", places: _Indices | None = None
    ) -> None:
        """Refuse words that are not numbers; the first is in ``item``."""
        first = int(words[0])
        word = self._word(first)
        self.source.refuse(
            number_key(word),
            self._offset(first),
            len(words),
            part,
            places,
            item=item,
            found=quoted(word),
        )

    def _no_count(self, table: Table, row: int, word: int) -> FormatError:
        """Return the error for a list without a valid count."""
        item, found = table.row(row), float(self.values[word])
        if np.isnan(found):
            text = self._word(word)
            return self.source.fault(
                number_key(text), self._offset(word), item=item, found=quoted(text)
            )
        return self.source.fault(wording.PLY_LIST, self._offset(word), item=item, found=found)

    def end(self, element: _Element, cursor: _Places) -> None:
        """Refuse rows with more numbers than their properties need."""
        more = np.flatnonzero(cursor[: len(self.rows_left)] < self.rows_left)
        if len(more) and element.properties:
            self._refuse(int(more[0]), int(cursor[more[0]]))

    def finish(self) -> None:
        """Warn about lines after the last element, and release the text."""
        left = len(self.counts) - self.line
        if left:
            self.source.warn(
                "F006.ply-lines: ignored {n} after the last element", n=counted(left, "line")
            )
            first = self.firsts[self.line]
            words = first + np.flatnonzero(np.isnan(self.values[first:]))
            if len(words):
                self._refuse_words(words, Phrase("after the last element"))
        del self._lines
        self.source.release()

    def _need(self, cursor: _Places) -> None:
        short = np.flatnonzero(cursor > self.rows_left)
        if len(short):
            self._refuse(int(short[0]), int(cursor[short[0]]))

    def _refuse(self, row: int, cursor: int) -> None:
        line = self.line - len(self.rows_left) + row
        first = int(self.firsts[line])
        expected, found, where = cursor - first, int(self.counts[line]), self._offset(first)
        if cursor > self.rows_left[row]:
            raise self.source.fault(
                "F002.ply-fewer: expected at least {expected} numbers on the line, found {found}",
                where,
                expected=expected,
                found=found,
            )
        raise self.source.fault(
            "F002.ply-more: expected {expected} on the line, found {found}",
            where,
            expected=counted(expected, "number"),
            found=found,
        )

    def _word(self, word: int) -> bytes:
        found = _WORD.match(self.data, self._offset(word))
        return b"" if found is None else found.group()

    def _offset(self, word: int) -> int:
        if self._begins is None:
            letters = np.frombuffer(self.data, dtype=np.uint8, offset=self.start)
            self._begins = word_begins(letters)
        return self.start + int(self._begins[word])


class _BinaryRows:
    """Rows of a binary file."""

    def __init__(self, source: Source, header: Header) -> None:
        self.source, self.order = source, header.order
        self.data, self.position = source.data, header.end

    def begin(self, element: _Element) -> _Places:
        """Return the offset of each row; rows of different sizes are followed by their counts."""
        sizes = [int(prop.kind[1]) for prop in element.properties if not prop.count_kind]
        sizes += [int(prop.count_kind[1]) for prop in element.properties if prop.count_kind]
        left = len(self.data) - self.position
        if sum(sizes) * element.count > left:
            raise self._short(element, left)
        if not element.has_lists:
            return self.position + np.arange(element.count, dtype=np.int64) * sum(sizes)
        return self._walked(element)

    def offsets(self, cursor: _Places) -> Callable[[int], int] | None:
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
        found = _even_binary(element, self.data, self.position, self.order, counts)
        if found is None:
            return False
        (table.columns, table.lists), size = found
        self.position += size * element.count
        return True

    def _list_sizes(self, element: _Element, start: int) -> tuple[int, list[int]]:
        """Return the bytes of a row and the lengths of its lists, 0 beyond the end of the file."""
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

    def _walked(self, element: _Element) -> _Places:
        """Return the starts of rows, followed one by one because their lists differ in length."""
        starts = np.empty(element.count, dtype=np.int64)
        place, end = self.position, len(self.data)
        for row in range(element.count):
            starts[row] = place
            place += self._list_sizes(element, place)[0]
            if place > end:
                raise self._short(element, end - self.position)
        return starts

    def take(self, table: Table, cursor: _Places, prop: _Property) -> tuple[_Numbers, _Places]:
        """Return the next number of each row."""
        return self._numbers(cursor, prop.kind)

    def _numbers(self, cursor: _Places, kind: str) -> tuple[_Numbers, _Places]:
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
        self, table: Table, cursor: _Places, prop: _Property
    ) -> tuple[_Places, _Numbers, _Places]:
        """Return the next list of each row."""
        counts, cursor = self._numbers(cursor, prop.count_kind)
        whole = counts.astype(np.int64)
        wrong = np.flatnonzero(whole < 0)
        if len(wrong):
            row = int(wrong[0])
            raise self.source.fault(wording.PLY_LIST, item=table.row(row), found=int(whole[row]))
        size = int(prop.kind[1])
        values, _ = self._numbers(_list_places(cursor, whole, size), prop.kind)
        return whole, values, cursor + whole * size

    def end(self, element: _Element, cursor: _Places) -> None:
        """Continue after the last row."""
        if len(cursor):
            self.position = int(cursor[-1])

    def finish(self) -> None:
        """Warn about bytes after the last element."""
        left = len(self.data) - self.position
        if left:
            self.source.warn(
                "F006.ply-bytes: ignored {n} after the last element", n=counted(left, "byte")
            )

    def _short(self, element: _Element, left: int) -> FormatError:
        return self.source.fault(
            "F002.ply-short: {element}: expected {expected}, found the end of the file after "
            "{size} bytes",
            element.offset,
            element=element.name,
            expected=counted(element.count, "row"),
            size=left,
        )


def _even_text(element: _Element, block: _Numbers) -> _Columns | None:
    """Split numbers into an element's columns (N, C); None if its rows differ or do not fit."""
    lists = [prop.name for prop in element.properties if prop.count_kind]
    width = block.shape[1] - len(element.properties)
    if len(element.properties) == 0 or len(lists) > 1 or width < 0 or (width and not lists):
        return None
    columns: dict[str, _Numbers] = {}
    found: dict[str, tuple[NDArray[np.int64], _Numbers]] = {}
    at = 0
    for prop in element.properties:
        if prop.count_kind:
            if (block[:, at] != width).any():
                return None
            values = _compact(block[:, at + 1 : at + 1 + width])
            found[prop.name] = _equal_counts(len(block), width), values.reshape(-1)
            at += width
        else:
            columns[prop.name] = block[:, at]
        at += 1
    return columns, found


def _even_binary(
    element: _Element, data: bytes, start: int, order: str, counts: list[int]
) -> tuple[_Columns, int] | None:
    """Return columns and bytes per row; None if later lists are not as long as the first row's."""
    left = iter(counts)
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    for number, prop in enumerate(element.properties):
        if prop.count_kind:
            fields += [
                (f"n{number}", order + prop.count_kind),
                (f"v{number}", order + prop.kind, (next(left),)),
            ]
        else:
            fields.append((f"v{number}", order + prop.kind))
    kind = np.dtype(fields)
    if element.count == 0 or start + kind.itemsize * element.count > len(data):
        return None
    rows = np.frombuffer(data, dtype=kind, count=element.count, offset=start)
    columns: dict[str, _Numbers] = {}
    found: dict[str, tuple[NDArray[np.int64], _Numbers]] = {}
    for number, prop in enumerate(element.properties):
        values = rows[f"v{number}"]
        if prop.count_kind:
            width = values.shape[1]
            if (rows[f"n{number}"] != width).any():
                return None
            flat = values.astype(prop.kind, copy=False).reshape(-1)
            found[prop.name] = _equal_counts(len(rows), width), flat
        else:
            columns[prop.name] = values
    return (columns, found), kind.itemsize


def _compact(values: _Numbers) -> _Numbers:
    """Return whole numbers as int32, of half the size, and others unchanged."""
    fits = values.size and values.min() > -_WHOLE and values.max() < _WHOLE
    if values.dtype == np.int32 or not fits:
        return values
    whole = values.astype(np.int32)
    return whole if (whole == values).all() else values


def _equal_counts(count: int, size: int) -> NDArray[np.int64]:
    # A single number represents all equal counts.
    return np.broadcast_to(np.int64(size), (count,))


def _list_places(starts: _Places, counts: _Places, step: int) -> _Places:
    """Return the positions of all values of lists that begin at ``starts``."""
    total = np.cumsum(counts) - counts
    return np.repeat(starts - total * step, counts) + np.arange(counts.sum()) * step


@dataclass(frozen=True, slots=True, eq=False)
class _LineSizes:
    """Non-blank lines of a text."""

    data: bytes
    """The text."""
    words: NDArray[np.int32]
    """(L,). Number of words in each line."""
    marks: list[tuple[int, int]]
    """Offset of each piece of the text, and the number of lines before it."""

    def offset(self, line: int) -> int:
        """Return an offset between a line's words and the previous line's, or that of the end."""
        if line >= len(self.words):
            return len(self.data)
        place = bisect.bisect_right(self.marks, line, key=lambda mark: mark[1]) - 1
        start, before = self.marks[place]
        end = self.marks[place + 1][0] if place + 1 < len(self.marks) else len(self.data)
        counts, ends = _counts(self.data, start, end)
        return start + int(np.append(0, ends)[np.flatnonzero(counts)[line - before]])


def line_sizes(data: bytes, start: int) -> _LineSizes:
    """Return the number of words in each non-blank line, from an offset to the end."""
    sizes = [np.zeros(0, np.int32)]
    marks, n_lines = [(start, 0)], 0
    while start < len(data):
        found = _LINE_END.search(data, min(start + _PIECE, len(data)))
        end = found.end() if found else len(data)
        counts, _ = _counts(data, start, end)
        sizes.append(counts[counts > 0])
        n_lines += len(sizes[-1])
        start = end
        marks.append((start, n_lines))
    return _LineSizes(data, np.concatenate(sizes), marks)


def _counts(data: bytes, start: int, end: int) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Return the number of words in each line of a piece, and the offsets of line ends in it."""
    letters = np.frombuffer(data, dtype=np.uint8, count=end - start, offset=start)
    begins = word_begins(letters)
    ends = np.append(line_ends(letters), len(letters))
    return np.diff(np.searchsorted(begins, ends), prepend=0).astype(np.int32), ends
