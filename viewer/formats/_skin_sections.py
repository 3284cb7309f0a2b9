"""The sections of a ``.skin`` file as arrays: what is where, before anything is judged."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from viewer.errors import FormatError
from viewer.formats._numbers import parse_numbers, to_number
from viewer.formats._skin_material import read_material
from viewer.formats._source import Source, shown
from viewer.rig.arrays import Bools, Bytes, Floats, Ints
from viewer.rig.mesh import Material

__all__ = ["KEYWORDS", "Block", "Sections", "TriangleRun", "read_sections"]

_WIDTHS = {"positions": 3, "normals": 3, "texcoords": 2}
KEYWORDS = frozenset(
    (b"positions", b"normals", b"texcoords", b"skinweights", b"material", b"triangles", b"bindings")
)
"""Words that begin a section."""


Word = re.Match[bytes]


@dataclass(frozen=True, slots=True)
class Block:
    """Where the numbers of a section are, to find a word again when an error needs its line."""

    name: str
    header: int
    start: int
    end: int
    closed: bool


@dataclass(frozen=True, slots=True)
class TriangleRun:
    """One triangles section: (M, 3) vertex indices and the material before it, -1 for none."""

    triangles: Ints
    material: int
    block: Block


@dataclass(slots=True)
class Sections:
    """Everything a ``.skin`` file holds; None or empty where a section is missing."""

    tables: dict[str, Floats] = field(default_factory=dict)
    starts: Ints | None = None
    joints: Ints = field(default_factory=lambda: np.zeros(0, np.int32))
    weights: Floats = field(default_factory=lambda: np.zeros(0))
    materials: list[Material] = field(default_factory=list)
    pictures: dict[str, Bytes | None] = field(default_factory=dict)
    triangles: list[TriangleRun] = field(default_factory=list)
    bindings: Floats | None = None
    offsets: dict[str, int] = field(default_factory=dict)
    blocks: dict[str, Block] = field(default_factory=dict)


def read_sections(source: Source) -> Sections:
    """Split a file into its sections and parse their numbers.

    Parameters
    ----------
    source : Source
        The file.

    Raises
    ------
    FormatError
        With file and line, if the text breaks the grammar.
    """
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
            source.warn(f"skipped unknown section {shown(name)}", word.start())
            position = _skip(source, word)
    if extra_braces:
        source.warn(f'ignored {extra_braces} "}}" outside all sections')
    return sections


def _read_section(source: Source, sections: Sections, word: Word) -> int:
    """Read one section and return the offset behind it."""
    name = word.group().decode()
    if name in sections.offsets and name not in ("triangles", "material"):
        source.warn(f"{name} occurs again: the last one counts", word.start())
    sections.offsets[name] = word.start()
    if name == "material":
        material, position = read_material(source, word, KEYWORDS, sections.pictures)
        sections.materials.append(material)
        return position
    count, position = _count(source, name, word)
    if name == "bindings":
        sections.bindings, position = _read_bindings(source, count, word, position)
        return position
    block = _block(source, name, word, position)
    sections.blocks[name] = block
    if name == "skinweights":
        sections.starts, sections.joints, sections.weights = _read_weights(source, block, count)
    elif name == "triangles":
        rows = _rows(source, block, count, 3)
        triangles = _whole(source, block, rows.ravel(), "a vertex index").reshape(-1, 3)
        sections.triangles.append(TriangleRun(triangles, len(sections.materials) - 1, block))
    else:
        sections.tables[name] = _rows(source, block, count, _WIDTHS[name])
    if not block.closed:
        source.warn(f'the last "}}" is missing: {name} ends with the file')
    return block.end + block.closed


def _count(source: Source, name: str, word: Word) -> tuple[int, int]:
    """Read a section's count; refuse one that the rest of the file cannot hold."""
    found = source.next_word(word.end())
    if found is None:
        raise source.error(f"{name}: expected a count, found the end of the file", word.start())
    value = to_number(found.group())
    if value is None or value != int(value) or value < 0:
        raise source.error(f"{name}: expected a count, found {shown(found.group())}", found.start())
    # Even an entry of one letter needs white space before it.
    left = len(source.data) - found.end()
    if value * 2 > left + 1:
        raise source.error(
            f"{name}: expected a count that the file can hold, found {int(value)} entries "
            f"in {left} bytes",
            found.start(),
        )
    return int(value), found.end()


def _block(source: Source, name: str, header: Word, position: int) -> Block:
    brace = source.next_word(position)
    if brace is not None and brace.group() == b"{":
        position = brace.end()
    elif name != "skinweights":
        found = "the end of the file" if brace is None else shown(brace.group())
        where = header.start() if brace is None else brace.start()
        raise source.error(f'{name}: expected "{{", found {found}', where)
    end = source.data.find(b"}", position)
    closed = end >= 0
    return Block(name, header.start(), position, end if closed else len(source.data), closed)


def _numbers(source: Source, block: Block) -> Floats:
    """Parse all numbers of a block."""
    values, bad = parse_numbers(source.data, block.start, block.end)
    if bad < 0:
        return values
    offset, word = _word_at(source, block, bad)
    if word in KEYWORDS or word == b"{":
        raise source.error(
            f'expected "}}" to close {_opened(source, block)}, found {shown(word)}', offset
        )
    raise source.error(f"{block.name}: expected a number, found {shown(word)}", offset)


def _opened(source: Source, block: Block) -> str:
    return f"{block.name} (line {source.line(block.header)})"


def _word_at(source: Source, block: Block, index: int) -> tuple[int, bytes]:
    offset = source.word_offset(block.start, index)
    word = source.next_word(offset)
    return offset, b"" if word is None else word.group()


def _rows(source: Source, block: Block, count: int, width: int) -> Floats:
    """Parse a block of ``count`` rows of ``width`` numbers: (count, width)."""
    values = _numbers(source, block)
    if len(values) == count * width:
        return values.reshape(count, width)
    if not block.closed:
        raise source.error(
            f'expected "}}" to close {_opened(source, block)}, found the end of the file '
            f"after {len(values) // width} of {count} rows",
            len(source.data.rstrip()),
        )
    _raise_for_short_line(source, block, width)
    raise source.error(
        f"{block.name}: expected {count} rows of {width} numbers, "
        f"found {len(values) // width}"
        + (f" and {len(values) % width} numbers" if len(values) % width else "")
        + f" (from line {source.line(block.header)})",
        block.end,
    )


def _raise_for_short_line(source: Source, block: Block, width: int) -> None:
    """Find the line at fault: in files written row by row, the one that is not a row."""
    text = source.data[block.start : block.end]
    offset = block.start
    lines = text.splitlines(keepends=True)
    lengths = [len(line.split()) for line in lines]
    filled = [length for length in lengths if length]
    # Lines mean nothing to the format; only a file that keeps to them tells more this way.
    if sum(length == width for length in filled) * 2 < len(filled):
        return
    for line, length in zip(lines, lengths, strict=True):
        if length % width:
            start = offset + len(line) - len(line.lstrip())
            raise source.error(f"{block.name}: expected {width} numbers, found {length}", start)
        offset += len(line)


def _whole(source: Source, block: Block, values: Floats, what: str) -> Ints:
    """Return whole numbers of a block as int32; what is none is an error."""
    wrong = np.flatnonzero(~_is_whole(values))
    if len(wrong):
        offset, word = _word_at(source, block, int(wrong[0]))
        raise source.error(f"{block.name}: expected {what}, found {shown(word)}", offset)
    return values.astype(np.int32)


def _is_whole(values: Floats) -> Bools:
    return (values == np.floor(values)) & (np.abs(values) < 2.0**31)


def _read_weights(source: Source, block: Block, count: int) -> tuple[Ints, Ints, Floats]:
    """Return where each vertex's influences start, their joints and their weights."""
    values = _numbers(source, block)
    numbers = values.tolist()
    heads: list[int] = []
    position = 0
    # Each count tells where the next one is, so they can only be followed one by one.
    while position < len(numbers) and len(heads) < count:
        heads.append(position)
        length = numbers[position]
        if length < 0 or length != int(length):
            raise _weights_error(source, block, len(heads) - 1, position, "a number of influences")
        position += 1 + 2 * int(length)
    if position > len(numbers) or len(heads) < count or position < len(numbers):
        raise _weights_count_error(source, block, count, heads, len(numbers))
    is_head = np.zeros(len(values), dtype=bool)
    is_head[heads] = True
    pairs = values[~is_head].reshape(-1, 2)
    wrong = np.flatnonzero(~_is_whole(pairs[:, 0]))
    if len(wrong):
        place = int(np.flatnonzero(~is_head)[2 * wrong[0]])
        vertex = int(np.searchsorted(heads, place)) - 1
        raise _weights_error(source, block, vertex, place, "a joint index")
    counts = values[heads].astype(np.int32)
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    return starts, pairs[:, 0].astype(np.int32), pairs[:, 1].copy()


def _weights_error(
    source: Source, block: Block, vertex: int, place: int, wanted: str
) -> FormatError:
    offset, word = _word_at(source, block, place)
    return source.error(
        f"skinweights of vertex {vertex}: expected {wanted}, found {shown(word)}", offset
    )


def _weights_count_error(
    source: Source, block: Block, count: int, heads: list[int], n_numbers: int
) -> FormatError:
    if not block.closed:
        return source.error(
            f'expected "}}" to close {_opened(source, block)}, found the end of the file '
            f"after {len(heads)} of {count} vertices",
            len(source.data.rstrip()),
        )
    if len(heads) < count:
        return source.error(
            f"skinweights: expected {count} vertices, found {len(heads)} "
            f"(from line {source.line(block.header)})",
            block.end,
        )
    if count == 0:
        return source.error(
            f"skinweights: expected no vertices, found {n_numbers} numbers", block.start
        )
    offset, word = _word_at(source, block, heads[-1])
    return source.error(
        f"skinweights of vertex {count - 1}, the last: expected {word.decode()} pairs of joint "
        f"and weight, found {n_numbers - heads[-1] - 1} numbers up to the closing brace",
        offset,
    )


def _read_bindings(source: Source, count: int, header: Word, position: int) -> tuple[Floats, int]:
    """Return B = [a b c d; 0 0 0 1] for each binding, (count, 4, 4), and the offset behind."""
    word = source.next_word(position)
    if word is not None and word.group() == b"{":
        position = word.end()
    matrices: list[Floats] = []
    while (word := source.next_word(position)) is not None and word.group() == b"matrix":
        rows, position = _read_matrix(source, len(matrices), word)
        matrices.append(rows)
    if len(matrices) != count:
        found = f"{len(matrices)} matrices, then " + (
            "the end of the file" if word is None else shown(word.group())
        )
        where = len(source.data.rstrip()) if word is None else word.start()
        raise source.error(
            f"bindings (line {source.line(header.start())}): expected {count} matrices, "
            f"found {found}",
            where,
        )
    if word is None:
        source.warn('the last "}" is missing: bindings ends with the file')
    elif word.group() != b"}":
        raise source.error(f'bindings: expected "}}", found {shown(word.group())}', word.start())
    bindings = np.tile(np.eye(4), (count, 1, 1))
    if matrices:
        bindings[:, :3, :] = np.array(matrices).reshape(-1, 4, 3).transpose(0, 2, 1)
    return bindings, len(source.data) if word is None else word.end()


def _read_matrix(source: Source, index: int, word: Word) -> tuple[Floats, int]:
    block = _block(source, f"matrix {index} of bindings", word, word.end())
    values = _numbers(source, block)
    if not block.closed:
        raise source.error(
            f'expected "}}" to close {_opened(source, block)}, found the end of the file',
            len(source.data.rstrip()),
        )
    if len(values) != 12:
        raise source.error(
            f"matrix {index} of bindings: expected 12 numbers, found {len(values)}", word.start()
        )
    return values, block.end + 1


def _skip(source: Source, word: Word) -> int:
    """Return the offset behind an unknown section: its numbers, or its whole balanced block."""
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
        raise source.error(f"{shown(word.group())} is still open where the file ends", word.start())
    return position
