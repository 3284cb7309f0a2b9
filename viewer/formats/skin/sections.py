"""Parser for the sections of a ``.skin`` file; ``checks.py`` checks the arrays that it returns."""

from __future__ import annotations

import re
from dataclasses import field

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase, wording
from viewer.formats._mesh.texture import load_image
from viewer.formats._source import Source
from viewer.formats._text.numbers import is_number, parse_few
from viewer.formats.skin.tables import (
    KEYWORDS,
    OffsetOf,
    find_block,
    read_count,
    read_rows,
    unclosed,
    whole_corners,
    words_of,
)
from viewer.formats.skin.weights import read_weights
from viewer.phrases import counted, quoted
from viewer.rig.arrays import Bytes, Floats, Ints
from viewer.rig.material import Material, Texture

_WIDTHS = {"positions": 3, "normals": 3, "texcoords": 2}
# A file name may contain spaces: it extends to the end of the line.
_FILE_NAME = re.compile(rb"[ \t\n\r\v\f]*([^\r\n{}]*)")
_IDENTITY: Floats = np.eye(4, 3).ravel()  # four rows of three, as in the file
_Word = re.Match[bytes]


@dataclass(frozen=True, slots=True)
class _TriangleRun:
    """One triangles section."""

    triangles: Ints
    """(M, 3). Vertex indices."""
    material: int
    """Index of the preceding material, -1 for none."""
    offset_of: OffsetOf
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
            position = _skip(source, word)
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
        starts, joints, weights, offset_of = read_weights(source, block, count)
        source.remember("weights", offset_of)
        sections.starts, sections.joints, sections.weights = starts, joints, weights
    elif name == "triangles":
        first = sections.n_triangles
        rows, offset_of = read_rows(source, block, count, 3, first, "triangle {index}")
        corners = whole_corners(source, rows, offset_of, first)
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
            position = _skip_item(source, word)
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


def _skip_item(source: Source, word: _Word) -> int:
    """Return the offset after an unknown item: after its numbers or its balanced block."""
    position, depth = word.end(), int(word.group() == b"{")
    while (following := source.next_word(position)) is not None:
        text = following.group()
        if depth == 0 and text != b"{" and not is_number(text):
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
    words = words_of(source, block) if bad >= 0 else None
    if not block.closed:
        raise unclosed(source, block, source.end, None)
    if words is not None:
        from viewer.formats._text.words import refuse_words

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


def _skip(source: Source, word: _Word) -> int:
    """Return the offset after an unknown section: after its numbers or its balanced block."""
    depth = 0
    position = word.start()
    while (following := source.next_word(position)) is not None:
        text = following.group()
        if depth == 0 and position > word.start() and (text in KEYWORDS or text == b"}"):
            return following.start()
        depth += {b"{": 1, b"}": -1}.get(text, 0)
        position = following.end()
        if text == b"}" and depth == 0:
            return position
    if depth:
        raise source.fault(wording.OPEN, word.start(), word=quoted(word.group()))
    return position
