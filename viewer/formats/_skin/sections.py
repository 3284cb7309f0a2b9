"""The sections of a ``.skin`` file as arrays: what is where, before anything is judged."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from viewer.formats._numbers import to_number
from viewer.formats._skin.bindings import read_bindings
from viewer.formats._skin.blocks import KEYWORDS, Block, block_rows, find_block, whole_numbers
from viewer.formats._skin.material import read_material
from viewer.formats._skin.mending import mended_rows, mended_weights, whole_corners
from viewer.formats._skin.weights import read_weights
from viewer.formats._source import Source
from viewer.phrases import quoted
from viewer.rig.arrays import Bytes, Floats, Ints
from viewer.rig.mesh import Material

__all__ = ["Sections", "TriangleRun", "check_declared", "read_sections"]

_WIDTHS = {"positions": 3, "normals": 3, "texcoords": 2}
Word = re.Match[bytes]


Places = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class TriangleRun:
    """One triangles section.

    Attributes
    ----------
    triangles : (M, 3)
        Vertex indices.
    material : int
        That before it, -1 for none.
    block : Block
        Where it is.
    offsets : (M,) or None
        Where each triangle is, if the words before it do not tell.
    """

    triangles: Ints
    material: int
    block: Block
    offsets: Places | None = None

    def offset(self, source: Source, triangle: int, corner: int = 0) -> int:
        """Return where in the file a corner is, or its triangle."""
        if self.offsets is not None:
            return int(self.offsets[triangle])
        place = 3 * triangle + corner
        return source.number_offset(self.block.start, self.block.end, place)


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
    counts: dict[str, int] = field(default_factory=dict)  # as declared
    blocks: dict[str, Block] = field(default_factory=dict)

    def triangle_offset(self, source: Source, triangle: int) -> int:
        """Return where in the file a triangle is, counted through all sections."""
        ends = np.cumsum([len(run.triangles) for run in self.triangles])
        run = int(np.searchsorted(ends, triangle, side="right"))
        first = int(ends[run]) - len(self.triangles[run].triangles)
        return self.triangles[run].offset(source, triangle - first)


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
            source.warn(f"skipped unknown section {quoted(name)}", word.start())
            position = _skip(source, word)
    if extra_braces:
        source.warn(f'ignored {extra_braces} "}}" outside all sections')
    return sections


def _read_section(source: Source, sections: Sections, word: Word) -> int:
    """Read one section and return the offset behind it."""
    name = word.group().decode()
    if name in sections.offsets and name not in ("triangles", "material"):
        source.warn(f"{name} occurs again: the last one counts", word.start())
        check_declared(source, sections, name)
    sections.offsets[name] = word.start()
    if name == "material":
        material, position = read_material(source, word, KEYWORDS, sections.pictures)
        sections.materials.append(material)
        return position
    count, position = _count(source, name, word)
    if name == "bindings":
        sections.bindings, position = read_bindings(source, count, position)
        return position
    block = find_block(source, name, word, position)
    sections.blocks[name], sections.counts[name] = block, count
    if name == "skinweights":
        _read_weights(source, sections, block, count)
    elif name == "triangles":
        sections.triangles.append(_read_triangles(source, sections, block, count))
    else:
        sections.tables[name] = _read_table(source, block, count)
    if not block.closed:
        source.warn(f'the last "}}" is missing: {name} ends with the file')
    return block.end + block.closed


def _read_table(source: Source, block: Block, count: int) -> Floats:
    """Parse a table, NaN where it has faults that the source takes, and remember its rows."""
    width = _WIDTHS[block.name]
    if source.faults is None:
        source.remember(
            block.name, lambda row: source.number_offset(block.start, block.end, width * row)
        )
        return block_rows(source, block, count, width)
    rows, offsets = mended_rows(source, block, count, width)
    source.remember(block.name, lambda row: int(offsets[row]))
    return rows


def _read_triangles(source: Source, sections: Sections, block: Block, count: int) -> TriangleRun:
    material = len(sections.materials) - 1
    if source.faults is None:
        rows = block_rows(source, block, count, 3)
        corners = whole_numbers(source, block, rows.ravel(), "a vertex index")
        return TriangleRun(corners.reshape(-1, 3), material, block)
    first = sum(len(run.triangles) for run in sections.triangles)
    rows, offsets = mended_rows(source, block, count, 3, first)
    return TriangleRun(whole_corners(source, rows, offsets, first), material, block, offsets)


def _read_weights(source: Source, sections: Sections, block: Block, count: int) -> None:
    if source.faults is None:
        starts, joints, weights = read_weights(source, block, count)
        source.remember(
            "weights",
            # Words before it: a count for each vertex, and two for each influence.
            lambda row: source.number_offset(block.start, block.end, row + 2 * int(starts[row])),
        )
    else:
        starts, joints, weights, offsets = mended_weights(source, block, count)
        source.remember("weights", lambda row: int(offsets[row]))
    sections.starts, sections.joints, sections.weights = starts, joints, weights


def check_declared(source: Source, sections: Sections, name: str) -> None:
    """Refuse a table or weights that has more or fewer vertices than its count says."""
    if name not in sections.counts or name == "triangles":
        return
    found = len(sections.tables.get(name, ()))
    if name == "skinweights" and sections.starts is not None:
        found = len(sections.starts) - 1
    declared = sections.counts[name]
    if declared != found:
        message = f"{name}: expected {declared} entries as its count says, found {found}"
        source.refuse_error(source.error(message, sections.offsets[name]))


def _count(source: Source, name: str, word: Word) -> tuple[int, int]:
    """Read a section's count; refuse one that the rest of the file cannot hold."""
    found = source.next_word(word.end())
    if found is None:
        raise source.error(f"{name}: expected a count, found the end of the file", word.start())
    value = to_number(found.group())
    if value is None or value != int(value) or value < 0:
        raise source.error(
            f"{name}: expected a count, found {quoted(found.group())}", found.start()
        )
    # Even an entry of one letter needs white space before it.
    left = len(source.data) - found.end()
    if value * 2 > left + 1:
        raise source.error(
            f"{name}: expected a count that the file can hold, found {int(value)} entries "
            f"in {left} bytes",
            found.start(),
        )
    return int(value), found.end()


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
        raise source.error(
            f"{quoted(word.group())} is still open where the file ends", word.start()
        )
    return position
