r"""Reader of ``.morph`` targets (UCSD course CSE169).

::

    morph = "positions" n "{" (index x y z)*n "}"  "normals" n "{" (index x y z)*n "}"

Positions and normals are absolute, not offsets, for the listed vertices of one ``.skin``; all other
vertices are unchanged. The two sections may come in either order and list vertices in any order;
normals are optional.
"""

from __future__ import annotations

import re

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import wording
from viewer.errors import FormatError
from viewer.formats._source import Source
from viewer.formats.skin.sections import find_block, read_count, read_rows, to_whole
from viewer.phrases import optional, quoted
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.morph_target import MorphTarget

_WIDTH = 4  # index, x, y, z
_SECTIONS = (b"positions", b"normals")


@dataclass(frozen=True, slots=True, eq=False)
class _Section:
    """The vertices that a section lists, in ascending order, and their values."""

    vertices: Ints
    values: Floats
    header: int


def read(source: Source) -> MorphTarget:
    """Read a target, named after the file, with vertices in ascending order."""
    sections: dict[bytes, _Section] = {}
    position = 0
    while (word := source.next_word(position)) is not None:
        name = word.group()
        if name not in _SECTIONS or name in sections:
            raise _unexpected(source, word, name in sections)
        sections[name], position = _section(source, name.decode(), word)
    if b"positions" not in sections:
        looks = source.looks_like()
        raise source.fault(
            "F002.morph-positions: expected a positions section, found none{looks}",
            None if looks else source.end,
            looks=optional(" ({})", looks),
        )
    positions = sections[b"positions"]
    if len(positions.vertices) == 0:
        source.warn("F007.morph-empty: empty: moves no vertex")
    if b"normals" not in sections:
        source.warn("F007.morph-normals: no normals section: normals unchanged")
        return MorphTarget(source.path.stem, positions.vertices, positions.values)
    normals = sections[b"normals"]
    if len(positions.vertices) != len(normals.vertices):
        raise source.fault(
            "F002.morph-counts: expected as many normals as positions, found {second} normals "
            "(line {other}) and {first} positions (line {line})",
            normals.header,
            line=source.line(positions.header),
            first=len(positions.vertices),
            other=source.line(normals.header),
            second=len(normals.vertices),
        )
    differs = np.flatnonzero(positions.vertices != normals.vertices)
    if len(differs):
        row = int(differs[0])
        raise source.fault(
            "F002.morph-vertices: normals: expected vertex {expected} as in positions, found "
            "vertex {found}",
            normals.header,
            found=int(normals.vertices[row]),
            expected=int(positions.vertices[row]),
        )
    return MorphTarget(source.path.stem, positions.vertices, positions.values, normals.values)


def _unexpected(source: Source, word: re.Match[bytes], is_repeated: bool) -> FormatError:
    if is_repeated:
        return source.fault(
            "F002.morph-repeated: expected one {section} section, found a second one",
            word.start(),
            section=word.group().decode(),
        )
    return source.fault(
        "F002.morph-section: expected positions or normals, found {found}",
        word.start(),
        found=quoted(word.group()),
    )


def _section(source: Source, name: str, header: re.Match[bytes]) -> tuple[_Section, int]:
    """Read a section without its invalid rows, and return the offset of its end."""
    count, position = read_count(source, name, header)
    block = find_block(source, name, header, position)
    rows, offset_of = read_rows(source, block, count, _WIDTH, item="{section}, entry {index}")
    if len(rows) != count:
        source.refuse(
            wording.SKIN_DECLARED, header.start(), section=name, expected=count, found=len(rows)
        )
    if not block.closed:
        source.warn(wording.LAST_BRACE, section=name)
    known = np.flatnonzero(~np.isnan(rows).any(axis=1))
    vertices, _ = to_whole(rows[known, 0])
    wrong = known[(vertices != rows[known, 0]) | (vertices < 0)]
    if len(wrong):
        row = int(wrong[0])
        source.refuse(
            "F002.morph-index: {section}: expected a vertex index, found {found:g}",
            offset_of(row),
            len(wrong),
            section=name,
            found=float(rows[row, 0]),
        )
    known = np.setdiff1d(known, wrong)
    known = known[np.argsort(rows[known, 0], kind="stable")]
    listed, first = np.unique(rows[known, 0], return_index=True)
    if len(listed) < len(known):
        twice = np.setdiff1d(np.arange(len(known)), first)
        row = int(known[twice[0]])
        source.refuse(
            "F002.morph-twice: {section}: expected unique vertices, found vertex {vertex} again",
            offset_of(row),
            len(twice),
            section=name,
            vertex=int(rows[row, 0]),
        )
    known = known[first]
    section = _Section(rows[known, 0].astype(np.int32), rows[known, 1:], block.header)
    return section, block.end + block.closed
