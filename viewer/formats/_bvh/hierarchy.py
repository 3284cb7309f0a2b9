"""The HIERARCHY of a BVH file: joints, End Sites and their channels, as the file lists them."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from viewer.errors import FormatError, printable
from viewer.formats._numbers import to_number
from viewer.formats._source import Source, no_number
from viewer.phrases import quoted

__all__ = ["CHANNELS", "BvhJoint", "Hierarchy", "read_hierarchy"]

CHANNELS = {
    f"{axis}{kind}".encode(): code
    for code, (kind, axis) in enumerate(
        (kind, axis) for kind in ("POSITION", "ROTATION") for axis in "XYZ"
    )
}
"""Codes of channel names in capitals: 0 to 2 are positions, 3 to 5 rotations."""

_CHANNEL_NAMES = "Xposition … Zrotation"
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
    """All joints in the order of the file, and where its motion begins.

    Attributes
    ----------
    joints : list of BvhJoint
        End Sites among them; parents come first.
    motion : int
        Offset behind the word MOTION, -1 without one.
    """

    joints: list[BvhJoint] = field(default_factory=list)
    motion: int = -1


def read_hierarchy(source: Source) -> Hierarchy:
    """Read everything up to the word MOTION.

    Raises
    ------
    FormatError
        With file and line, if the text breaks the grammar.
    """
    return _Parser(source).hierarchy()


class _Parser:
    """Walks the words without recursion: real rigs nest, and broken ones nest deeply."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.words = source.words()
        self.word: Word | None = None
        self.keyword = b""  # the word in capitals
        self.found: list[BvhJoint] = []
        self.open: list[int] = []
        self.n_joints = 0  # of those found; the others are End Sites
        self.extra_braces = 0

    def hierarchy(self) -> Hierarchy:
        """Return the joints and the place of the motion."""
        self._advance()
        if self.keyword != b"HIERARCHY":
            looks = self.source.looks_like()
            hint = f" ({looks})" if looks else ""
            raise self._error(f"expected HIERARCHY, found {self._shown()}{hint}")
        self._advance()
        while self.word is not None and (self.open or self.keyword != b"MOTION"):
            self._item()
        if self.open:
            raise self._still_open()
        if not self.found:
            raise self._error(f"expected ROOT, found {self._shown()}")
        if self.extra_braces:
            self.source.warn(f'ignored {self.extra_braces} "}}" after the root')
        return Hierarchy(self.found, -1 if self.word is None else self.word.end())

    def _item(self) -> None:
        keyword = self.keyword
        joint = self.found[self.open[-1]] if self.open else None
        if keyword == b"}":
            self._close()
        elif joint is None:
            if keyword != b"ROOT":
                raise self._error(f"expected ROOT or MOTION, found {self._shown()}")
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
        else:
            wanted = "OFFSET" if joint.is_end else "OFFSET, CHANNELS, JOINT, End Site"
            raise self._error(f'{_called(joint)}: expected {wanted} or "}}", found {self._shown()}')

    def _open_joint(self, is_end: bool = False) -> None:
        assert self.word is not None  # the caller looked at it
        start, keyword = self.word.start(), self.keyword
        self._advance()
        if keyword == b"END" and self.keyword == b"SITE":
            self._advance()
        name: list[str] = []
        while self.word is not None and self.word.group() not in (b"{", b"}"):
            if self._begins_item():
                break
            name.append(self.word.group().decode("utf-8", "surrogateescape"))
            self._advance()
        parent = self.open[-1] if self.open else -1
        joint = BvhJoint(" ".join(name), parent, start, is_end)
        if is_end:
            joint.name = self.found[parent].name
        if self.word is None or self.word.group() != b"{":
            where = start if self.word is None else self.word.start()
            raise self.source.error(
                f'{_called(joint)}: expected "{{", found {self._shown()}', where
            )
        self.open.append(len(self.found))
        self.found.append(joint)
        self.n_joints += not is_end
        self._advance()

    def _begins_item(self) -> bool:
        """Return whether a name is over because its "{" is missing: a keyword with its number."""
        assert self.word is not None  # the caller looked at it
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
        assert self.word is not None  # the caller looked at it
        keyword = self.word
        if joint.offset is not None:
            raise self._error(f"{_called(joint)}: expected one OFFSET, found another")
        self._advance()
        values: list[float] = []
        while len(values) < 3:
            value = None if self.word is None else to_number(self.word.group())
            if value is None:
                self._refuse_offset(joint, self._offset_error(joint, keyword, len(values)))
                return
            values.append(value)
            self._advance()
        if self.word is not None and to_number(self.word.group()) is not None:
            more = f"expected 3 numbers, found more: {self._shown()}"
            self._refuse_offset(joint, self._error(f"OFFSET of {_called(joint)}: {more}"))
        joint.offset = values

    def _offset_error(self, joint: BvhJoint, keyword: Word, found: int) -> FormatError:
        if self.word is not None and self.keyword not in (b"{", b"}", *_ITEMS):
            return self._error(f"OFFSET of {_called(joint)}: {no_number(self.word.group())}")
        return self.source.error(
            f"OFFSET of {_called(joint)}: expected 3 numbers, found {found}", keyword.start()
        )

    def _refuse_offset(self, joint: BvhJoint, error: FormatError) -> None:
        """Refuse an OFFSET; where faults are noted it is 0 0 0, and reading goes on behind it."""
        self.source.refuse_error(error, 1, "joints", () if joint.is_end else [self.n_joints - 1])
        joint.offset = [0.0, 0.0, 0.0]
        while self.word is not None and self.keyword not in (b"{", b"}", *_ITEMS):
            self._advance()

    def _channels(self, joint: BvhJoint) -> None:
        assert self.word is not None  # the caller looked at it
        keyword = self.word
        if joint.channels is not None:
            raise self._error(f"{_called(joint)}: expected one CHANNELS, found another")
        self._advance()
        count = None if self.word is None else to_number(self.word.group())
        if count is None or count != int(count) or count < 0:
            raise self._error(
                f"CHANNELS of {_called(joint)}: expected a count, found {self._shown()}"
            )
        stated = self.word
        self._advance()
        codes: list[int] = []
        while self.word is not None and self.keyword not in (b"{", b"}", *_ITEMS):
            code = CHANNELS.get(self.keyword)
            if code is None:
                raise self._error(
                    f"CHANNELS of {_called(joint)}: expected {_CHANNEL_NAMES}, "
                    f"found {self._shown()}"
                )
            if code < 3 and code in codes:
                raise self._error(
                    f"CHANNELS of {_called(joint)}: expected each position once, "
                    f"found {self._shown()} again"
                )
            codes.append(code)
            self._advance()
        if len(codes) != count:
            raise self.source.error(
                f"CHANNELS of {_called(joint)}: expected {count:.0f} channel names, "
                f"found {len(codes)}",
                stated.start() if stated else keyword.start(),
            )
        joint.channels = codes

    def _advance(self) -> None:
        self.word = next(self.words, None)
        self.keyword = b"" if self.word is None else self.word.group().upper()

    def _shown(self) -> str:
        return "the end of the file" if self.word is None else quoted(self.word.group())

    def _error(self, message: str) -> FormatError:
        where = len(self.source.data.rstrip()) if self.word is None else self.word.start()
        return self.source.error(message, where)

    def _still_open(self) -> FormatError:
        joint = self.found[self.open[-1]]
        return self._error(
            f'expected "}}", found {self._shown()}: {_called(joint)} '
            f"(line {self.source.line(joint.start)}) is still open"
        )


def _called(joint: BvhJoint) -> str:
    name = f"joint {printable(joint.name, 60)}" if joint.name else "joint without a name"
    return f"End Site of {name}" if joint.is_end else name
