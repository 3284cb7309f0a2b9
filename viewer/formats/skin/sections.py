"""Parser for the sections of a ``.skin`` file, whose arrays ``skin.read`` checks.

A valid block of numbers is parsed as a whole. Otherwise every word is examined: each error is
recorded and the value replaced by NaN. Line breaks have no meaning in the format, but most files
have one vertex or triangle per line. In this case, a line of the wrong length does not affect the
others.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Part, Phrase, wording
from viewer.errors import FormatError
from viewer.formats._references import load_image
from viewer.formats._source import Source
from viewer.formats._text.number_text import dumped
from viewer.formats._text.numbers import is_number, parse_few, parse_numbers, to_number
from viewer.formats._text.words import Words, read_words, refuse_words
from viewer.phrases import bare, counted, optional, quoted
from viewer.rigs.arrays import Bytes, Floats, Ints
from viewer.rigs.material import Material, Texture
from viewer.rigs.skin import Skin

KEYWORDS = frozenset(
    (b"positions", b"normals", b"texcoords", b"skinweights", b"material", b"triangles", b"bindings")
)
"""Keywords of sections."""
LOST = -(2**31)
"""Placeholder for a corner that is not an integer."""
_INT32 = 2.0**31  # numbers below it, and at least its negative, fit into an int32
_PARTS: dict[str, Part] = {"positions": "positions", "triangles": "triangles"}
_Places = NDArray[np.int64]
_OffsetOf = Callable[[int], int]
"""Returns the offset of the element with an index; slow, for errors only."""
_WIDTHS = {"positions": 3, "normals": 3, "texcoords": 2}

# A file name may contain spaces: it extends to the end of the line.
_FILE_NAME = re.compile(rb"[ \t\n\r\v\f]*([^\r\n{}]*)")
_LEAP = 16  # number of vertices that each step of the Python loop skips
_SMALL = 1 << 29  # maximum count of numbers for which three times the count fits into an int32
_AT_ONCE = 2048  # number of vertices that are formatted together
Influences = tuple[Ints, Ints, Floats, _OffsetOf]
_IDENTITY: Floats = np.eye(4, 3).ravel()  # four rows of three, as in the file
_Word = re.Match[bytes]


@dataclass(frozen=True, slots=True)
class _TriangleRun:
    """One triangles section."""

    triangles: Ints
    """(M, 3). Vertex indices."""
    material: int
    """Index of the preceding material, -1 for none."""
    offset_of: _OffsetOf
    """Returns the offset of a triangle."""


@dataclass(slots=True)
class Sections:
    """All sections of a ``.skin`` file; None or empty if a section is missing."""

    tables: dict[str, Floats] = field(default_factory=dict)
    starts: Ints | None = None
    joints: Ints = field(default_factory=lambda: np.zeros(0, np.int32))
    weights: Floats = field(default_factory=lambda: np.zeros(0))
    materials: list[Material] = field(default_factory=list)
    pictures: dict[str, Bytes | None] = field(default_factory=dict)
    triangles: list[_TriangleRun] = field(default_factory=list)
    n_triangles: int = 0  # number of triangles in all sections read so far
    bindings: Floats | None = None
    offsets: dict[str, int] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)  # numbers of rows as declared by the file

    def triangle_offset(self, triangle: int) -> int:
        """Return the offset of a triangle, numbered across all sections."""
        ends = np.cumsum([len(run.triangles) for run in self.triangles])
        run = int(np.searchsorted(ends, triangle, side="right"))
        first = int(ends[run]) - len(self.triangles[run].triangles)
        return self.triangles[run].offset_of(triangle - first)


def read_sections(source: Source) -> Sections:
    """Split a file into its sections and parse their numbers."""
    sections = Sections()
    extra_braces = 0
    position = 0
    while (word := source.next_word(position)) is not None:
        name = word.group()
        if name in KEYWORDS:
            position = _read_section(source, sections, word)
        elif name == b"}":
            extra_braces += 1
            position = word.end()
        else:
            source.warn(
                "F006.skin-section: ignored unknown section {found}",
                word.start(),
                found=quoted(name),
            )
            position = _skip(source, word, lambda text: text in KEYWORDS or text == b"}")
    if extra_braces:
        source.warn('F006.skin-braces: ignored {n} "}}" outside any section', n=extra_braces)
    return sections


def _read_section(source: Source, sections: Sections, word: _Word) -> int:
    """Read one section and return the offset after it."""
    name = word.group().decode()
    if name in sections.offsets and name not in ("triangles", "material"):
        source.warn(
            "F007.skin-again: repeated {section} section: the last one is used",
            word.start(),
            section=name,
        )
        check_declared(source, sections, name)
    sections.offsets[name] = word.start()
    if name == "material":
        material, position = _read_material(source, word, sections.pictures)
        sections.materials.append(material)
        return position
    count, position = read_count(source, name, word)
    if name == "bindings":
        sections.bindings, position = _read_bindings(source, count, position)
        return position
    block = find_block(source, name, word, position)
    sections.counts[name] = count
    if name == "skinweights":
        starts, joints, weights, offset_of = _read_weights(source, block, count)
        source.remember("weights", offset_of)
        sections.starts, sections.joints, sections.weights = starts, joints, weights
    elif name == "triangles":
        first = sections.n_triangles
        rows, offset_of = read_rows(source, block, count, 3, first, "triangle {index}")
        corners = _whole_corners(source, rows, offset_of, first)
        run = _TriangleRun(corners, len(sections.materials) - 1, offset_of)
        sections.triangles.append(run)
        sections.n_triangles += len(corners)
    else:
        sections.tables[name], offset_of = read_rows(source, block, count, _WIDTHS[name])
        source.remember(name, offset_of)
    if not block.closed:
        source.warn(wording.LAST_BRACE, section=name)
    return block.end + block.closed


def check_declared(source: Source, sections: Sections, name: str) -> None:
    """Refuse a table or weights whose number of vertices differs from the declared count."""
    if name not in sections.counts or name == "triangles":
        return
    found = len(sections.tables.get(name, ()))
    if name == "skinweights" and sections.starts is not None:
        found = len(sections.starts) - 1
    declared = sections.counts[name]
    if declared != found:
        offset = sections.offsets[name]
        source.refuse(wording.SKIN_DECLARED, offset, section=name, expected=declared, found=found)


def _read_material(
    source: Source, header: _Word, pictures: dict[str, Bytes | None]
) -> tuple[Material, int]:
    """Read one material with its image, if it can be read, and the offset after the section."""
    name, brace = _material_name(source, header)
    texture: str | None = None
    named = header.start()
    position = brace.end()
    while (word := source.next_word(position)) is not None and word.group() != b"}":
        if word.group() == b"texture":
            rest = _FILE_NAME.match(source.data, word.end())
            assert rest is not None  # the pattern also matches the empty string
            texture = rest[1].strip().decode("utf-8", "surrogateescape") or None
            named, position = word.start(), rest.end()
        else:
            source.warn(
                "F006.skin-material: ignored unknown material property {found}",
                word.start(),
                found=quoted(word.group()),
            )
            position = _skip(source, word, lambda text: text != b"{" and not is_number(text))
    if word is None:
        line = source.line(header.start())
        raise source.fault(
            wording.UNCLOSED, source.end, section="material", line=line, found=quoted(None)
        )
    if texture is None:
        source.warn(
            "F005.skin-material: material without a texture: drawn untextured", header.start()
        )
        return Material(name), word.end()
    if texture not in pictures:
        pictures[texture] = load_image(source, texture, named)
    return Material(name, Texture(texture, pictures[texture])), word.end()


def _material_name(source: Source, header: _Word) -> tuple[str, _Word]:
    """Return the words up to the opening brace, which are no keywords, and that brace."""
    words: list[bytes] = []
    word = source.next_word(header.end())
    while word is not None and word.group() not in (b"{", b"}") and word.group() not in KEYWORDS:
        words.append(word.group())
        word = source.next_word(word.end())
    if word is None or word.group() != b"{":
        where = header.start() if word is None else word.start()
        raise source.fault(
            wording.SKIN_BRACE, where, section="material", found=quoted(word and word.group())
        )
    return b" ".join(words).decode("utf-8", "surrogateescape"), word


def _skip(source: Source, word: _Word, ends: Callable[[bytes], bool]) -> int:
    """Return the offset after an unknown item: after its words, or its balanced block."""
    position, depth = word.start(), 0
    while (following := source.next_word(position)) is not None:
        text = following.group()
        if depth == 0 and position > word.start() and ends(text):
            return position
        depth += {b"{": 1, b"}": -1}.get(text, 0)
        position = following.end()
        if text == b"}" and depth == 0:
            return position
    if depth:
        raise source.fault(wording.OPEN, word.start(), word=quoted(word.group()))
    return position


def _read_bindings(source: Source, count: int, position: int) -> tuple[Floats, int]:
    """Return each B = [a b c d; 0 0 0 1], (count, 4, 4), and the offset after the section."""
    stated = position - 1
    word = source.next_word(position)
    if word is not None and word.group() == b"{":
        position = word.end()
    matrices: list[Floats] = []
    offsets: list[int] = []
    while (word := source.next_word(position)) is not None and word.group() == b"matrix":
        rows, position = _read_matrix(source, len(matrices), word)
        matrices.append(rows)
        offsets.append(word.start())
    source.remember("bindings", offsets.__getitem__)
    if len(matrices) != count:
        is_whole = word is not None and word.group() == b"}"
        end = source.end if word is None else word.start()
        then = word and word.group()
        found = len(matrices)
        # The error is located at the count or, if the file is truncated, at its end.
        if not is_whole:
            line = source.line(stated)
            raise source.fault(
                "F002.skin-bindings-end: bindings (from line {line}): expected {expected}, found "
                "{found} followed by {then}",
                end,
                line=line,
                expected=counted(count, "matrix"),
                found=counted(found, "matrix"),
                then=quoted(then),
            )
        line = source.line(end)
        source.refuse(
            "B001.skin-count: bindings (to line {line}): expected {expected}, found {found} "
            "followed by {then}",
            stated,
            line=line,
            expected=counted(count, "matrix"),
            found=counted(found, "matrix"),
            then=quoted(then),
        )
    if word is None:
        source.warn(wording.LAST_BRACE, section="bindings")
    elif word.group() != b"}":
        raise source.fault(
            'F002.skin-bindings-brace: bindings: expected "}}", found {found}',
            word.start(),
            found=quoted(word.group()),
        )
    bindings = np.tile(np.eye(4), (len(matrices), 1, 1))
    if matrices:
        bindings[:, :3, :] = np.array(matrices).reshape(-1, 4, 3).transpose(0, 2, 1)
    return bindings, len(source.data) if word is None else word.end()


def _read_matrix(source: Source, index: int, word: _Word) -> tuple[Floats, int]:
    block = find_block(source, f"matrix {index} of bindings", word, word.end())
    values, bad = parse_few(source.data[block.start : block.end])
    words = _words_of(source, block) if bad >= 0 else None
    if not block.closed:
        raise _unclosed(source, block, source.end, None)
    if words is not None:
        places = np.full(len(words.bad), index)
        item = Phrase("bindings matrix {index}", index=index)
        refuse_words(source, words, words.bad, lambda _: item, "bindings", places)
        return _IDENTITY, block.end + 1
    if len(values) != len(_IDENTITY):
        source.refuse(
            wording.WIDTH,
            word.start(),
            1,
            "bindings",
            [index],
            item=Phrase("bindings matrix {index}", index=index),
            expected=counted(len(_IDENTITY), "number"),
            found=len(values),
        )
        return _IDENTITY, block.end + 1
    return values, block.end + 1


@dataclass(frozen=True, slots=True)
class _Block:
    """Range of a section's numbers, from which the line of an error is determined."""

    name: str
    """Keyword of the section."""
    header: int
    count: int
    """Offsets of the keyword and of the number of entries."""
    start: int
    end: int
    """Range of the numbers."""
    closed: bool
    """Whether a closing brace follows them."""


def find_block(source: Source, name: str, header: _Word, position: int) -> _Block:
    """Return the range of a section's numbers; weights may omit the opening brace."""
    stated = position - 1
    brace = source.next_word(position)
    if brace is not None and brace.group() == b"{":
        position = brace.end()
    elif name != "skinweights":
        where = header.start() if brace is None else brace.start()
        raise source.fault(
            wording.SKIN_BRACE, where, section=name, found=quoted(brace and brace.group())
        )
    end = source.data.find(b"}", position)
    closed = end >= 0
    return _Block(
        name, header.start(), stated, position, end if closed else len(source.data), closed
    )


def read_count(source: Source, name: str, word: _Word) -> tuple[int, int]:
    """Return a section's count and the offset after it; refuse counts that do not fit the file."""
    found = source.next_word(word.end())
    value = None if found is None else to_number(found.group())
    if found is None or value is None or value != int(value) or value < 0:
        at = word.start() if found is None else found.start()
        raise source.fault(
            wording.COUNT, at, item=name, found=quoted(found.group() if found else None)
        )
    # An entry takes at least two bytes: one character, and white space before it.
    left = len(source.data) - found.end()
    if value * 2 > left + 1:
        raise source.fault(
            "F002.skin-too-many: {section}: expected a count that fits the file, found {found} "
            "entries in {size} bytes",
            found.start(),
            section=name,
            found=int(value),
            size=left,
        )
    return int(value), found.end()


def read_rows(
    source: Source,
    block: _Block,
    count: int,
    width: int,
    first: int = 0,
    item: str = "{section} of vertex {index}",
) -> tuple[Floats, _OffsetOf]:
    """Parse rows (N, width), NaN in invalid ones; returns also what finds a row's offset."""
    values, bad = parse_numbers(source.data, block.start, block.end)
    if bad < 0 and len(values) == count * width:
        values.flags.writeable = False  # the mesh can use a read-only array without a copy
        begin, end = block.start, block.end
        return values.reshape(count, width), lambda row: source.number_offset(
            begin, end, width * row
        )
    rows, offsets = _faulty_rows(source, block, count, width, first, item)
    return rows, lambda row: int(offsets[row])


def _faulty_rows(
    source: Source, block: _Block, count: int, width: int, first: int, item: str
) -> tuple[Floats, _Places]:
    def named(row: int) -> Phrase:
        return Phrase(item, section=block.name, index=row)

    words = _words_of(source, block)
    begins, sizes = _row_begins(source, block, words, count, width)
    fits = sizes == width
    rows = np.full((len(begins), width), np.nan)
    rows[fits] = words.values[begins[fits, None] + np.arange(width)]
    part = _PARTS.get(block.name, "")
    owners = np.repeat(np.arange(len(begins)), sizes) + first
    bad = words.bad
    refuse_words(source, words, bad, lambda word: named(int(owners[word])), part, owners[bad])
    wrong = np.flatnonzero(~fits)
    if len(wrong):
        source.refuse(
            wording.WIDTH,
            int(words.offsets[begins[wrong[0]]]),
            len(wrong),
            part,
            wrong + first,
            item=named(int(wrong[0]) + first),
            expected=counted(width, "number"),
            found=int(sizes[wrong[0]]),
        )
    if block.name == "triangles" and len(begins) != count:
        source.refuse(
            "F002.skin-triangle-rows: triangles: expected {expected} rows of 3 numbers, found "
            "{found}",
            block.header,
            expected=count,
            found=len(begins),
        )
    return rows, words.offsets[begins]


def _row_begins(
    source: Source, block: _Block, words: Words, count: int, width: int
) -> tuple[_Places, _Places]:
    """Return the first word and the number of words of each row."""
    total = len(words.values)
    if total != count * width:
        begins, sizes = words.rows()
        if block.closed and (sizes == width).sum() * 2 >= len(sizes):
            return begins, sizes
        if not block.closed:
            raise source.fault(
                'F002.skin-rows-end: expected "}}" to close {section} (line {line}), found the '
                "end of the file after {found} of {expected} rows",
                source.end,
                section=block.name,
                line=source.line(block.header),
                found=total // width,
                expected=count,
            )
        if total % width:
            raise source.fault(
                "F002.skin-rows: {section}: expected {expected} rows of {width} numbers, found "
                "{found}{rest} (to line {end})",
                block.count,
                section=block.name,
                expected=count,
                width=width,
                found=total // width,
                rest=optional(" and {} numbers", total % width),
                end=source.line(block.end),
            )
    begins = np.arange(0, total, width)
    return begins, np.full(len(begins), width)


def _words_of(source: Source, block: _Block) -> Words:
    """Return the words of a block, which must be closed before the keyword of another section."""
    words = read_words(source.data, block.start, block.end)
    for index in words.bad.tolist():
        word = words.word(index)
        if word in KEYWORDS or b"{" in word:
            raise _unclosed(source, block, int(words.offsets[index]), word)
    return words


def _unclosed(source: Source, block: _Block, offset: int, found: bytes | None) -> FormatError:
    """Return the error for a block interrupted by ``found``, or by the end of the file if None."""
    line = source.line(block.header)
    return source.fault(
        wording.UNCLOSED, offset, section=block.name, line=line, found=quoted(found)
    )


def _whole_corners(source: Source, rows: Floats, offset_of: _OffsetOf, first: int) -> Ints:
    """Return corners (T, 3) as integers; ``LOST`` for invalid ones, with their errors recorded."""
    known = ~np.isnan(rows)
    if known.all():
        corners, changed = to_whole(rows)
        if changed < 0:
            return corners
    corners, _ = to_whole(np.where(known, rows, LOST))
    wrong = known & (corners != rows)
    triangles = np.flatnonzero(wrong.any(axis=1))
    if len(triangles):
        row = int(triangles[0])
        source.refuse(
            "F002.skin-corner: triangle {triangle}: expected a vertex index, found {found:g}",
            offset_of(row),
            int(wrong.sum()),
            "triangles",
            triangles + first,
            triangle=row + first,
            found=float(rows[row][wrong[row]][0]),
        )
    return np.where(wrong, LOST, corners).astype(np.int32)


def to_whole(values: Floats) -> tuple[Ints, int]:
    """Return numbers as int32, and the index of the first number that conversion changed, or -1."""
    whole = np.clip(values, -_INT32, _INT32 - 1).astype(np.int32)
    differs = whole != values
    whole.flags.writeable = False  # a read-only array need not be copied
    return whole, int(differs.argmax()) if differs.any() else -1


def _read_weights(source: Source, block: _Block, count: int) -> Influences:
    """Parse the influences of all vertices; an unreadable vertex has none, recorded as an error."""
    values, bad = parse_numbers(source.data, block.start, block.end)
    heads = _find_heads(values, count) if bad < 0 else None
    found = None if heads is None else _whole_influences(source, block, values, heads)
    return _faulty_influences(source, block, count) if found is None else found


def _find_heads(values: Floats, count: int) -> NDArray[np.integer] | None:
    """Return the positions of the vertices' counts (V,); None if they do not fill the block."""
    size = len(values)
    if count == 0:
        return None if size else np.zeros(0, np.int32)
    # There are two extra positions, the end of the block and one beyond it; both map to the second.
    kind: type[np.int32] | type[np.int64] = np.int32 if size < _SMALL else np.int64
    after = np.full(size + 2, size + 1, dtype=kind)
    counts: NDArray[Any] = np.clip(values, 0, size).astype(kind)
    is_count = counts == values
    counts *= 2
    counts += np.arange(1, size + 1, dtype=kind)
    is_count &= counts <= size
    np.copyto(after[:size], counts, where=is_count)
    # Each count determines the position of the next: a linked list. The map from each position to
    # the next, composed with itself four times, lets a step of the loop skip 16 vertices.
    leap = after
    for _ in range(_LEAP.bit_length() - 1):
        leap = leap[leap]
    anchors = [0]
    for _ in range((count - 1) // _LEAP):
        anchors.append(int(leap[anchors[-1]]))
    columns = [np.array(anchors, dtype=kind)]
    for _ in range(_LEAP - 1):
        columns.append(after[columns[-1]])
    heads = np.stack(columns, axis=1).ravel()[:count]
    fills = heads[-1] < size and after[heads[-1]] == size
    return heads if fills else None


def _whole_influences(
    source: Source, block: _Block, values: Floats, heads: NDArray[np.integer]
) -> Influences | None:
    """Return all influences, or None if a joint is not an integer."""
    is_pair = np.ones(len(values), dtype=bool)
    is_pair[heads] = False
    pairs = values[is_pair].reshape(-1, 2)
    joints, wrong = to_whole(pairs[:, 0])
    if wrong >= 0:
        return None
    starts = np.zeros(len(heads) + 1, dtype=np.int32)
    np.cumsum(values[heads].astype(np.int32), out=starts[1:])
    weights = pairs[:, 1].copy()
    # The skin can use read-only arrays without a copy.
    starts.flags.writeable = weights.flags.writeable = False
    begin, end = block.start, block.end

    def offset_of(vertex: int) -> int:
        # The vertex's words follow one count per earlier vertex and two words per earlier
        # influence.
        return source.number_offset(begin, end, vertex + 2 * int(starts[vertex]))

    return starts, joints, weights, offset_of


def _faulty_influences(source: Source, block: _Block, count: int) -> Influences:
    words = _words_of(source, block)
    known = np.where(np.isnan(words.values), -1.0, words.values)
    found = _find_heads(known, count)
    if found is not None:
        heads = found.astype(np.int64)
        fits = np.ones(len(heads), dtype=np.bool_)
    else:
        heads, sizes = words.rows()
        # Each line has a count, followed by pairs.
        fits = known[heads] * 2 + 1 == sizes
        if not block.closed or fits.sum() * 2 <= len(fits):
            raise _no_influences(source, block, words, known, count)
    after = np.append(heads[1:], len(words.values))
    _refuse_lines(source, words, heads, np.flatnonzero(~fits), after)
    counts = np.where(fits, known[heads], 0).astype(np.int32)
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    owners = np.repeat(np.arange(len(heads)), counts)
    # The joint of an influence comes after the vertex's count and two words per earlier influence.
    places = heads[owners] + 1 + 2 * (np.arange(len(owners)) - starts[owners])
    # Both joint and weight become 0 if either is not a number.
    joints, weights = words.values[places], words.values[places + 1]
    bad = np.flatnonzero(np.isnan(np.stack([joints, weights], axis=1)).any(axis=1))
    at = np.where(np.isnan(joints[bad]), places[bad], places[bad] + 1)
    vertices = dict(zip(at.tolist(), owners[bad].tolist(), strict=True))
    refuse_words(
        source,
        words,
        at,
        lambda word: Phrase(
            "{section} of vertex {index}", section="skinweights", index=vertices[word]
        ),
        "weights",
        owners[bad],
    )
    whole, _ = to_whole(np.nan_to_num(joints, nan=0.0))
    wrong = np.flatnonzero(~np.isnan(joints) & (whole != joints))
    if len(wrong):
        place = int(places[wrong[0]])
        source.refuse(
            "F002.skin-joint: skinweights of vertex {vertex}: expected a joint index, found "
            "{found}",
            int(words.offsets[place]),
            len(wrong),
            "weights",
            owners[wrong],
            vertex=int(owners[wrong[0]]),
            found=quoted(words.word(place)),
        )
    lost = np.isnan(joints) | np.isnan(weights) | (whole != joints)
    kept = np.where(lost, 0, whole).astype(np.int32), np.where(lost, 0.0, weights)
    offsets = words.offsets[heads]
    return starts, *kept, lambda vertex: int(offsets[vertex])


def _refuse_lines(
    source: Source, words: Words, heads: _Places, vertices: _Places, after: _Places
) -> None:
    """Refuse lines whose number of words contradicts their first word."""
    if len(vertices) == 0:
        return
    vertex = int(vertices[0])
    head = int(heads[vertex])
    is_count = words.values[head] >= 0 and words.values[head] % 1 == 0
    key, values = wording.SKIN_INFLUENCE_COUNT, dict[str, object](found=quoted(words.word(head)))
    if is_count:
        key = (
            "F002.skin-influences: skinweights of vertex {vertex}: expected {pairs} "
            "joint-weight pairs, found {found} numbers on the line"
        )
        values = {"pairs": bare(words.word(head)), "found": int(after[vertex]) - head - 1}
    offset, count = int(words.offsets[head]), len(vertices)
    source.refuse(key, offset, count, "weights", vertices, vertex=vertex, **values)


def _no_influences(
    source: Source, block: _Block, words: Words, known: Floats, count: int
) -> FormatError:
    """Return the error for the first wrong count, found by following the counts one by one."""
    numbers = known.tolist()
    heads: list[int] = []
    position = 0
    while position < len(numbers) and len(heads) < count:
        heads.append(position)
        length = numbers[position]
        if length < 0 or length != int(length):
            return source.fault(
                wording.SKIN_INFLUENCE_COUNT,
                int(words.offsets[position]),
                vertex=len(heads) - 1,
                found=quoted(words.word(position)),
            )
        position += 1 + 2 * int(length)
    if not block.closed:
        return source.fault(
            'F002.skin-weights-end: expected "}}" to close skinweights (line {line}), found '
            "the end of the file after {found} of {expected} vertices",
            source.end,
            line=source.line(block.header),
            found=len(heads),
            expected=count,
        )
    if len(heads) < count:
        end = source.line(block.end)
        return source.fault(
            "F002.skin-weights: skinweights: expected {expected} vertices, found {found} (to "
            "line {end})",
            block.count,
            expected=count,
            found=len(heads),
            end=end,
        )
    if count == 0:
        return source.fault(
            "F002.skin-no-weights: skinweights: expected no vertices, found {found} numbers",
            block.count,
            found=len(words.values),
        )
    head = heads[-1]
    return source.fault(
        "F002.skin-influences-end: skinweights of last vertex {vertex}: expected {pairs} "
        "joint-weight pairs, found {found} numbers before the closing brace",
        int(words.offsets[head]),
        vertex=count - 1,
        pairs=bare(words.word(head)),
        found=len(words.values) - head - 1,
    )


def weights_lines(skin: Skin) -> Iterator[bytes]:
    """Yield the lines of the section in parts: a count, and pairs of a joint and a weight."""
    for first in range(0, skin.n_vertices, _AT_ONCE):
        starts = skin.starts[first : first + _AT_ONCE + 1]
        used = slice(int(starts[0]), int(starts[-1]))
        words = [b""] * (2 * (used.stop - used.start))
        words[0::2] = _words(skin.joints[used])
        words[1::2] = _words(skin.weights[used])
        ends = (2 * (starts - starts[0])).tolist()
        lines = [
            b" ".join([b"  %d" % ((last - begin) // 2), *words[begin:last]])
            for begin, last in pairwise(ends)
        ]
        yield b"\n".join([*lines, b""])


def _words(values: Ints | Floats) -> list[bytes]:
    return dumped(values)[1:-1].split(b",") if len(values) else []
