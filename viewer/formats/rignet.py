r"""Reader of text rigs of networks that predict skeletons (RigNet, MagicArticulate, Puppeteer).

::

    rig   = line+
    line  = "joints" name x y z | "root" name | "hier" parent child
          | "skin" vertex (name weight)+

Names are single words. Lines may be in any order; blank lines are ignored. Positions are those of
the joints in the space of a mesh that is not in the file: y is up, and the unit is unknown. Weights
belong to the vertices of that mesh, so they are not read; ``viewer rig --skeleton`` computes new
ones for any mesh.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import field

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase, wording
from viewer.formats._source import Source
from viewer.formats._text.numbers import LARGEST, to_number
from viewer.phrases import counted, listed, printable, quoted
from viewer.rigs.figure import Figure
from viewer.rigs.skeleton import ball_skeleton

_LINE = re.compile(rb"[^\r\n]+")
_WORDS = {b"joints": "a name and 3 numbers", b"root": "a name", b"hier": "a parent and a child"}
_COUNTS = {b"joints": 5, b"root": 2, b"hier": 3}


@dataclass(slots=True)
class _Joints:
    """The joints of a file, by name."""

    places: dict[bytes, list[float]] = field(default_factory=dict)
    starts: dict[bytes, int] = field(default_factory=dict)
    """Offsets of the lines in the file."""
    parents: dict[bytes, bytes] = field(default_factory=dict)
    links: dict[bytes, int] = field(default_factory=dict)
    """Offsets of the lines with the parents."""
    root: tuple[bytes, int] | None = None
    n_weighted: int = 0
    """Number of vertices with weights."""


def read(source: Source) -> Figure:
    """Read the joints as a skeleton of ball joints."""
    found = _Joints()
    for start, words in _lines(source):
        _read_line(source, found, start, words)
    if not found.places:
        raise source.fault("F002.rignet-empty: expected lines with joints, found none", source.end)
    for child, parent in found.parents.items():
        for name in (child, parent):
            if name not in found.places:
                raise _unknown(source, name, found.links[child])
    if found.root is not None:
        name, start = found.root
        if name not in found.places:
            raise _unknown(source, name, start)
        if name in found.parents:
            raise source.fault(
                wording.VALUE,
                found.links[name],
                item=Phrase("the root {name}", name=quoted(name)),
                expected="no parent",
                found=quoted(found.parents[name]),
            )
    order = _ordered(source, found)
    rows = {name: row for row, name in enumerate(order)}
    parents = [rows[found.parents[name]] if name in found.parents else -1 for name in order]
    names = tuple(name.decode("utf-8", "surrogateescape") for name in order)
    places = np.array([found.places[name] for name in order])
    source.remember("joints", lambda joint: found.starts[order[joint]])
    others = [name for name, above in zip(names, parents, strict=True) if above < 0][1:]
    if others:
        source.warn(
            "F007.rignet-roots: no parent for {names}: read as further roots",
            found.starts[order[names.index(others[0])]],
            count=len(others),
            names=listed([printable(name, 60) for name in others], 6),
        )
    if found.n_weighted:
        source.warn(
            "F007.rignet-weights: weights of {n} not read: they belong to a mesh that is not in "
            "the file; viewer rig --skeleton computes weights for a mesh",
            n=counted(found.n_weighted, "vertex"),
        )
    skeleton = ball_skeleton(names, np.array(parents, dtype=np.int32), places)
    return Figure(source.path.stem, skeleton=skeleton)


def _lines(source: Source) -> Iterator[tuple[int, list[bytes]]]:
    """Yield the offset and words of each line that is not blank."""
    for line in _LINE.finditer(source.data):
        words = line.group().split()
        if words:
            yield line.start() + line.group().index(words[0]), words


def _read_line(source: Source, found: _Joints, start: int, words: list[bytes]) -> None:
    word, *rest = words
    if word == b"skin":
        found.n_weighted += 1
        return
    if word not in _COUNTS:
        source.warn(wording.UNKNOWN, start, found=quoted(word))
        return
    if len(words) != _COUNTS[word]:
        raise source.fault(
            wording.VALUE,
            start,
            item=word.decode(),
            expected=_WORDS[word],
            found=counted(len(rest), "word"),
        )
    if word == b"joints":
        name, numbers = rest[0], []
        for number in rest[1:]:
            value = to_number(number)
            if value is None or abs(value) > LARGEST:
                raise source.fault(
                    wording.VALUE,
                    start,
                    item=Phrase("joint {name}", name=quoted(name)),
                    expected=Phrase("3 numbers within ±{most}", most=f"{LARGEST:g}"),
                    found=quoted(number),
                )
            numbers.append(value)
        if name in found.places:
            raise source.fault(
                "F002.rignet-twice: expected different names, found {name} twice",
                start,
                name=quoted(name),
            )
        found.places[name], found.starts[name] = numbers, start
    elif word == b"root":
        if found.root is not None and found.root[0] != rest[0]:
            raise source.fault(
                "F002.rignet-root: expected one root, found {first} and {second}",
                start,
                first=quoted(found.root[0]),
                second=quoted(rest[0]),
            )
        found.root = rest[0], start
    else:
        parent, child = rest
        if found.parents.get(child, parent) != parent:
            raise source.fault(
                "F002.rignet-parents: expected one parent of {child}, found {first} and {second}",
                start,
                child=quoted(child),
                first=quoted(found.parents[child]),
                second=quoted(parent),
            )
        found.parents[child], found.links[child] = parent, start


def _ordered(source: Source, found: _Joints) -> list[bytes]:
    """Return the joints with parents before children: the root and its tree first."""
    children: dict[bytes, list[bytes]] = {name: [] for name in found.places}
    for child, parent in found.parents.items():
        children[parent].append(child)
    roots = [name for name in found.places if name not in found.parents]
    if found.root is not None:
        first = found.root[0]
        roots.sort(key=lambda name: name != first)
    order: list[bytes] = []
    pending = roots[::-1]
    while pending:
        order.append(pending.pop())
        pending += children[order[-1]][::-1]
    if len(order) < len(found.places):
        reached = set(order)
        name = next(name for name in found.places if name not in reached)
        raise source.fault(
            "F002.rignet-circle: expected joints below a root, found {name} below itself or "
            "below a circle",
            found.links[name],
            name=quoted(name),
        )
    return order


def _unknown(source: Source, name: bytes, start: int) -> Exception:
    return source.fault(
        "F002.rignet-unknown: expected the name of a joint, found {name}", start, name=quoted(name)
    )
