"""Parser for the sections of a ``.skin`` file; returns unchecked arrays."""

from __future__ import annotations

import re
from dataclasses import field

import numpy as np

from viewer.data_classes import dataclass
from viewer.formats._skin.bindings import read_bindings
from viewer.formats._skin.blocks import KEYWORDS, Block, find_block, read_count
from viewer.formats._skin.material import read_material
from viewer.formats._skin.rows import OffsetOf, read_rows, whole_corners
from viewer.formats._skin.weights import read_weights
from viewer.formats._source import Source
from viewer.rig.arrays import Bytes, Floats, Ints
from viewer.rig.material import Material

__all__ = ["Sections", "TriangleRun", "check_declared", "read_sections"]

_WIDTHS = {"positions": 3, "normals": 3, "texcoords": 2}
Word = re.Match[bytes]


@dataclass(frozen=True, slots=True)
class TriangleRun:
    """One triangles section.

    Attributes
    ----------
    triangles : (M, 3)
        Vertex indices.
    material : int
        Index of the preceding material, -1 for none.
    offset_of : callable
        Returns the offset of a triangle.
    """

    triangles: Ints
    material: int
    offset_of: OffsetOf


@dataclass(slots=True)
class Sections:
    """All sections of a ``.skin`` file; None or empty if a section is missing."""

    tables: dict[str, Floats] = field(default_factory=dict)
    starts: Ints | None = None
    joints: Ints = field(default_factory=lambda: np.zeros(0, np.int32))
    weights: Floats = field(default_factory=lambda: np.zeros(0))
    materials: list[Material] = field(default_factory=list)
    pictures: dict[str, Bytes | None] = field(default_factory=dict)
    triangles: list[TriangleRun] = field(default_factory=list)
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
    """Split a file into its sections and parse their numbers.

    Parameters
    ----------
    source : Source
        The file.

    Raises
    ------
    FormatError
        If the text violates the grammar; the error has the file and line.
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
            source.warn("F006.skin-section", word.start(), found=name)
            position = _skip(source, word)
    if extra_braces:
        source.warn("F006.skin-braces", n=extra_braces)
    return sections


def _read_section(source: Source, sections: Sections, word: Word) -> int:
    """Read one section and return the offset after it."""
    name = word.group().decode()
    if name in sections.offsets and name not in ("triangles", "material"):
        source.warn("F007.skin-again", word.start(), section=name)
        check_declared(source, sections, name)
    sections.offsets[name] = word.start()
    if name == "material":
        material, position = read_material(source, word, KEYWORDS, sections.pictures)
        sections.materials.append(material)
        return position
    count, position = read_count(source, name, word)
    if name == "bindings":
        sections.bindings, position = read_bindings(source, count, position)
        return position
    block = find_block(source, name, word, position)
    sections.counts[name] = count
    if name == "skinweights":
        _read_weights(source, sections, block, count)
    elif name == "triangles":
        run = _read_triangles(source, sections, block, count)
        sections.triangles.append(run)
        sections.n_triangles += len(run.triangles)
    else:
        sections.tables[name] = _read_table(source, block, count)
    if not block.closed:
        source.warn("F006.last-brace", section=name)
    return block.end + block.closed


def _read_table(source: Source, block: Block, count: int) -> Floats:
    """Parse a table, with NaN for invalid values, and register its rows."""
    rows, offset_of = read_rows(source, block, count, _WIDTHS[block.name])
    source.remember(block.name, offset_of)
    return rows


def _read_triangles(source: Source, sections: Sections, block: Block, count: int) -> TriangleRun:
    first = sections.n_triangles
    rows, offset_of = read_rows(source, block, count, 3, first, "triangle")
    corners = whole_corners(source, rows, offset_of, first)
    return TriangleRun(corners, len(sections.materials) - 1, offset_of)


def _read_weights(source: Source, sections: Sections, block: Block, count: int) -> None:
    starts, joints, weights, offset_of = read_weights(source, block, count)
    source.remember("weights", offset_of)
    sections.starts, sections.joints, sections.weights = starts, joints, weights


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
        source.refuse("F002.skin-declared", offset, section=name, expected=declared, found=found)


def _skip(source: Source, word: Word) -> int:
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
        raise source.fault("F002.open", word.start(), word=word.group())
    return position
