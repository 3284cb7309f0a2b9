r"""Reader of skeletons that networks predict (RigNet, MagicArticulate, Puppeteer, UniRig).

A text, or an archive of arrays::

    rig   = line+
    line  = "joints" name x y z | "root" name | "hier" parent child
          | "skin" vertex (name weight)+

    joints (J, 3)    or "J", "joint_positions": positions
    parents (J,)     any order; a root has -1, None or its own index
    bones (N, 2)     parent and child: instead of parents
    names (J,)       or "joint_names"; optional
    up, unit         as in the arrays that this program writes; optional

Names in a text are words; spaces in them are kept. Lines may be in any order; blank ones and
comments (``#``) are ignored. Positions are those of the joints in the space of a mesh: y is up, and
the unit is unknown, unless an archive states them. Meshes in archives and weights are not read;
``viewer rig --skeleton`` computes new weights for any mesh.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import field

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase, wording
from viewer.errors import FormatError
from viewer.formats._archive.checking import archive_of, finite_array
from viewer.formats._archive.opening import is_archive
from viewer.formats._archive.values import Archive, texts_in
from viewer.formats._source import Source
from viewer.formats._text.numbers import LARGEST, to_number
from viewer.phrases import counted, listed, one_of, printable, quoted
from viewer.rigs.arrays import Ints
from viewer.rigs.figure import Figure
from viewer.rigs.hierarchy import cycle_members, depth_first
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.units import METRES

_LINE = re.compile(rb"[^\r\n]+")
_WORDS = {b"joints": "a name and 3 numbers", b"root": "a name", b"hier": "a parent and a child"}
_COUNTS = {b"joints": 5, b"root": 2, b"hier": 3}  # words, at least: names may have several
# Keys of an archive.
_PLACES = ("J", "joints", "joint_positions")
_NAMES = ("names", "joint_names")
_HEAD = 64  # bytes by which an archive is recognised
_UNSIGNED = float(2**32 - 1)


@dataclass(slots=True)
class _Joints:
    """The joints of a file, by name."""

    places: dict[bytes, list[float]] = field(default_factory=dict)
    starts: dict[bytes, int] = field(default_factory=dict)
    """Offsets of the lines in the file."""
    parents: dict[bytes, bytes] = field(default_factory=dict)
    links: dict[bytes, int] = field(default_factory=dict)
    """Offsets of the lines with the parents."""
    pairs: list[tuple[list[bytes], int]] = field(default_factory=list)
    """Words and offsets of the lines with a parent and a child."""
    root: tuple[bytes, int] | None = None
    n_weighted: int = 0
    """Number of vertices with weights."""


def read(source: Source) -> Figure:
    """Read the joints as a skeleton of ball joints."""
    if is_archive(source.peek(_HEAD)):
        return _read_arrays(archive_of(source))
    found = _Joints()
    for start, words in _lines(source):
        _read_line(source, found, start, words)
    if not found.places:
        raise source.fault("F002.rignet-empty: expected lines with joints, found none", source.end)
    for words, start in found.pairs:
        _link(source, found, words, start)
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


def _read_arrays(archive: Archive) -> Figure:
    """Read the joints of an archive."""
    # Influences are called joints, too, but there are rarely three of each vertex.
    key = next((key for key in _PLACES if archive.shape(key)[1:] == (3,)), None)
    if key is None:
        raise archive.source.fault(
            "F002.predicted-joints: expected positions of joints (J, 3) as {expected}, found the "
            "keys {found}",
            expected=one_of(_PLACES),
            found=listed([printable(key, 40) for key in archive.keys], 12),
        )
    places = finite_array(archive, key, (None, 3), "joints")
    if len(places) == 0:
        raise archive.fault("F002.no-rows: {item}: expected at least one row, found none", item=key)
    parents = _parents(archive, len(places))
    order = depth_first(parents)
    rows = np.argsort(order)
    above = np.where(parents >= 0, rows[parents], -1)[order]
    names = _names(archive, len(places))
    skeleton = ball_skeleton(tuple(names[joint] for joint in order), above, places[order])
    up, unit = archive.plain_text("up"), archive.plain_text("unit")
    others = [printable(key, 40) for key in sorted(archive.unread())]
    return Figure(
        archive.source.path.stem,
        skeleton=skeleton,
        up="z" if up == "z" else "y",
        unit=unit if unit in METRES else "",
        facts=(("not needed", listed(others, 12)),) if others else (),
    )


def _parents(archive: Archive, count: int) -> Ints:
    """Return the parents (J,) of an archive's joints, in any order; -1 for roots."""
    if archive.has("parents"):
        key, children = "parents", np.arange(count)
        given = archive.array(key, (count,)).values().astype(np.float64)
    else:
        key = "bones"
        bones = archive.array(key, (None, 2), "iu").values()
        given, children = bones[:, 0].astype(np.float64), bones[:, 1].astype(np.int64)
        outside = np.flatnonzero((children < 0) | (children >= count))
        if len(outside):
            raise _no_joint(archive, key, count, float(children[outside[0]]))
        several = np.flatnonzero(np.bincount(children, minlength=count) > 1)
        if len(several):
            raise archive.fault(
                "F002.predicted-parents: {item}: expected one parent of joint {joint}, found "
                "several",
                item=key,
                joint=int(several[0]),
            )
    # SMPL's root has -1 as an unsigned integer.
    is_unsigned = (given >= _UNSIGNED) & np.isfinite(given)
    is_root = np.isnan(given) | (given == -1.0) | (given == children) | is_unsigned
    is_joint = (given >= 0) & (given < count) & (given == np.floor(given))
    outside = np.flatnonzero(~is_root & ~is_joint)
    if len(outside):
        raise _no_joint(archive, key, count, float(given[outside[0]]))
    parents = np.full(count, -1, dtype=np.int32)
    parents[children] = np.where(is_root, -1.0, given)
    circle = np.flatnonzero(cycle_members(parents))
    if len(circle):
        raise archive.fault(
            "F002.predicted-circle: {item}: expected joints below a root, found joint {joint} "
            "below itself",
            item=key,
            joint=int(circle[0]),
        )
    return parents


def _no_joint(archive: Archive, key: str, count: int, found: float) -> FormatError:
    return archive.fault(
        "F002.predicted-joint: {item}: expected joints from 0 to {last}, found {found:g}",
        item=key,
        last=count - 1,
        found=found,
    )


def _names(archive: Archive, count: int) -> list[str]:
    """Return the names of an archive's joints, numbers where it has none."""
    key = next((key for key in _NAMES if archive.has(key)), "")
    names = texts_in(archive.objects(key)) if key else []
    if names and len(names) != count:
        raise archive.fault(
            "F002.predicted-names: {item}: expected {expected}, found {found}",
            item=key,
            expected=counted(count, "name"),
            found=len(names),
        )
    return names or [f"joint_{joint}" for joint in range(count)]


def _lines(source: Source) -> Iterator[tuple[int, list[bytes]]]:
    """Yield the offset and words of each line that is not blank and no comment."""
    for line in _LINE.finditer(source.data):
        words = line.group().split()
        if words and not words[0].startswith(b"#"):
            yield line.start() + line.group().index(words[0]), words


def _read_line(source: Source, found: _Joints, start: int, words: list[bytes]) -> None:
    word, *rest = words
    if word == b"skin":
        found.n_weighted += 1
        return
    if word not in _COUNTS:
        source.warn_unknown(word, start, (*_COUNTS, b"skin"))
        return
    if len(words) < _COUNTS[word]:
        raise source.fault(
            wording.VALUE,
            start,
            item=word.decode(),
            expected=_WORDS[word],
            found=counted(len(rest), "word"),
        )
    if word == b"joints":
        name, numbers = b" ".join(rest[:-3]), []
        for number in rest[-3:]:
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
        name = b" ".join(rest)
        if found.root is not None and found.root[0] != name:
            raise source.fault(
                "F002.rignet-root: expected one root, found {first} and {second}",
                start,
                first=quoted(found.root[0]),
                second=quoted(name),
            )
        found.root = name, start
    else:
        found.pairs.append((rest, start))


def _link(source: Source, found: _Joints, words: list[bytes], start: int) -> None:
    """Add the parent and child of a line; names of several words are those of joints."""
    ways = [(b" ".join(words[:at]), b" ".join(words[at:])) for at in range(1, len(words))]
    known = [way for way in ways if found.places.keys() >= {*way}]
    if not known:
        # Of two words, one is wrong; of more, the last one is as good as any.
        parent, child = ways[-1]
        raise _unknown(source, child if parent in found.places else parent, start)
    if len(known) > 1:
        raise source.fault(
            "F002.rignet-names: expected a parent and a child, found {names}, which can be split "
            "in several ways",
            start,
            names=quoted(b" ".join(words)),
        )
    parent, child = known[0]
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
