"""Parsing of a text word by word, and of joints nested in braces (``.skel``, ``.bvh``)."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import Generic, Protocol, TypeVar

from viewer.diagnostics import Part, Phrase, wording
from viewer.errors import FormatError
from viewer.formats._source import Source
from viewer.formats._text.numbers import to_number
from viewer.formats._text.words import number_key
from viewer.phrases import brief, counted, quoted

Word = re.Match[bytes]


class WordParser:
    """Reading of a text word by word, without recursion for nested items."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self._words = source.words()
        self.word: Word | None = next(self._words, None)

    def advance(self) -> None:
        """Go to the next word."""
        self.word = next(self._words, None)

    @property
    def text(self) -> bytes | None:
        """The current word; None at the end of the file."""
        return None if self.word is None else self.word.group()

    @property
    def keyword(self) -> bytes:
        """The current word, as keywords are compared; empty at the end of the file."""
        return self.text or b""

    @property
    def number(self) -> float | None:
        """The value of the current word; None if it is no number."""
        return None if self.word is None else to_number(self.word.group())

    @property
    def place(self) -> int:
        """Offset of the current word, or of the end of the file."""
        return self.source.end if self.word is None else self.word.start()

    def fault_here(self, key: str, **values: object) -> FormatError:
        """Return the exception for an error at the current word."""
        return self.source.fault(key, self.place, found=quoted(self.text), **values)


class _Joint(Protocol):
    start: int

    @property
    def called(self) -> Phrase: ...


Joint = TypeVar("Joint", bound=_Joint)


def called_joint(name: str) -> Phrase:
    """Return the phrase for a joint in messages."""
    return Phrase("joint {name}", name=brief(name)) if name else Phrase("unnamed joint")


class JointParser(WordParser, Generic[Joint]):
    """Parser of nested joints; invalid files may be nested arbitrarily deeply."""

    def __init__(self, source: Source, keywords: Collection[bytes]) -> None:
        super().__init__(source)
        self.ends = frozenset((b"{", b"}", *keywords))  # words that end an item
        self.found: list[Joint] = []
        self.open: list[int] = []
        self.extra_braces = 0

    def enter(self, joint: Joint) -> None:
        """Begin a joint, whose opening brace is the current word."""
        if self.text != b"{":
            where = joint.start if self.word is None else self.word.start()
            found = quoted(self.text)
            raise self.source.fault(wording.OPENING, where, item=joint.called, found=found)
        self.open.append(len(self.found))
        self.found.append(joint)
        self.advance()

    def leave(self) -> None:
        """End a joint at a closing brace, or count a brace too many."""
        if self.open:
            self.open.pop()
        else:
            self.extra_braces += 1
        self.advance()

    def still_open(self) -> FormatError:
        """Return the exception for a joint that is not closed at the current word."""
        joint = self.found[self.open[-1]]
        line = self.source.line(joint.start)
        return self.fault_here(wording.JOINT_OPEN, joint=joint.called, line=line)

    def refuse_numbers(
        self,
        keyword: Word,
        item: str,
        expected: int,
        found: int | Word,
        part: Part,
        places: list[int] | None,
        at_end: str = wording.WIDTH,
    ) -> None:
        """Record an error in an item of a joint: ``found`` numbers, or a word beyond the last."""
        owner = self.found[self.open[-1]].called
        where, values = keyword.start(), dict[str, object](expected=counted(expected, "number"))
        if not isinstance(found, int):
            key, where, values["found"] = wording.MORE, found.start(), quoted(found.group())
        elif self.word is None or self.keyword in self.ends:
            key, values["found"] = at_end if self.word is None else wording.WIDTH, found
        else:
            word = self.word.group()
            key, where, values = number_key(word), self.word.start(), {"found": quoted(word)}
        item_of = Phrase("{item} of {owner}", item=item, owner=owner)
        self.source.refuse(key, where, 1, part, places, item=item_of, **values)
