"""State of the pickle machine: the bytes, a stack with marks, the memo, and a budget.

A pickle is a program for a stack machine. The opcodes are implemented in ``steps.py``; this module
contains the state that they share. Nothing is recursive, no length is trusted before the bytes are
known to exist, and the budget limits time and memory for any sequence of opcodes.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from viewer.diagnostics import Phrase
from viewer.errors import FormatError
from viewer.formats._archive.file_window import Data
from viewer.formats._pickle.values import Span
from viewer.formats._source import Source

__all__ = ["Machine"]

# Maximum number of items; a body model needs a few hundred, a motion in plain lists about 100,000.
# Results of trackers, which write a dict per frame and person, need one for every eight bytes.
_MAX_STEPS = 1_000_000
_BYTES_PER_STEP = 4
_MOST_STEPS = 20_000_000
_DEEPEST = 3  # maximum nesting of pickles inside pickles; real files have two levels
_LONGEST_LINE = 256  # maximum number of characters of a name or number in the text protocols
_INTEGER = re.compile(rb"[+-]?[0-9]+")


class Machine:
    """A pickle being read.

    Attributes
    ----------
    data : bytes or FileWindow
        The file.
    at : int
        Offset of the next byte.
    stack : list
        Values; those below the last mark are currently inaccessible.
    memo : dict
        Values by index; a dict, so that a large index takes no memory.
    end : int
        Offset of the end of the pickle's bytes.
    depth : int
        Number of pickles that contain this one.
    persistent, load_bytes : callable or None
        Functions that return the value of a persistent id, and the value of torch's storages saved
        as bytes; None if the file must not contain these.
    """

    def __init__(
        self, source: Source, data: Data | None = None, start: int = 0, end: int | None = None
    ) -> None:
        self.source, self.at = source, start
        self.data: Data = source.data if data is None else data
        self.end = len(self.data) if end is None else end
        self.depth = 0
        self.persistent: Callable[[object], object] | None = None
        self.load_bytes: Callable[[Machine, Span], object] | None = None
        self.stack: list[object] = []
        self.memo: dict[int, object] = {}
        self._marks: list[int] = []
        self._floor = 0  # height of the stack at the last mark
        self._most = max(_MAX_STEPS, min((self.end - start) // _BYTES_PER_STEP, _MOST_STEPS))
        self._budget = self._most
        self._step_at = 0

    def fail(self, problem: Phrase) -> FormatError:
        """Return an error with the offset of the current opcode."""
        return self.source.fault("F002.pickle-step", problem=problem, at=self._step_at)

    def next_step(self) -> int:
        """Return the next opcode, and deduct it from the budget."""
        self._step_at = self.at
        if self.at >= self.end:
            raise self.cut_short(1, 0)
        self.spend(1)
        self.at += 1
        return self.data[self.at - 1]

    def spend(self, count: int) -> None:
        """Deduct a number of items from the budget; reject a pickle that exceeds it."""
        self._budget -= count
        if self._budget < 0:
            raise self.fail(Phrase("pickle-steps", most=self._most))

    def nested(self, data: Data, start: int, end: int) -> Machine:
        """Return a machine for a pickle inside this one; it continues with the same budget.

        Raises
        ------
        FormatError
            If pickles are nested too deeply.
        """
        if self.depth >= _DEEPEST:
            raise self.fail(Phrase("pickle-nested", most=_DEEPEST))
        inner = Machine(self.source, data, start, end)
        inner.depth, inner._budget, inner._most = self.depth + 1, self._budget, self._most
        return inner

    def rejoin(self, inner: Machine) -> None:
        """Continue with the budget that a nested machine has left."""
        self._budget = inner._budget

    # Methods that read bytes.

    def number(self, size: int, *, is_signed: bool = False) -> int:
        """Read an integer of ``size`` bytes, least significant first."""
        start = self.skip(size)
        return int.from_bytes(self.data[start : self.at], "little", signed=is_signed)

    def skip(self, size: int) -> int:
        """Skip bytes, which must exist, and return the offset of the first."""
        start = self.at
        if size < 0 or size > self.end - start:
            raise self.cut_short(size, self.end - start)
        self.at = start + size
        return start

    def span(self, width: int, coding: str | None = None, *, is_signed: bool = False) -> Span:
        """Read a length stored in ``width`` bytes, and return the span of that length after it."""
        start = self.skip(self.number(width, is_signed=is_signed))
        return Span(self.data, start, self.at, coding)

    def line(self, longest: int | None = _LONGEST_LINE) -> tuple[int, int]:
        """Skip a line, and return the start and end of its text."""
        start = self.at
        end = self.data.find(b"\n", start, self.end)
        if end < 0:
            raise self.fail(Phrase("pickle-line-end"))
        if longest is not None and end - start > longest:
            raise self.fail(Phrase("pickle-line", most=longest, found=end - start))
        self.at = end + 1
        return start, end

    def word(self) -> bytes:
        """Read a line with a name or a number."""
        start, end = self.line()
        if self.data[start:end].endswith(b"\r"):
            raise self.damaged_line_ends()
        return self.data[start:end]

    def decimal(self, word: bytes) -> int:
        """Return a number of the text protocols, whose length has been checked."""
        if not _INTEGER.fullmatch(word):
            raise self.fail(Phrase("pickle-decimal", found=word))
        return int(word)

    def cut_short(self, wanted: int, found: int) -> FormatError:
        """Return the error for a length that exceeds the rest of the file."""
        return self.fail(Phrase("pickle-cut", expected=wanted, found=found))

    def damaged_line_ends(self) -> FormatError:
        """Return the error for a file damaged by a text-mode transfer."""
        return self.source.fault("F002.pickle-line-ends")

    # Methods of the stack.

    def push(self, value: object) -> None:
        """Push a value onto the stack."""
        self.stack.append(value)

    def top(self) -> object:
        """Return the topmost value."""
        if len(self.stack) <= self._floor:
            raise self.fail(Phrase("pickle-stack"))
        return self.stack[-1]

    def pop(self) -> object:
        """Pop the topmost value, but never one below a mark."""
        value = self.top()
        self.stack.pop()
        return value

    def mark(self) -> None:
        """Set a mark, the start of a list of values."""
        self._marks.append(self._floor)
        self._floor = len(self.stack)

    def pop_mark(self) -> list[object]:
        """Pop all values since the last mark, and the mark."""
        if not self._marks:
            raise self.fail(Phrase("pickle-mark"))
        values = self.stack[self._floor :]
        del self.stack[self._floor :]
        self._floor = self._marks.pop()
        return values

    def drop(self) -> None:
        """Pop the topmost value, or the last mark if there is no value above it."""
        if self._marks and len(self.stack) == self._floor:
            self.pop_mark()
        else:
            self.pop()

    # Methods of the memo.

    def remember(self, index: int) -> None:
        """Store the topmost value in the memo."""
        if index < 0:
            raise self.fail(Phrase("pickle-memo", found=index))
        self.memo[index] = self.top()

    def recall(self, index: int) -> None:
        """Push a value from the memo onto the stack."""
        if index not in self.memo:
            raise self.fail(Phrase("pickle-recall", found=index))
        self.stack.append(self.memo[index])
