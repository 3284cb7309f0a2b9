"""Parser for the HIERARCHY of a BVH file: joints, End Sites and channels in file order."""

from __future__ import annotations

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase, wording
from viewer.formats._source import Source
from viewer.formats._text.joint_parser import JointParser, Word, called_joint
from viewer.formats._text.numbers import to_number
from viewer.phrases import counted, optional

CHANNELS = {
    f"{axis}{kind}".encode(): code
    for code, (kind, axis) in enumerate(
        (kind, axis) for kind in ("POSITION", "ROTATION") for axis in "XYZ"
    )
}
"""Codes of upper-case channel names: 0 to 2 are positions, 3 to 5 rotations."""
_ITEMS = (b"OFFSET", b"CHANNELS", b"JOINT", b"END", b"ENDSITE")


@dataclass(slots=True)
class BvhJoint:
    """A joint or End Site; ``parent`` is an index into the same list, -1 for a root."""

    name: str
    parent: int
    start: int
    is_end: bool = False
    offset: list[float] | None = None
    channels: list[int] | None = None

    @property
    def called(self) -> Phrase:
        """The phrase for the joint or End Site in messages."""
        joint = called_joint(self.name)
        return Phrase("End Site of {joint}", joint=joint) if self.is_end else joint


def read_hierarchy(source: Source) -> tuple[list[BvhJoint], int]:
    """Read joints and End Sites, parents first; returns the offset after MOTION, or -1, too."""
    return _Parser(source).hierarchy()


class _Parser(JointParser[BvhJoint]):
    def __init__(self, source: Source) -> None:
        super().__init__(source, _ITEMS)
        self.n_joints = 0  # number of joints in ``found``; the other entries are End Sites
        self.doubled: list[tuple[int, int, BvhJoint]] = []  # joints whose OFFSET has 6 numbers

    @property
    def keyword(self) -> bytes:
        """The current word in upper case."""
        return (self.text or b"").upper()

    def hierarchy(self) -> tuple[list[BvhJoint], int]:
        """Return the joints and the offset of the motion."""
        if self.keyword != b"HIERARCHY":
            raise self.fault_here(
                "F002.bvh-start: expected HIERARCHY, found {found}{looks}",
                looks=optional(" ({})", self.source.looks_like()),
            )
        self.advance()
        while self.word is not None and (self.open or self.keyword != b"MOTION"):
            self._item()
        if self.open:
            raise self.still_open()
        if not self.found:
            raise self.fault_here("F002.bvh-no-root: expected ROOT, found {found}")
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
                joint=first.called,
            )
        return self.found, -1 if self.word is None else self.word.end()

    def _item(self) -> None:
        keyword = self.keyword
        joint = self.found[self.open[-1]] if self.open else None
        if keyword == b"}":
            self.leave()
        elif joint is None:
            if keyword != b"ROOT":
                raise self.fault_here("F002.bvh-root: expected ROOT or MOTION, found {found}")
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
            raise self.still_open()
        elif joint.is_end:
            raise self.fault_here(
                'F002.bvh-end-item: {joint}: expected OFFSET or "}}", found {found}',
                joint=joint.called,
            )
        else:
            raise self.fault_here(
                "F002.bvh-item: {joint}: expected OFFSET, CHANNELS, JOINT, End Site or "
                '"}}", found {found}',
                joint=joint.called,
            )

    def _open_joint(self, is_end: bool = False) -> None:
        assert self.word is not None  # checked by the caller
        start, keyword = self.word.start(), self.keyword
        self.advance()
        if keyword == b"END" and self.keyword == b"SITE":
            self.advance()
        words: list[Word] = []
        while self.word is not None and self.word.group() not in (b"{", b"}"):
            if self._begins_item():
                break
            words.append(self.word)
            self.advance()
        parent = self.open[-1] if self.open else -1
        joint = BvhJoint(self._name(words), parent, start, is_end)
        if is_end:
            joint.name = self.found[parent].name
        self.enter(joint)
        self.n_joints += not is_end

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

    def _offset(self, joint: BvhJoint) -> None:
        assert self.word is not None  # checked by the caller
        keyword = self.word
        if joint.offset is not None:
            raise self.fault_here(
                "F002.bvh-offset-again: {joint}: expected one OFFSET, found a second one",
                joint=joint.called,
            )
        self.advance()
        values: list[float] = []
        extra: list[Word] = []
        while self.word is not None and (value := self.number) is not None:
            if len(values) < 3:
                values.append(value)
            else:
                extra.append(self.word)
            self.advance()
        if len(values) < 3 or len(extra) not in (0, 3):
            found = extra[0] if extra else len(values)
            places = None if joint.is_end else [self.n_joints - 1]
            self.refuse_numbers(keyword, "OFFSET", 3, found, "joints", places)
            joint.offset = [0.0, 0.0, 0.0]
            while self.word is not None and self.keyword not in self.ends:
                self.advance()
            return
        joint.offset = values
        if extra:  # SOMA writes two offsets, of which the first is the usual one
            self.doubled.append((keyword.start(), self.n_joints - 1, joint))

    def _channels(self, joint: BvhJoint) -> None:
        assert self.word is not None  # checked by the caller
        keyword = self.word
        if joint.channels is not None:
            raise self.fault_here(
                "F002.bvh-channels-again: {joint}: expected one CHANNELS, found a second one",
                joint=joint.called,
            )
        self.advance()
        item = Phrase("{item} of {owner}", item="CHANNELS", owner=joint.called)
        count = self.number
        if count is None or count != int(count) or count < 0:
            raise self.fault_here(wording.COUNT, item=item)
        stated = self.word
        self.advance()
        codes: list[int] = []
        while self.word is not None and self.keyword not in self.ends:
            code = CHANNELS.get(self.keyword)
            if code is None:
                raise self.fault_here(
                    "F002.bvh-channel: {item}: expected a channel name (Xposition … Zrotation), "
                    "found {found}",
                    item=item,
                )
            if code < 3 and code in codes:
                raise self.fault_here(
                    "F002.bvh-position-again: {item}: expected each position channel once, found "
                    "{found} again",
                    item=item,
                )
            codes.append(code)
            self.advance()
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
