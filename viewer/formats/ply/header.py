"""Header of a ``.ply``: its elements, their properties, and the start of the data."""

from __future__ import annotations

import re
from dataclasses import field

from viewer.data_classes import dataclass
from viewer.errors import FormatError
from viewer.formats._source import Source
from viewer.phrases import brief, listed, quoted

CORNERS = ("vertex_indices", "vertex_index")
"""Names of the property that lists a face's vertices."""
TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_LINE = re.compile(rb"([^\r\n]*)(\r\n|\r+\n|\n|\r|\Z)")
_LONGEST = 1 << 20  # maximum size of a header, bytes


@dataclass(frozen=True, slots=True)
class Property:
    """One property: its type in numpy's notation, and the type of the count if it is a list."""

    name: str
    kind: str
    count_kind: str = ""


@dataclass(slots=True)
class Element:
    """Consecutive rows with the same properties."""

    name: str
    count: int
    offset: int
    properties: list[Property] = field(default_factory=list)

    @property
    def has_lists(self) -> bool:
        """Whether rows may have different sizes."""
        return any(prop.count_kind for prop in self.properties)


@dataclass(slots=True)
class Header:
    """Contents of a file."""

    order: str = ""
    """One of "", "<" or ">". Byte order; empty for text."""
    elements: list[Element] = field(default_factory=list)
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


def _element(source: Source, words: list[str], offset: int) -> Element:
    is_count = len(words) == 3 and words[2].isascii() and words[2].isdecimal()
    if not is_count or len(words[2]) > 18:
        raise source.fault(
            'F002.ply-element: element: expected a name and a count, found "{found}"',
            offset,
            found=brief(" ".join(words[1:])),
        )
    return Element(words[1], int(words[2]), offset)


def _property(source: Source, others: list[Property], words: list[str], offset: int) -> Property:
    kinds, name = (words[2:-1], words[-1]) if words[1:2] == ["list"] else (words[1:-1], words[-1])
    is_list = words[1:2] == ["list"]
    if len(kinds) != 1 + is_list or any(kind not in TYPES for kind in kinds):
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
    if is_list and TYPES[kinds[0]].startswith("f"):
        raise source.fault(
            "F002.ply-list-count: property: expected an integer type for the list count, found "
            '"{found}"',
            offset,
            found=brief(kinds[0]),
        )
    return Property(name, TYPES[kinds[-1]], TYPES[kinds[0]] if is_list else "")
