"""Parser for the HIERARCHY of a BVH file: joints, End Sites and channels in file order."""

from __future__ import annotations

import re
from dataclasses import field

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase, wording
from viewer.errors import FormatError
from viewer.formats._source import Source
from viewer.formats._text.numbers import to_number
from viewer.formats._text.words import number_key
from viewer.phrases import brief, counted, optional, quoted

CHANNELS = {
    f"{axis}{kind}".encode(): code
    for code, (kind, axis) in enumerate(
        (kind, axis) for kind in ("POSITION", "ROTATION") for axis in "XYZ"
    )
}
"""Codes of upper-case channel names: 0 to 2 are positions, 3 to 5 rotations."""
_ITEMS = (b"OFFSET", b"CHANNELS", b"JOINT", b"END", b"ENDSITE")
Word = re.Match[bytes]


@dataclass(slots=True)
class BvhJoint:
    """A joint or End Site; ``parent`` is an index into the same list, -1 for a root."""

    name: str
    parent: int
    start: int
    is_end: bool = False
    offset: list[float] | None = None
    channels: list[int] | None = None


@dataclass(slots=True)
class Hierarchy:
    """All joints in the order of the file, and the offset of its motion."""

    joints: list[BvhJoint] = field(default_factory=list)
    """Joints and End Sites; parents come first."""
    motion: int = -1
    """Offset after the word MOTION; -1 if there is none."""


def read_hierarchy(source: Source) -> Hierarchy:
    """Read everything up to the word MOTION."""
    return _Parser(source).hierarchy()


class _Parser:
    """Parser without recursion, because invalid files may be nested arbitrarily deeply."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.words = source.words()
        self.word: Word | None = None
        self.keyword = b""  # the current word in upper case
        self.found: list[BvhJoint] = []
        self.open: list[int] = []
        self.n_joints = 0  # number of joints in ``found``; the other entries are End Sites
        self.extra_braces = 0
        self.doubled: list[tuple[int, int, BvhJoint]] = []  # joints whose OFFSET has 6 numbers

    def hierarchy(self) -> Hierarchy:
        """Return the joints and the offset of the motion."""
        self._advance()
        if self.keyword != b"HIERARCHY":
            raise self._fault(
                "F002.bvh-start: expected HIERARCHY, found {found}{looks}",
                looks=optional(" ({})", self.source.looks_like()),
            )
        self._advance()
        while self.word is not None and (self.open or self.keyword != b"MOTION"):
            self._item()
        if self.open:
            raise self._still_open()
        if not self.found:
            raise self._fault("F002.bvh-no-root: expected ROOT, found {found}")
        if self.extra_braces:
            self.source.warn(wording.EXTRA_BRACES, n=self.extra_braces)
        if self.doubled:
            start, _, first = self.doubled[0]
            places = [place for _, place, joint in self.doubled if not joint.is_end]
            self.source.warn(
                "F006.bvh-offset: OFFSET: expected 3 numbers, found 6 in {n} (first: {joint}); the "
                "last 3 are ignored",
                start,
                part="joints",
                places=places,
                n=counted(len(self.doubled), "joint"),
                joint=called(first),
            )
        return Hierarchy(self.found, -1 if self.word is None else self.word.end())

    def _item(self) -> None:
        keyword = self.keyword
        joint = self.found[self.open[-1]] if self.open else None
        if keyword == b"}":
            self._close()
        elif joint is None:
            if keyword != b"ROOT":
                raise self._fault("F002.bvh-root: expected ROOT or MOTION, found {found}")
            self._open_joint()
        elif keyword == b"OFFSET":
            self._offset(joint)
        elif keyword == b"CHANNELS":
            self._channels(joint)
        elif keyword == b"JOINT" and not joint.is_end:
            self._open_joint()
        elif keyword in (b"END", b"ENDSITE") and not joint.is_end:
            self._open_joint(is_end=True)
        elif keyword in (b"MOTION", b"ROOT"):
            raise self._still_open()
        elif joint.is_end:
            raise self._fault(
                'F002.bvh-end-item: {joint}: expected OFFSET or "}}", found {found}',
                joint=called(joint),
            )
        else:
            raise self._fault(
                "F002.bvh-item: {joint}: expected OFFSET, CHANNELS, JOINT, End Site or "
                '"}}", found {found}',
                joint=called(joint),
            )

    def _open_joint(self, is_end: bool = False) -> None:
        assert self.word is not None  # checked by the caller
        start, keyword = self.word.start(), self.keyword
        self._advance()
        if keyword == b"END" and self.keyword == b"SITE":
            self._advance()
        words: list[Word] = []
        while self.word is not None and self.word.group() not in (b"{", b"}"):
            if self._begins_item():
                break
            words.append(self.word)
            self._advance()
        parent = self.open[-1] if self.open else -1
        joint = BvhJoint(self._name(words), parent, start, is_end)
        if is_end:
            joint.name = self.found[parent].name
        if self.word is None or self.word.group() != b"{":
            where = start if self.word is None else self.word.start()
            raise self.source.fault(
                wording.OPENING, where, item=called(joint), found=quoted(self._found())
            )
        self.open.append(len(self.found))
        self.found.append(joint)
        self.n_joints += not is_end
        self._advance()

    def _name(self, words: list[Word]) -> str:
        """Return a name as written, with the spaces between its words unless lines end there."""
        text = self.source.data[words[0].start() : words[-1].end()] if words else b""
        if set(text) & set(b"\n\r\v\f"):
            text = b" ".join(word.group() for word in words)
        return text.decode("utf-8", "surrogateescape")

    def _begins_item(self) -> bool:
        """Return whether a keyword and its number follow a name whose "{" is missing."""
        assert self.word is not None  # checked by the caller
        if self.keyword not in _ITEMS[:2]:
            return False
        following = self.source.next_word(self.word.end())
        return following is not None and to_number(following.group()) is not None

    def _close(self) -> None:
        if self.open:
            self.open.pop()
        else:
            self.extra_braces += 1
        self._advance()

    def _offset(self, joint: BvhJoint) -> None:
        assert self.word is not None  # checked by the caller
        keyword = self.word
        if joint.offset is not None:
            raise self._fault(
                "F002.bvh-offset-again: {joint}: expected one OFFSET, found a second one",
                joint=called(joint),
            )
        self._advance()
        values: list[float] = []
        while len(values) < 3:
            value = None if self.word is None else to_number(self.word.group())
            if value is None:
                self._refuse_offset(joint, keyword, len(values))
                return
            values.append(value)
            self._advance()
        extra: list[Word] = []
        while self.word is not None and to_number(self.word.group()) is not None:
            extra.append(self.word)
            self._advance()
        if extra and len(extra) != 3:
            self._refuse_offset(joint, keyword, extra)
            return
        joint.offset = values
        if extra:  # SOMA writes two offsets, of which the first is the usual one
            self.doubled.append((keyword.start(), self.n_joints - 1, joint))

    def _refuse_offset(self, joint: BvhJoint, keyword: Word, found: int | list[Word]) -> None:
        """Record and skip an OFFSET with too few values (their number) or the additional words."""
        refuse, word = self.source.refuse, self._found()
        places = None if joint.is_end else [self.n_joints - 1]
        item = Phrase("{item} of {owner}", item="OFFSET", owner=called(joint))
        here = keyword.start() if self.word is None else self.word.start()
        if isinstance(found, list):
            more = {"expected": counted(3, "number"), "found": quoted(found[0].group())}
            refuse(wording.MORE, found[0].start(), 1, "joints", places, item=item, **more)
        elif word is None or self.keyword in (b"{", b"}", *_ITEMS):
            start = keyword.start()
            refuse(
                wording.WIDTH,
                start,
                1,
                "joints",
                places,
                item=item,
                expected=counted(3, "number"),
                found=found,
            )
        else:
            refuse(number_key(word), here, 1, "joints", places, item=item, found=quoted(word))
        joint.offset = [0.0, 0.0, 0.0]
        while self.word is not None and self.keyword not in (b"{", b"}", *_ITEMS):
            self._advance()

    def _channels(self, joint: BvhJoint) -> None:
        assert self.word is not None  # checked by the caller
        keyword = self.word
        if joint.channels is not None:
            raise self._fault(
                "F002.bvh-channels-again: {joint}: expected one CHANNELS, found a second one",
                joint=called(joint),
            )
        self._advance()
        item = Phrase("{item} of {owner}", item="CHANNELS", owner=called(joint))
        count = None if self.word is None else to_number(self.word.group())
        if count is None or count != int(count) or count < 0:
            raise self._fault(wording.COUNT, item=item)
        stated = self.word
        self._advance()
        codes: list[int] = []
        while self.word is not None and self.keyword not in (b"{", b"}", *_ITEMS):
            code = CHANNELS.get(self.keyword)
            if code is None:
                raise self._fault(
                    "F002.bvh-channel: {item}: expected a channel name (Xposition … Zrotation), "
                    "found {found}",
                    item=item,
                )
            if code < 3 and code in codes:
                raise self._fault(
                    "F002.bvh-position-again: {item}: expected each position channel once, found "
                    "{found} again",
                    item=item,
                )
            codes.append(code)
            self._advance()
        if len(codes) != count:
            where = stated.start() if stated else keyword.start()
            raise self.source.fault(
                "F002.bvh-channel-count: {item}: expected {expected}, found {found}",
                where,
                item=item,
                expected=counted(int(count), "channel name"),
                found=len(codes),
            )
        joint.channels = codes

    def _advance(self) -> None:
        self.word = next(self.words, None)
        self.keyword = b"" if self.word is None else self.word.group().upper()

    def _found(self) -> bytes | None:
        return None if self.word is None else self.word.group()

    def _fault(self, key: str, **values: object) -> FormatError:
        """Return the exception for an error at the current word."""
        where = self.source.end if self.word is None else self.word.start()
        return self.source.fault(key, where, found=quoted(self._found()), **values)

    def _still_open(self) -> FormatError:
        joint = self.found[self.open[-1]]
        line = self.source.line(joint.start)
        return self._fault(wording.JOINT_OPEN, joint=called(joint), line=line)


def called(joint: BvhJoint) -> Phrase:
    """Return the phrase for a joint or End Site in messages."""
    name = Phrase("joint {name}", name=brief(joint.name)) if joint.name else Phrase("unnamed joint")
    return Phrase("End Site of {joint}", joint=name) if joint.is_end else name
